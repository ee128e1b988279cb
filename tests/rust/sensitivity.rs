//! Derivatives through turns, sticks and releases against finite differences.

use pendmap::integrate::State;
use pendmap::integrate::reference::event::EventKind;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::integrate::reference::sample::sample;
use pendmap::integrate::reference::sensitivity::sensitivities;
use pendmap::model::{Effect, Kind, Pendulum};

use crate::support::driven;

const TOLERANCE: f64 = 1e-14;

fn with_effects(pendulum: Pendulum, effects: &[(Kind, &[f64])]) -> Pendulum {
    effects.iter().fold(pendulum, |pendulum, (kind, values)| {
        let effect = Effect::new(kind.clone(), values).expect("in range");
        pendulum.with_effect(effect).expect("once")
    })
}

/// `pendulum` and `start` with quantity `index`, in the order of the derivatives, changed by `h`.
fn changed(pendulum: &Pendulum, start: State, index: usize, h: f64) -> (Pendulum, State) {
    let (mut pendulum, mut start) = (pendulum.clone(), start);
    let mut slots = vec![
        &mut pendulum.gamma,
        &mut pendulum.theta_r,
        &mut pendulum.torque,
        &mut pendulum.drive.p,
        &mut pendulum.drive.omega,
        &mut pendulum.drive.phase,
    ];
    for effect in &mut pendulum.effects {
        let count = effect.values().len();
        slots.extend(effect.parameters.iter_mut().take(count));
    }
    slots.extend(start.iter_mut());
    *slots[index] += h;
    (pendulum, start)
}

fn states(pendulum: &Pendulum, start: State, times: &[f64]) -> Vec<State> {
    let ode = OdeProblem::new(pendulum, true, TOLERANCE, |_, value| value);
    sample(&ode, 0.0, start, times, |_, _| true).states
}

/// The largest difference from finite differences, over the size of each derivative or 1.
fn worst(pendulum: &Pendulum, start: State, times: &[f64], skip: &[&str]) -> f64 {
    let found = sensitivities(pendulum, None, start, 0.0, times, TOLERANCE);
    let mut worst = 0_f64;
    for (index, name) in found.names.iter().enumerate() {
        if skip.contains(&name.as_str()) {
            continue;
        }
        let difference = |h: f64| {
            let [plus, minus] = [h, -h].map(|h| {
                let (pendulum, start) = changed(pendulum, start, index, h);
                states(&pendulum, start, times)
            });
            plus.iter()
                .zip(&minus)
                .map(|(a, b)| [0, 1].map(|k| (a[k] - b[k]) / (2.0 * h)))
                .collect::<Vec<State>>()
        };
        let (coarse, fine) = (difference(2e-5), difference(1e-5));
        for (k, (coarse, fine)) in coarse.iter().zip(&fine).enumerate() {
            for of in 0..2 {
                let expected = (4.0 * fine[of] - coarse[of]) / 3.0;
                let slope = found.slopes[k][index][of];
                let error = (slope - expected).abs() / expected.abs().max(1.0);
                worst = worst.max(error);
            }
        }
    }
    worst
}

fn every(interval: f64, until: f64) -> Vec<f64> {
    (0..=(until / interval) as usize).map(|k| k as f64 * interval).collect()
}

#[test]
fn derivatives_hold_through_turns_sticks_and_releases() {
    let cases = [
        (driven(0.1, 1.5, 0.87).with_friction(0.2), [-0.43, 1.03]),
        (driven(0.1, 0.8, 1.2).with_friction(0.15), [2.79, 0.49]),
        (driven(0.1, 1.5, 0.87).with_friction(0.2), [-2.82, 0.83]),
        (driven(0.05, 2.0, 1.0).with_friction(0.3), [1.72, 1.16]),
    ];
    for (pendulum, start) in cases {
        let pendulum = pendulum.expect("in range");
        let times = every(0.37, 15.0);
        let run = sensitivities(&pendulum, None, start, 0.0, &times, TOLERANCE);
        assert!(run.events.iter().any(|event| event.kind == EventKind::Turn));
        let error = worst(&pendulum, start, &times, &[]);
        assert!(error < 1e-6, "{start:?}: {error:e}");
    }
}

#[test]
fn derivatives_hold_for_effects() {
    let pendulum = with_effects(
        driven(0.1, 1.1, 1.3).with_friction(0.1).expect("in range"),
        &[
            (Kind::QuadraticDrag, &[0.07]),
            (Kind::BearingHarmonic, &[0.05, 3.0, 0.4]),
            (Kind::BearingHarmonic, &[0.02, 7.0, -1.0]),
        ],
    );
    let start = [1.3, 0.2];
    let error = worst(&pendulum, start, &every(0.41, 14.0), &[]);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn a_friction_of_zero_has_a_derivative() {
    // From the side on which it exists; the sense of motion must be known throughout.
    let pendulum = driven(0.1, 0.6, 2.0);
    let (start, times) = ([1.0, 0.3], every(0.5, 12.0));
    let run = sensitivities(&pendulum, None, start, 0.0, &times, TOLERANCE);
    let index = run.names.iter().position(|name| name == "theta_r").expect("a parameter");
    let h = 1e-5;
    let at = |factor: f64| {
        states(&pendulum.clone().with_friction(factor * h).expect("in range"), start, &times)
    };
    let (none, one, two) = (at(0.0), at(1.0), at(2.0));
    for k in 0..times.len() {
        for of in 0..2 {
            let expected = (4.0 * one[k][of] - two[k][of] - 3.0 * none[k][of]) / (2.0 * h);
            let slope = run.slopes[k][index][of];
            assert!((slope - expected).abs() < 1e-5, "{} {slope} {expected}", times[k]);
        }
    }
}

#[test]
fn passes_agree_bit_for_bit() {
    // Seventeen names take several passes: all have the values of the plain trajectory.
    let harmonics: [(Kind, &[f64]); 3] =
        [(); 3].map(|()| (Kind::BearingHarmonic, &[0.05, 3.0, 0.4][..]));
    let pendulum = with_effects(driven(0.1, 1.5, 0.87).with_friction(0.1).expect("ok"), &harmonics);
    let (start, times) = ([-2.82, 0.83], every(0.5, 20.0));
    let run = sensitivities(&pendulum, None, start, 0.0, &times, TOLERANCE);
    assert_eq!(run.names.len(), 17);
    assert!(run.slopes.iter().all(|slopes| slopes.len() == 17));
    assert_eq!(run.states, states(&pendulum, start, &times));
}
