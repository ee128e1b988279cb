//! Periodic orbits by Newton's method, against known ones.

use std::f64::consts::{PI, TAU};

use pendmap::integrate::State;
use pendmap::integrate::accuracy::distance;
use pendmap::orbit::newton::{RESIDUAL, find};
use pendmap::orbit::{PeriodicOrbit, PoincareMap};

use crate::support::driven;
use crate::truths::{Known, attractors, attractors_at};

fn polished(known: &Known, start: State, n: usize) -> PeriodicOrbit {
    find(&PoincareMap::new(&known.pendulum), start, n, 0.3)
        .unwrap_or_else(|| panic!("none near {start:?} at p = {}", known.pendulum.drive.p))
}

fn beside(state: State, by: f64) -> State {
    [state[0] + by, state[1] - 0.7 * by]
}

#[test]
fn every_known_attractor_is_found() {
    for known in attractors() {
        for (i, point) in known.points.iter().enumerate() {
            let orbit = polished(&known, beside(*point, 1e-3), known.n);
            assert_eq!((orbit.n, orbit.w), (known.n, known.w));
            assert!(orbit.is_stable());
            assert!(orbit.residual < RESIDUAL, "{:e}", orbit.residual);
            // The points are in the order of the motion, from the lowest angle on.
            let lowest = known.points.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
            assert!((orbit.points[0][0] - lowest).abs() < 1e-9);
            let offset =
                known.points.iter().position(|p| distance(*p, orbit.points[0]) < 1e-9).expect("it");
            for (k, found) in orbit.points.iter().enumerate() {
                let expected = known.points[(offset + k) % known.n];
                assert!(distance(*found, expected) < 1e-9, "point {k} from point {i}: {found:?}");
            }
        }
    }
}

#[test]
fn multipliers_of_the_known_attractors() {
    for known in attractors() {
        let orbit = polished(&known, known.points[0], known.n);
        let [a, b] = orbit.multipliers.0;
        let miss = |re: f64, im: f64, k: usize| {
            (re - known.multipliers[k][0]).hypot(im - known.multipliers[k][1])
        };
        // A conjugate pair is unordered.
        let error = (miss(a.re, a.im, 0).max(miss(b.re, b.im, 1)))
            .min(miss(a.re, a.im, 1).max(miss(b.re, b.im, 0)));
        assert!(
            error < 1e-9,
            "{:?} at p = {}: {error:e}",
            (known.n, known.w),
            known.pendulum.drive.p
        );
        let exact = (-known.pendulum.gamma * known.n as f64 * known.pendulum.period()).exp();
        assert!(((a * b).re / exact - 1.0).abs() < 1e-12 && (a * b).im.abs() < 1e-15);
        for monodromy in &orbit.monodromy {
            assert!((monodromy.determinant() / exact - 1.0).abs() < 1e-9);
            assert!((monodromy.trace() - (a + b).re).abs() < 1e-10, "one trace at every point");
        }
        let slope = a.norm().ln() / (known.n as f64 * known.pendulum.period());
        let exponent = orbit.multipliers.exponent(known.n as f64 * known.pendulum.period());
        assert!((exponent - slope).abs() < 1e-15 && exponent < 0.0);
    }
}

#[test]
fn a_start_of_several_periods_is_reduced_to_the_true_one() {
    for known in attractors() {
        for multiple in [2, 3, 4] {
            let orbit = polished(&known, beside(known.points[0], 1e-5), multiple * known.n);
            assert_eq!((orbit.n, orbit.w), (known.n, known.w), "from {multiple} times the period");
            assert_eq!(orbit.points.len(), known.n);
        }
    }
}

#[test]
fn a_rotation_about_to_double_is_of_period_one() {
    // Its multiplier of -0.964 resembles period 2 for hundreds of periods.
    for known in attractors_at(1.34).iter().filter(|k| k.n == 1) {
        let map = PoincareMap::new(&known.pendulum);
        let after = map.iterate(beside(known.points[0], 0.02), 40).state;
        assert!(distance(map.once(after).state, after) > 1e-3, "it still jumps to and fro");
        let orbit = polished(known, after, 2);
        assert_eq!((orbit.n, orbit.w), (1, known.w));
        assert!((orbit.multipliers.0[0].re + 0.964_312_715_283_395_8).abs() < 1e-9);
    }
}

#[test]
fn unstable_orbits_are_found_and_called_so() {
    // The inverted position is a saddle of every weakly driven pendulum.
    let map = PoincareMap::new(&driven(0.1, 0.5, 2.0));
    let orbit = find(&map, [3.1, 0.02], 1, 0.3).expect("the inverted rest");
    assert_eq!((orbit.n, orbit.w), (1, 0));
    assert!(!orbit.is_stable());
    assert!((orbit.points[0][0].abs() - PI).abs() < 1e-12 && orbit.points[0][1].abs() < 1e-12);
    // For p = 0.5 the rest is unstable too: rest_onset at omega = 2 is 0.2.
    let rest = find(&map, [0.01, 0.0], 1, 0.3).expect("rest");
    assert!(!rest.is_stable() && rest.points[0][0].abs() < 1e-12);
}

#[test]
fn an_orbit_is_the_same_a_turn_further_on() {
    for known in attractors() {
        for turn in [-TAU, TAU] {
            let start = [known.points[0][0] + turn, known.points[0][1]];
            let orbit = polished(&known, start, known.n);
            assert_eq!((orbit.n, orbit.w), (known.n, known.w), "from {start:?}");
            assert!(orbit.points.iter().all(|p| p[0].abs() <= PI), "{:?}", orbit.points);
        }
    }
    // At the top an angle may be on either side of pi by a rounding error, which is no turn.
    for (p, omega) in [(0.5, 2.0), (1.0, 2.0), (30.0, 14.0)] {
        let map = PoincareMap::new(&driven(0.5, p, omega));
        for theta in [3.1, 3.15, -3.1, -3.15] {
            let orbit = find(&map, [theta, 0.01], 1, 0.3).expect("the inverted rest");
            assert_eq!(orbit.w, 0, "from {theta} at p = {p}: {:?}", orbit.points);
        }
    }
}
