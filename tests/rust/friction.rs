//! Coulomb friction in lanes: turns, sticks and releases, against reference values.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::AtomicBool;

use pendmap::attractor::attracting::attracting;
use pendmap::integrate::accuracy::distance;
use pendmap::integrate::reference::flow::Flow;
use pendmap::integrate::trajectory::{Request, simulate};
use pendmap::integrate::{State, States, Strobe};
use pendmap::maps::basins::{BasinMap, Options, basins};
use pendmap::maps::control::Control;
use pendmap::model::Pendulum;
use pendmap::orbit::PoincareMap;

use crate::support::{
    advanced, basins_on_plane, driven, instruction_sets, plane, simd, spread, unchecked,
};
use crate::truths::{list, number, truths};

fn rubbing(gamma: f64, p: f64, omega: f64, theta_r: f64) -> Pendulum {
    driven(gamma, p, omega).with_friction(theta_r).expect("in range")
}

#[test]
fn sticks_and_slips_under_drive_end_where_they_should() {
    for simd in instruction_sets() {
        for truth in list(&truths()["stick_slip"]) {
            let get = |key: &str| number(&truth[key]);
            let pendulum = rubbing(get("gamma"), get("p"), get("omega"), get("theta_r"));
            let strobe = Strobe::new(&pendulum, 200, simd);
            let mut states = States::from([[get("theta0"), get("v0")]].as_slice());
            strobe.advance(&mut states, get("periods") as usize);
            let [theta, velocity] = states.get(0);
            let found = [theta + TAU * states.turns()[0], velocity];
            let error = distance(found, [get("theta"), get("v")]);
            assert!(error < 1e-8, "{simd}: {error:e} at {truth}");
        }
    }
}

/// Starts that cover the plane, and their states after five periods by the reference integrator.
fn references(pendulum: &Pendulum, count: usize) -> (Vec<State>, Vec<State>) {
    let starts = spread(count, PI, 3.0);
    let flow = Flow::new(pendulum);
    let ends = starts.iter().map(|s| flow.carry(*s, 0.0, 5.0 * pendulum.period()).state).collect();
    (starts, ends)
}

#[test]
fn lanes_agree_with_the_reference_integrator() {
    let cases = [(0.02, 1.0, 2.0, 0.05, 60), (0.1, 1.5, 0.87, 0.2, 130)];
    for (gamma, p, omega, theta_r, steps) in cases {
        let pendulum = rubbing(gamma, p, omega, theta_r);
        let (starts, ends) = references(&pendulum, 1000);
        let strobe = Strobe::new(&pendulum, steps, simd());
        let mut errors: Vec<f64> = advanced(&strobe, &starts, 5)
            .iter()
            .zip(&ends)
            .map(|(found, truth)| distance(*found, *truth))
            .collect();
        errors.sort_by(f64::total_cmp);
        let (median, high) = (errors[500], errors[990]);
        let stuck = ends.iter().filter(|s| s[1] == 0.0).count();
        assert!(median < 1e-9, "{pendulum:?}: median {median:e}");
        assert!(high < 1e-6, "{pendulum:?}: 99th percentile {high:e}");
        assert!(stuck > 0, "{pendulum:?}: nothing stuck");
    }
}

#[test]
fn orbits_with_friction_are_those_of_the_reference() {
    for (kind, n, w) in [("rotation", 1, 1), ("oscillation", 2, 0)] {
        for truth in list(&truths()["coulomb_forced"][kind]) {
            let get = |key: &str| number(&truth[key]);
            let pendulum = rubbing(get("gamma"), get("p"), get("omega"), get("theta_r"));
            let map = basins_on_plane(&pendulum, 60);
            let known = [get("theta"), get("v")];
            let error = map
                .attractors
                .iter()
                .filter(|a| (a.n, a.w) == (Some(n), w))
                .flat_map(|a| &a.points)
                .map(|p| distance(*p, known))
                .fold(f64::INFINITY, f64::min);
            assert!(error < 1e-9, "{kind} at {truth}: {error:e}");
            assert!(map.share(0) + map.share(-1) < 1e-9, "{kind} at {truth}");
        }
    }
}

#[test]
fn creeping_at_the_edge_counts_as_rest() {
    // Here every start ends at rest, the slowest by creeping.
    let map = basins_on_plane(&rubbing(0.1, 1.5, 0.87, 0.2), 60);
    let names: Vec<&str> = map.attractors.iter().map(|a| a.name.as_str()).collect();
    assert!(names.contains(&"rest"), "{names:?}");
    assert!(map.share(0) < 1e-9);
    let rest = names.iter().position(|n| *n == "rest").expect("there");
    assert!(map.attractors[rest].multipliers.is_empty());
}

#[test]
fn what_friction_does_not_shrink_attracts_nothing() {
    // States at the edge of those that it holds; a turn in one sense, to which it is a constant torque.
    let edge = (0.05_f64 / 3.1).asin();
    let states = (-5..=5).map(|k| [edge + f64::from(k) * 1e-9, 0.0]);
    let creeping = states.map(|state| (rubbing(0.1, 2.1, 0.9, 0.05), state));
    let turning = (rubbing(0.0, 1.0, 2.0, 0.1), [0.271_561, -2.685_365]);
    for (pendulum, point) in creeping.chain([turning]) {
        let strobe = Strobe::new(&pendulum, 60, simd());
        let map = PoincareMap::of_steps(&strobe);
        assert!(attracting(&strobe, &map, &[(vec![point], 1)])[0].is_none(), "{point:?}");
    }
}

#[test]
fn the_tolerance_does_not_change_labels_away_from_fractal_boundaries() {
    let pendulum = rubbing(0.1, 0.6, 2.0, 0.03);
    let map = |tol: f64| {
        let options = Options { tol, ..unchecked() };
        basins(&pendulum, &plane(60), &options, &Control::default()).expect("a map")
    };
    let (coarse, fine) = (map(1e-5), map(1e-9));
    let names =
        |map: &BasinMap| -> Vec<String> { map.attractors.iter().map(|a| a.name.clone()).collect() };
    assert_eq!(names(&coarse), names(&fine));
    let label = |i: i64, j: i64| fine.labels.label[(j * 60 + i.rem_euclid(60)) as usize];
    let mut changed = 0;
    for j in 0..60 {
        for i in 0..60 {
            if coarse.labels.label[(j * 60 + i) as usize] == label(i, j) {
                continue;
            }
            changed += 1;
            let around = [(-1, 0), (1, 0), (0, -1), (0, 1)];
            let inside = around.into_iter().all(|(di, dj)| {
                !(0..60).contains(&(j + dj)) || label(i + di, j + dj) == label(i, j)
            });
            assert!(!inside, "the label of cell {i}, {j} changed away from all boundaries");
        }
    }
    assert!(changed <= 18, "{changed} of 3600 labels");
}

#[test]
fn the_angle_at_which_it_stops_converges_with_the_order_of_the_method() {
    let pendulum = Pendulum::new(0.05, 0.0, 1.0, 0.0, 0.0)
        .and_then(|p| p.with_friction(0.05))
        .expect("in range");
    let start = [2.5, 0.4];
    let truth = Flow::new(&pendulum).carry(start, 0.0, 20.0 * TAU);
    assert!(truth.stuck_for_ever);
    let error = |steps: usize| {
        let end = advanced(&Strobe::new(&pendulum, steps, simd()), &[start], 20)[0];
        assert!(end[1] == 0.0, "{end:?}");
        (end[0] - truth.state[0]).abs()
    };
    let errors = [24, 48, 96].map(error);
    assert!(errors[1] < errors[0] / 60.0, "{errors:?}");
    assert!(errors[2] < 1e-11, "{errors:?}");
}

#[test]
fn a_torque_as_great_as_the_friction_leaves_nothing_undecided() {
    // The limit of permanent sticking is then an equality, which rounding must not decide.
    let pendulum = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.3)
        .and_then(|p| p.with_friction(0.3))
        .expect("in range");
    let map = basins_on_plane(&pendulum, 40);
    let names: Vec<&str> = map.attractors.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["rest", "inverted rest", "rotation 1:+1"]);
    assert!(map.share(0) < 0.01, "{} undecided", map.share(0));
}

/// Events of one trajectory over one period.
fn events(pendulum: &Pendulum, start: State) -> usize {
    let request =
        Request { start, until: pendulum.period(), tol: 1e-12, samples: 1, lyapunov: false };
    simulate(pendulum, &request, &AtomicBool::new(false)).expect("a trajectory").events.len()
}

#[test]
fn a_velocity_that_only_just_touches_zero_is_not_missed() {
    // Between a start whose velocity crosses zero and one whose velocity does not is one that
    // grazes it: on both sides, at decreasing distances, lanes must agree with the reference.
    let pendulum = rubbing(0.02, 1.0, 2.0, 0.05);
    let flow = Flow::new(&pendulum);
    let strobe = Strobe::new(&pendulum, 60, simd());
    let mut grazings = 0;
    for theta in [-2.8, -2.2, -1.5, -0.6, 0.4, 1.3, 2.4] {
        let at = |k: usize| [theta, -2.9 + 0.1 * k as f64];
        for k in 0..58 {
            let (mut low, mut high) = (at(k)[1], at(k + 1)[1]);
            let few = events(&pendulum, [theta, low]);
            if events(&pendulum, [theta, high]) == few {
                continue;
            }
            for _ in 0..45 {
                let middle = 0.5 * (low + high);
                if events(&pendulum, [theta, middle]) == few {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            grazings += 1;
            for offset in [1e-3, 1e-5, 1e-7, 1e-9, 1e-11] {
                for velocity in [low - offset, high + offset] {
                    let start = [theta, velocity];
                    let truth = flow.carry(start, 0.0, pendulum.period()).state;
                    let error = distance(advanced(&strobe, &[start], 1)[0], truth);
                    assert!(error < 1e-8, "{start:?}: {error:e}");
                }
            }
        }
    }
    assert!(grazings > 10, "{grazings}");
}
