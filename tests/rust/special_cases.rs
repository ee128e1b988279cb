//! Special cases: inverted rest, no damping, no drive, drive with a running state.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::AtomicBool;

use pendmap::attractor::Kind;
use pendmap::integrate::trajectory::{Request, simulate};
use pendmap::maps::basins::{BasinMap, Labelling, Options, basins};
use pendmap::maps::control::Control;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::model::Pendulum;
use pendmap::orbit::rotation::running_states;

use crate::support::{basins_on_plane, driven, plane, undriven};

fn names(map: &BasinMap) -> Vec<&str> {
    map.attractors.iter().map(|a| a.name.as_str()).collect()
}

#[test]
fn a_fast_drive_holds_the_pendulum_upside_down() {
    let map = basins_on_plane(&driven(0.5, 30.0, 14.0), 60);
    assert_eq!(names(&map), ["rest", "inverted rest"]);
    let inverted = &map.attractors[1];
    assert_eq!((inverted.kind, inverted.n, inverted.w), (Kind::InvertedRest, Some(1), Some(0)));
    assert_eq!((inverted.points.as_slice(), inverted.twin), (&[[PI, 0.0]][..], Some(1)));
    assert!(inverted.exponent < 0.0 && map.fractions[1] > 0.2 && map.fractions[1] < 0.3);
}

#[test]
fn without_damping_there_are_no_attractors() {
    let map = basins_on_plane(&driven(0.0, 0.3, 2.0), 30);
    assert_eq!(map.labelling, Labelling::Conservative);
    assert!(map.attractors.is_empty() && map.fractions.is_empty());
    assert!((map.share(0) - 1.0).abs() < 1e-12, "every start is undecided");
    let layers = map.layers.expect("layers");
    assert_eq!(layers.turns.len(), 900);
    assert_eq!(map.labels.turns, layers.turns);
    // Islands of regular motion in a chaotic sea.
    let growing = layers.exponent.iter().filter(|e| **e > 0.1).count();
    let quiet = layers.exponent.iter().filter(|e| **e < 0.08).count();
    assert!(growing > 20 && quiet > 100, "{growing} grow, {quiet} do not");
}

#[test]
fn an_undriven_pendulum_without_torque_comes_to_rest() {
    let map = basins_on_plane(&undriven(0.2, 0.0), 40);
    assert_eq!(names(&map), ["rest"]);
    assert!((map.fractions[0] - 1.0).abs() < 1e-12);
    // Its period is 2 pi by definition, and its multipliers exp((-gamma/2 +- i w) 2 pi).
    let modulus = (-0.1 * TAU).exp();
    for multiplier in &map.attractors[0].multipliers {
        assert!((multiplier.norm() - modulus).abs() < 1e-12);
    }
}

#[test]
fn torque_without_drive_rests_or_runs() {
    let pendulum = undriven(0.1, 0.5);
    let map = basins_on_plane(&pendulum, 60);
    assert_eq!(names(&map), ["rest", "rotation 1:+1"]);
    let [rest, running] = map.attractors.as_slice() else { panic!("two") };
    assert!((rest.points[0][0] - 0.5_f64.asin()).abs() < 1e-12 && rest.points[0][1] == 0.0);
    assert_eq!((rest.twin, running.twin), (None, None), "a torque has no mirror image");
    assert_eq!((running.kind, running.multipliers.len()), (Kind::Rotation, 1));
    let period = running.period.expect("its own");
    assert!((period - pendulum.period()).abs() > 1.0, "not the unit of time");
    assert!((running.multipliers[0].re - (-0.1 * period).exp()).abs() < 1e-12);
    assert!(running.exponent == 0.0, "along the motion nothing grows or shrinks");

    // One turn later its state is the same, and the torque's work equals the damping loss.
    let start = running.points[0];
    let request = Request { start, until: period, tol: 1e-13, samples: 400, lyapunov: false };
    let run = simulate(&pendulum, &request, &AtomicBool::new(false)).expect("one turn");
    let last = run.theta.len() - 1;
    assert!((run.theta[last] - start[0] - TAU).abs() < 1e-12);
    assert!((run.velocity[last] - start[1]).abs() < 1e-12);
    let steps = run.time.windows(2).zip(run.velocity.windows(2));
    let lost: f64 =
        steps.map(|(t, v)| 0.1 * (t[1] - t[0]) * 0.5 * (v[0] * v[0] + v[1] * v[1])).sum();
    assert!((lost - 0.5 * TAU).abs() < 1e-4, "{lost}");
}

#[test]
fn the_shares_of_rest_and_running_are_the_published_ones() {
    // 0.152 and 0.848 of [-pi + asin .5, pi + asin .5] x [-10, 10], by two other programs.
    let middle = 0.5_f64.asin();
    let starts = Starts::Grid {
        theta: Axis::new("theta", middle - PI, middle + PI, 150).expect("an axis"),
        velocity: Axis::new("velocity", -10.0, 10.0, 150).expect("an axis"),
    };
    let options = Options { check: false, ..Options::default() };
    let map = basins(&undriven(0.1, 0.5), &starts, &options, &Control::default()).expect("a map");
    assert_eq!(names(&map), ["rest", "rotation 1:+1"]);
    assert!((map.fractions[0] - 0.152).abs() < 0.005, "{:?}", map.fractions);
    assert!((map.fractions[1] - 0.848).abs() < 0.005, "{:?}", map.fractions);
}

#[test]
fn running_states_exist_where_the_torque_keeps_them_up() {
    let running = |gamma: f64, torque: f64| running_states(&undriven(gamma, torque));
    // The mirror image runs the other way, exactly.
    let (forward, backward) = (running(0.1, 0.5), running(0.1, -0.5));
    assert_eq!((forward.len(), backward.len()), (1, 1));
    assert_eq!((forward[0].sense, backward[0].sense), (1, -1));
    assert!((forward[0].velocity + backward[0].velocity).abs() < 1e-12);
    // Light damping: a homoclinic orbit ends them near torque = 4 gamma / pi.
    for gamma in [0.02, 0.05] {
        let end = 4.0 * gamma / PI;
        assert!(running(gamma, 0.9 * end).is_empty(), "gamma {gamma}");
        assert_eq!(running(gamma, 1.1 * end).len(), 1, "gamma {gamma}");
    }
    assert!(running(0.1, 0.0).is_empty() && running(0.0, 0.5).is_empty());
    assert!(running_states(&driven(0.1, 0.5, 2.0)).is_empty(), "driven ones have forced periods");
    // Above 1 there is no rest, and the mean speed tends to torque over gamma.
    let fast = &running(0.5, 5.0)[0];
    assert!((TAU / fast.period - 10.0).abs() < 0.01, "{}", fast.period);
}

#[test]
fn a_weak_drive_makes_the_running_state_quasiperiodic() {
    let pendulum = Pendulum::new(0.1, 0.1, 2.0, 0.0, 0.5).expect("in range");
    let map = basins_on_plane(&pendulum, 40);
    assert_eq!(names(&map), ["oscillation 1:0 (+)", "quasiperiodic rotation +"]);
    let running = &map.attractors[1];
    assert_eq!(running.kind, Kind::QuasiperiodicRotation);
    assert_eq!((running.n, running.w, running.sense), (None, None, 1));
    assert!(running.multipliers.is_empty() && running.exponent == 0.0);
    // Close to the running state without drive, and so is its share.
    let still = basins_on_plane(&undriven(0.1, 0.5), 40);
    assert!((map.fractions[1] - still.fractions[1]).abs() < 0.03, "{:?}", map.fractions);
    assert!(map.share(0) == 0.0 && map.share(-1) == 0.0);
    // A mirrored torque mirrors all results.
    let opposite = Pendulum::new(0.1, 0.1, 2.0, 0.0, -0.5).expect("in range");
    let mirrored = basins_on_plane(&opposite, 40);
    assert_eq!(names(&mirrored), ["oscillation 1:0 (-)", "quasiperiodic rotation -"]);
    assert!((map.fractions[1] - mirrored.fractions[1]).abs() < 0.005);
}

#[test]
fn a_start_on_an_orbit_that_does_not_attract_is_no_chaos() {
    // Hanging rest does not attract here, yet a start exactly on it remains without a perturbation.
    let pendulum = driven(0.1, 1.0, 2.0);
    let alone = Starts::List(vec![[0.0, 0.0]]);
    let map = basins(&pendulum, &alone, &Options::default(), &Control::default()).expect("a map");
    assert!(map.attractors.is_empty(), "{:?}", names(&map));
    assert_eq!(map.labels.label, [0]);
    // On a plane it is the only start that remains undecided.
    let map = basins_on_plane(&pendulum, 5);
    assert!(!map.attractors.iter().any(|a| a.kind.is_chaotic()), "{:?}", names(&map));
    let undecided = map.labels.label.iter().filter(|l| **l == 0).count();
    assert_eq!((undecided, map.labels.label[12]), (1, 0));
}

#[test]
fn nearly_conservative_motion_is_not_called_chaos() {
    for gamma in [1e-6, 1e-4] {
        // Nothing settles within this bound: without it a million periods are followed.
        let options = Options { check: false, max_periods: Some(1000), ..Options::default() };
        let map = basins(&driven(gamma, 1.0, 2.0), &plane(12), &options, &Control::default());
        let map = map.expect("a map");
        assert!(!map.attractors.iter().any(|a| a.kind.is_chaotic()), "gamma {gamma}");
    }
}

#[test]
fn whole_turns_of_the_phase_do_not_matter_however_many() {
    let at = |phase: f64| {
        let pendulum = Pendulum::new(0.1, 1.0, 2.0, phase, 0.0).expect("in range");
        basins_on_plane(&pendulum, 20).labels.label
    };
    let far: f64 = 1e17;
    assert_eq!(at(far), at(far % TAU));
    assert_eq!(at(0.3 + 8.0 * TAU), at((0.3 + 8.0 * TAU) % TAU));
}
