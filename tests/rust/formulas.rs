//! User-defined effects: against the library's, in every respect, and refusals.

use std::f64::consts::PI;

use pendmap::error::Error;
use pendmap::integrate::Strobe;
use pendmap::integrate::accuracy::distance;
use pendmap::integrate::reference::flow::Flow;
use pendmap::maps::advance::advance;
use pendmap::maps::control::Control;
use pendmap::model::effects::{Action, Mappable};
use pendmap::model::formula::Spec;
use pendmap::model::{Effect, Formula, Kind, Pendulum};
use proptest::prelude::*;

use crate::effects::{Draws, derivatives, evaluated, has};
use crate::effects_as_formulas::{formula, rewritten, term};
use crate::lanes::result;
use crate::support::{
    advanced, basins_on_plane, cell_names, driven, instruction_sets, simd, spread, undriven,
};

/// The formula with values for its parameters.
fn effect(spec: &Spec, values: &[f64]) -> Effect {
    let formula = Formula::new(spec).unwrap_or_else(|error| panic!("{error}"));
    Effect::new(Kind::Formula(formula), values).expect("in range")
}

/// Every effect that can be rewritten, and its formula, in the same pendulum.
fn twins(base: &Pendulum) -> Vec<(Kind, Pendulum, Pendulum)> {
    let mut all = Vec::new();
    for kind in Kind::ALL {
        // Each alone: another effect of the library changes none of them.
        let seed = kind.definition().name.bytes().map(u64::from).sum();
        let own = match kind {
            // Below the friction of the tests: their sum brakes everywhere.
            Kind::LoadDependentFriction => Effect::new(kind.clone(), &[0.02]).expect("in range"),
            _ => Draws(seed).effect(kind),
        };
        if let Some(other) = rewritten(&own) {
            // An effect with its own parameter in the model may occur only once.
            let bare = match kind {
                Kind::ViscousDamping => Pendulum { gamma: 0.0, ..base.clone() },
                Kind::CoulombFriction => Pendulum { theta_r: 0.0, ..base.clone() },
                _ => base.clone(),
            };
            all.push((kind.clone(), has(bare.clone(), own), has(bare, other)));
        }
    }
    assert!(all.len() > 12, "{}", all.len());
    all
}

#[test]
fn a_formula_pushes_as_the_library_does() {
    let mut draws = Draws(9);
    for (kind, library, own) in twins(&driven(0.1, 0.6, 2.0)) {
        for _ in 0..300 {
            let [theta, velocity] = [draws.between([-9.0, 9.0]), draws.between([-3.0, 3.0])];
            let tau = draws.between([0.0, 20.0]);
            let [a, b] = [&library, &own].map(|p| p.acceleration(tau, theta, velocity));
            assert!((a - b).abs() < 1e-14 * (1.0 + a.abs()) * 8.0, "{kind:?}: {a} {b}");
        }
        let (kept, mirrored) = (library.is_mirror_symmetric(), own.is_mirror_symmetric());
        assert_eq!(kept, mirrored, "{kind:?}");
        assert_eq!(library.check_mappable().is_ok(), own.check_mappable().is_ok(), "{kind:?}");
        assert_eq!(library.has_friction(), own.has_friction(), "{kind:?}");
        // Only the library's viscous damping has no cost.
        let viscous = kind == Kind::ViscousDamping;
        assert!(viscous || library.route() == own.route(), "{kind:?}");
        assert_eq!(library.drifts(), own.drifts(), "{kind:?}");
        assert_eq!(library.has_corner(), own.has_corner(), "{kind:?}");
        assert_eq!(library.period().to_bits(), own.period().to_bits(), "{kind:?}");
    }
}

#[test]
fn a_formula_s_trajectories_are_the_library_s() {
    for theta_r in [0.0, 0.05] {
        let base = driven(0.1, 0.6, 2.0).with_friction(theta_r).expect("in range");
        for (kind, library, own) in twins(&base) {
            for start in spread(12, PI, 3.0) {
                let arrive = |pendulum: &Pendulum| {
                    Flow::new(pendulum).carry(start, 0.0, 3.0 * pendulum.period())
                };
                let (a, b) = (arrive(&library), arrive(&own));
                let apart = distance(a.state, b.state);
                assert!(apart < 1e-12, "{kind:?} from {start:?}: {apart:e}");
                assert_eq!((a.stuck, a.stuck_for_ever), (b.stuck, b.stuck_for_ever), "{kind:?}");
                for k in 0..2 {
                    for (x, y) in a.derivative[k].iter().zip(b.derivative[k]) {
                        assert!((x - y).abs() < 1e-8, "{kind:?} from {start:?}: {x} {y}");
                    }
                }
            }
            if own.check_mappable().is_ok() && own.route() == library.route() {
                let starts = spread(200, PI, 3.0);
                let [a, b] =
                    [&library, &own].map(|p| advanced(&Strobe::new(p, 60, simd()), &starts, 3));
                for ((a, b), start) in a.iter().zip(&b).zip(&starts) {
                    let apart = distance(*a, *b);
                    // Without fused operations the two round differently, also at corners.
                    assert!(apart < 1e-11, "{kind:?} in lanes from {start:?}: {apart:e}");
                }
            }
        }
    }
}

#[test]
fn a_formula_s_maps_are_the_library_s_cell_for_cell() {
    for theta_r in [0.0, 0.03] {
        let base = driven(0.1, 0.6, 2.0).with_friction(theta_r).expect("in range");
        // Maps with friction take long: every third.
        let every = if theta_r > 0.0 { 3 } else { 1 };
        for (kind, library, own) in twins(&base).into_iter().step_by(every) {
            if own.check_mappable().is_ok() {
                // If a corner moves the end of each rest, the release is searched step by step.
                let side = if library.has_corner() && theta_r > 0.0 { 4 } else { 10 };
                let [a, b] = [&library, &own].map(|pendulum| basins_on_plane(pendulum, side));
                let (a, b) = (cell_names(&a), cell_names(&b));
                let apart = a.iter().zip(&b).filter(|(a, b)| a != b).count();
                // Effects with closed forms in the library take general steps as formulas: a cell
                // within their error of a boundary may be on its other side.
                let other = matches!(kind, Kind::ViscousDamping | Kind::BiasTorque);
                let allowed = usize::from(other);
                assert!(apart <= allowed, "{kind:?}: {apart} cells");
            }
        }
    }
}

/// Terms with all functions and operators, each with the powers of its parameters.
const TERMS: [(&str, &[(&str, f64)]); 12] = [
    ("-k*sqrt(abs(v))*sign(v)", &[("k", 1.5)]),
    ("-k*abs(v)^1.5*sign(v) - c*v", &[("k", 0.5), ("c", 1.0)]),
    ("k*tanh(3*sin(theta) + v/w0)*exp(-cos(2*theta))", &[("k", 2.0)]),
    ("k*log(2 + cos(theta))/(1 + v**2/w0**2)", &[("k", 2.0)]),
    ("-k*(1 + d*cos(theta - 1))*sign(v)", &[("k", 2.0), ("d", 0.0)]),
    ("-k*(sign(v) + d)*exp(-abs(v)/w0)", &[("k", 2.0), ("d", 0.0)]),
    ("k*cos(phase)^2*sin(theta)", &[("k", 2.0)]),
    ("-k*v*max(0, 1 - d*cos(theta))", &[("k", 1.0), ("d", 0.0)]),
    ("-k*v*abs(sin(theta) - 0.3)", &[("k", 1.0)]),
    ("k*min(cos(theta), v/w0)", &[("k", 2.0)]),
    ("-k*abs(v)^3*w0^-1*sign(v) + k*pi*0", &[("k", 0.0)]),
    ("-2^-1*k*(v - w0*sin(theta))^3", &[("k", -1.0)]),
];

fn of(term: (&str, &[(&str, f64)]), values: &[f64]) -> Effect {
    effect(&formula("mine", term.0, term.1), &values[..term.1.len()])
}

#[test]
fn derivatives_of_formulas_agree_with_differences() {
    let mut draws = Draws(11);
    for term in TERMS {
        for _ in 0..60 {
            let values = [draws.between([0.05, 0.3]), draws.between([0.1, 0.6])];
            let pendulum = has(driven(0.1, 0.6, 2.0), of(term, &values));
            let at = [draws.between([-4.0, 4.0]), draws.between([0.2, 3.0])];
            let tau = draws.between([0.0, 9.0]);
            let exact = derivatives(&pendulum, tau, at);
            for index in 0..pendulum.parameters().len() + 2 {
                let difference = |h: f64| {
                    let [plus, minus] =
                        [h, -h].map(|h| evaluated(&pendulum, tau, at, Some((index, h)))[0]);
                    (plus - minus) / (2.0 * h)
                };
                let (coarse, fine) = (difference(2e-4), difference(1e-4));
                // A kink lies between the four points if they do not agree.
                if (fine - coarse).abs() < 1e-5 {
                    let error = (exact[0].slope[index] - (4.0 * fine - coarse) / 3.0).abs();
                    assert!(error < 1e-8, "{} by {index} at {at:?}: {error:e}", term.0);
                }
            }
        }
    }
}

#[test]
fn one_at_a_time_gives_a_formula_s_bits() {
    for term in TERMS {
        for theta_r in [0.0, 0.05] {
            let base = driven(0.1, 0.6, 2.0).with_friction(theta_r).expect("in range");
            let pendulum = has(base, of(term, &[0.1, 0.4]));
            for simd in instruction_sets() {
                let strobe = Strobe::new(&pendulum, 30, simd);
                let [all, each] =
                    [false, true].map(|singly| result(&strobe, &spread(100, PI, 3.0), 1, singly));
                assert_eq!(all, each, "{simd}, {}", term.0);
            }
        }
    }
}

#[test]
fn lanes_follow_formulas_as_the_reference_does() {
    for term in TERMS {
        let pendulum = has(driven(0.1, 0.6, 2.0), of(term, &[0.1, 0.4]));
        let starts = spread(60, PI, 3.0);
        let flow = Flow::new(&pendulum);
        let ends = advanced(&Strobe::new(&pendulum, 200, simd()), &starts, 3);
        let far = starts.iter().zip(&ends).map(|(start, end)| {
            distance(*end, flow.carry(*start, 0.0, 3.0 * pendulum.period()).state)
        });
        let error = far.fold(0.0, f64::max);
        println!("{error:e} {}", term.0);
        // After a turn a non-integer power of the velocity grows as a non-integer power of time.
        let allowed = if term.0.contains("sqrt") { 1e-5 } else { 1e-8 };
        assert!(error < allowed, "{}: {error:e}", term.0);
    }
}

#[test]
fn a_jump_at_rest_is_dry_friction() {
    // At rest it holds loads up to 0.2, in motion it is asymmetric: 0.2 forward, 0.1 backward.
    let spec = formula("lopsided", "-k*(0.75*sign(v) + 0.25)", &[("k", 2.0)]);
    let pendulum = has(undriven(0.0, 0.0), effect(&spec, &[0.2]));
    assert!(pendulum.has_friction() && pendulum.has_events());
    let slides = |velocity: f64| pendulum.acceleration(0.0, 0.0, velocity);
    assert!((slides(1.0) + 0.2).abs() < 1e-15 && (slides(-1.0) - 0.1).abs() < 1e-15);
    let flow = Flow::new(&pendulum);
    // The load -sin(theta) - 0.05 against a limit of 0.15.
    for (theta, sticks) in [(0.09_f64, true), (0.11, false), (-0.19, true), (-0.21, false)] {
        let arrival = flow.carry([theta, 0.0], 0.0, 1.0);
        assert_eq!(arrival.stuck_for_ever, sticks, "{theta}: {arrival:?}");
    }
    // In backward motion the friction is a constant torque of 0.1: energy including it is
    // conserved.
    let energy = |theta: f64, v: f64| 0.5 * v * v - theta.cos() - 0.1 * theta;
    let end = flow.carry([0.2, 0.0], 0.0, 0.5).state;
    assert!((energy(end[0], end[1]) - energy(0.2, 0.0)).abs() < 1e-13, "{end:?}");
}

#[test]
fn a_phase_drives_where_the_pivot_rests() {
    let spec = formula("push", "k*cos(phase)", &[("k", 2.0)]);
    let pendulum = Pendulum::new(0.2, 0.0, 1.7, 0.4, 0.0).expect("in range");
    let pushed = has(pendulum, effect(&spec, &[1e-5]));
    assert!(!pushed.is_autonomous());
    assert!((pushed.period() - 2.0 * PI / 1.7).abs() < 1e-15);
    // The small forced oscillation: theta = Re(k e^{i(omega t + phase)}/(1 - w^2 + i g w)).
    let start = [0.0, 0.0];
    let periods = 40.0;
    let end = Flow::new(&pushed).carry(start, 0.0, periods * pushed.period()).state;
    let (real, imaginary) = (1.0 - 1.7 * 1.7, 0.2 * 1.7);
    let size = 1e-5 / (real * real + imaginary * imaginary);
    let expected = size * (0.4_f64.cos() * real + 0.4_f64.sin() * imaginary);
    assert!((end[0] - expected).abs() < 1e-10, "{end:?} {expected}");
}

#[test]
fn maps_refuse_formulas_that_do_not_repeat() {
    for (term, power, why) in [
        ("k*theta", 2.0, "every turn"),
        ("-k*sin(theta/2)", 2.0, "every turn"),
        ("k*cos(phase/2)", 2.0, "every period"),
    ] {
        let own = effect(&formula("mine", term, &[("k", power)]), &[0.1]);
        assert_eq!(own.kind.definition().mappable, Mappable::No, "{term}");
        let strobe = Strobe::new(&has(driven(0.1, 0.6, 2.0), own), 20, simd());
        let error = advance(&strobe, &[[1.0, 0.0]], 1, 1, &Control::default());
        let line = error.map(|_| ()).expect_err(term).to_string();
        let begin = "mine can be in one trajectory, not in maps: ";
        assert!(line.starts_with(begin) && line.contains(why), "{line}");
    }
}

#[test]
fn two_corners_do_not_hinder_each_other() {
    let load = Effect::new(Kind::LoadDependentFriction, &[0.15]).expect("in range");
    let kinked = effect(&formula("mine", "-k*v*abs(sin(theta) - 0.3)", &[("k", 1.0)]), &[0.1]);
    let base = driven(0.1, 0.6, 2.0);
    let [one, other] = [[load.clone(), kinked.clone()], [kinked, load.clone()]]
        .map(|effects| effects.into_iter().fold(base.clone(), has));
    let mut draws = Draws(12);
    for _ in 0..200 {
        let [theta, v] = [draws.between([-4.0, 4.0]), draws.between([-3.0, 3.0])];
        let expected = has(base.clone(), load.clone()).acceleration(1.0, theta, v)
            - 0.1 * v * (theta.sin() - 0.3).abs();
        for pendulum in [&one, &other] {
            assert!((pendulum.acceleration(1.0, theta, v) - expected).abs() < 1e-14);
        }
    }
}

#[test]
fn errors_of_formulas_have_one_line() {
    for (term, said) in [
        (
            "-k*thetta",
            "unknown name 'thetta' at 4: it must be one of theta, v, phase, t, w0, a, pi, k",
        ),
        ("-k*sine(v)", "unknown function 'sine' at 4"),
        ("-k*(v", "ends at 6: there must be ')'"),
        ("", "ends at 1"),
        ("k v", "unexpected 'v' at 3: there must be an operator or the end"),
        ("k*", "ends at 3"),
        ("k*$", "unexpected '$' at 3"),
        ("k*1e999", "1e999 at 3 is not a finite number"),
        ("k*1.2.3", "1.2.3 at 3 is not a finite number"),
        ("k*sqrt", "'sqrt' at 3 is a function"),
        ("k*min(v)", "unexpected ')' at 8: there must be ','"),
        ("v*abs(v)", "parameter 'k' is not in the term"),
        ("-k*sign(theta)", "jumps where what is under sign(...) passes zero"),
        ("-k/theta", "is no finite number at theta = 0.000"),
        ("-k*log(v)", "is no finite number at theta"),
        ("-k*v^2", "its units do not balance"),
        ("-k*v", "'k' must have power = 1"),
        ("-k*sqrt(abs(v))*sign(v)", "'k' must have power = 1.5"),
    ] {
        let error = Formula::new(&formula("mine", term, &[("k", 2.0)])).expect_err(term);
        let line = error.to_string();
        assert!(line.starts_with("formula 'mine': ") && line.contains(said), "{term}: {line}");
        assert_eq!(line.lines().count(), 1, "{line}");
    }
    let deep = format!("{}k{}", "(".repeat(400), ")".repeat(400));
    let wide = format!("k{}", "+k".repeat(700));
    let many = format!("{}k{}", "min(0,".repeat(50), ")".repeat(50));
    for (name, term, parameter) in [
        ("quadratic_drag", "k", "k"),
        ("two words", "k", "k"),
        ("mine", "v", "v"),
        ("mine", "2x", "2x"),
        ("mine", &deep, "k"),
        ("mine", &wide, "k"),
        ("mine", &many, "k"),
    ] {
        let error = Formula::new(&formula(name, term, &[(parameter, 2.0)])).expect_err(term);
        assert!(matches!(error, Error::Formula { .. }) && error.to_string().lines().count() == 1);
    }
    assert_eq!(term(&Kind::EncoderGain), None);
}

#[test]
fn a_formula_runs_on_the_route_that_it_needs() {
    for (term, power, action) in [
        ("k*sin(3*theta)", 2.0, Action::Position),
        ("-k*v^3", -1.0, Action::Velocity),
        ("-k*v*abs(v)", 0.0, Action::Kinked),
        ("-k*sqrt(abs(v))*sign(v)", 1.5, Action::Kinked),
        ("-k*sign(v)*cos(theta)^2", 2.0, Action::Friction),
        ("-k*sign(v)*exp(-abs(v)/w0)", 2.0, Action::SlidingFriction),
        ("-k*sign(v)*(1 + a)", 2.0, Action::LoadedFriction),
        ("-k*sign(v)*sin(phase)^2", 2.0, Action::LoadedFriction),
    ] {
        let own = effect(&formula("mine", term, &[("k", power)]), &[0.1]);
        assert_eq!(own.kind.definition().action, action, "{term}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn no_text_makes_the_parser_panic(text in "\\PC{0,60}") {
        let _ = Formula::new(&formula("mine", &text, &[("k", 2.0)]));
    }

    #[test]
    fn no_mixture_of_tokens_makes_the_parser_panic(
        words in proptest::collection::vec(
            prop_oneof![
                Just("theta"), Just("v"), Just("k"), Just("("), Just(")"), Just("+"), Just("-"),
                Just("*"), Just("/"), Just("^"), Just("2"), Just("0.5"), Just("abs("), Just("sqrt("),
                Just("min("), Just(","), Just("sign("), Just("t"), Just("phase"), Just("1e-3"),
            ],
            0..40,
        )
    ) {
        let _ = Formula::new(&formula("mine", &words.join(" "), &[("k", 2.0)]));
    }
}
