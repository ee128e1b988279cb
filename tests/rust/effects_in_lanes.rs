//! The library of effects in lanes and maps: equality of bits, errors, refusals.

use std::f64::consts::PI;

use pendmap::error::Error;
use pendmap::integrate::accuracy::distance;
use pendmap::integrate::reference::flow::Flow;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::integrate::reference::sample::sample;
use pendmap::integrate::{State, Strobe};
use pendmap::maps::advance::advance;
use pendmap::maps::basins::basins;
use pendmap::maps::control::Control;
use pendmap::model::effects::Mappable;
use pendmap::model::{Effect, Kind, Pendulum};

use crate::effects::{Draws, has};
use crate::lanes::result;
use crate::support::{advanced, driven, instruction_sets, plane, simd, spread, unchecked};

/// All effects that a map may have, each without and with Coulomb friction.
fn mappable() -> Vec<(Kind, Pendulum)> {
    let mut draws = Draws(6);
    let mut all = Vec::new();
    for kind in Kind::ALL {
        if kind.definition().mappable == Mappable::No {
            continue;
        }
        for theta_r in [0.0, 0.05] {
            let base = driven(0.1, 0.6, 2.0).with_friction(theta_r).expect("in range");
            let effect = draws.effect(kind);
            let twice = match kind {
                Kind::ViscousDamping => true,
                Kind::CoulombFriction => theta_r > 0.0,
                _ => false,
            };
            if !twice {
                all.push((kind.clone(), has(base, effect)));
            }
        }
    }
    all
}

#[test]
fn one_at_a_time_gives_the_same_bits() {
    for (_, pendulum) in mappable() {
        for simd in instruction_sets() {
            let strobe = Strobe::new(&pendulum, 30, simd);
            let [all, each] =
                [false, true].map(|singly| result(&strobe, &spread(100, PI, 3.0), 1, singly));
            assert_eq!(all, each, "{simd}, {pendulum:?}");
        }
    }
}

/// The median and the greatest distance from the reference integrator after three periods.
fn errors_in_lanes(pendulum: &Pendulum, steps: usize) -> [f64; 2] {
    let starts = spread(60, PI, 3.0);
    let flow = Flow::new(pendulum);
    let strobe = Strobe::new(pendulum, steps, simd());
    let ends = advanced(&strobe, &starts, 3);
    let far = |(start, end): (&State, &State)| {
        distance(*end, flow.carry(*start, 0.0, 3.0 * pendulum.period()).state)
    };
    let mut errors: Vec<f64> = starts.iter().zip(&ends).map(far).collect();
    errors.sort_by(f64::total_cmp);
    [errors[errors.len() / 2], errors[errors.len() - 1]]
}

#[test]
fn lanes_agree_with_the_reference_integrator() {
    for (kind, pendulum) in mappable() {
        let [median, error] = errors_in_lanes(&pendulum, 120);
        println!("{median:e} {error:e} {:?} {}", pendulum.effects, pendulum.theta_r);
        let allowed = match kind {
            // After a turn its torque grows as a non-integer power of time.
            Kind::PowerLawDrag => 1e-7,
            _ => 1e-9,
        };
        assert!(error < allowed, "{pendulum:?}: {error:e}");
    }
}

#[test]
fn a_friction_that_turns_negative_holds_nothing() {
    let base = driven(0.1, 0.6, 2.0).with_friction(0.05).expect("in range");
    for (kind, values) in [
        (Kind::StribeckFriction, &[-0.08, 0.5][..]),
        (Kind::LoadDependentFriction, &[0.3]),
        (Kind::CoulombDrift, &[-4e-4]),
    ] {
        let pendulum = has(base.clone(), Effect::new(kind.clone(), values).expect("in range"));
        let [median, error] = errors_in_lanes(&pendulum, 200);
        println!("{kind:?} {median:e} {error:e}");
        assert!(error < 1e-8, "{kind:?}: {error:e}");
        // At a quarter turn all three are negative, and the load drives the motion.
        let arrival = Flow::new(&pendulum).carry([0.5 * PI, 0.0], 0.0, 0.1);
        assert!(arrival.state[1] < -0.01 && !arrival.stuck, "{kind:?}: {arrival:?}");
    }
}

#[test]
fn drifts_are_held_in_maps_and_go_on_in_trajectories() {
    let effect = |kind: Kind, r| {
        let shape = [r, 200.0];
        let count = kind.definition().parameters.count();
        Effect::new(kind, &shape[..count]).expect("in range")
    };
    let plain = driven(0.1, 0.6, 2.0).with_friction(0.05).expect("in range");
    let rougher = driven(0.1, 0.6, 2.0).with_friction(0.15).expect("in range");
    let drifting = has(plain, effect(Kind::CoulombDrift, 4e-4));
    let states = spread(50, PI, 3.0);
    let [a, b] = [&rougher, &drifting].map(|p| advanced(&Strobe::new(p, 150, simd()), &states, 3));
    for (a, b) in a.iter().zip(&b) {
        assert!(distance(*a, *b) < 1e-10, "{a:?} {b:?}");
    }
    for (kind, size) in [
        (Kind::CoulombDrift, 3e-4),
        (Kind::ViscousDrift, 3e-4),
        (Kind::NaturalFrequencyDrift, 3e-4),
        (Kind::CoulombWarmUp, -5e-2),
        (Kind::ViscousWarmUp, -5e-2),
    ] {
        // Two stretches in succession equal one.
        let early =
            has(Pendulum::new(0.0, 0.0, 1.0, 0.0, 0.0).expect("ok"), effect(kind.clone(), size));
        let mut late = early.clone();
        late.lab_time += 5.0;
        let end = |pendulum: &Pendulum, from: State, until: f64| {
            let ode = OdeProblem::new(pendulum, true, 1e-13, |_, value| value);
            sample(&ode, 0.0, from, &[until], |_, _| true).states[0]
        };
        let whole = end(&early, [2.0, 0.0], 9.0);
        let parts = end(&late, end(&early, [2.0, 0.0], 5.0), 4.0);
        assert!(distance(whole, parts) < 1e-11, "{kind:?}: {whole:?} {parts:?}");
        let held = end(&early, end(&early, [2.0, 0.0], 5.0), 4.0);
        assert!(distance(whole, held) > 1e-4, "{kind:?}: {whole:?} {held:?}");
    }
}

#[test]
fn maps_refuse_effects_that_do_not_repeat_every_turn() {
    let effect = |kind: Kind, values: &[f64]| Effect::new(kind, values).expect("in range");
    for (effect, allowed) in [
        (effect(Kind::ElasticRestoring, &[0.01]), true),
        (effect(Kind::BearingHarmonic, &[0.1, 2.5, 0.0]), false),
        (effect(Kind::BearingHarmonic, &[0.1, 2.0, 0.0]), true),
        (effect(Kind::BearingHarmonic, &[0.0, 2.5, 0.0]), true),
        (effect(Kind::EncoderOffset, &[0.1]), true),
    ] {
        let pendulum = has(driven(0.1, 0.6, 2.0), effect.clone());
        let map = basins(&pendulum, &plane(4), &unchecked(), &Control::default()).map(|_| ());
        let strobe = Strobe::new(&pendulum, 20, simd());
        let moved = advance(&strobe, &[[1.0, 0.0]], 1, 1, &Control::default()).map(|_| ());
        for result in [map, moved] {
            match result {
                Ok(()) => assert!(allowed, "{effect:?}"),
                Err(error) => {
                    assert!(!allowed && matches!(error, Error::NotMappable { .. }), "{error}");
                    let line = error.to_string();
                    assert!(line.starts_with(effect.kind.definition().name), "{line}");
                    assert!(line.contains("every turn") && line.lines().count() == 1, "{line}");
                }
            }
        }
    }
}
