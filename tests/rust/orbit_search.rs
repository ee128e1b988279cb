//! All periodic orbits of a box, stable and unstable, against known ones.

use std::f64::consts::{PI, TAU};

use pendmap::attractor::attracting::attracting;
use pendmap::error::Error;
use pendmap::integrate::Strobe;
use pendmap::integrate::accuracy::distance;
use pendmap::maps::control::Control;
use pendmap::maps::orbits::{Orbits, Request, orbits};
use pendmap::maps::starts::Axis;
use pendmap::model::Pendulum;
use pendmap::orbit::newton::{RESIDUAL, find};
use pendmap::orbit::{PeriodicOrbit, PoincareMap};

use crate::support::{driven, instruction_sets, undriven};
use crate::truths::{attractors, list, number, truths};

fn request(n: usize, w: i64, cells: usize) -> Request {
    Request {
        n,
        w: [w; 2],
        theta: Axis::new("theta", -PI, PI, cells).expect("an axis"),
        velocity: Axis::new("velocity", -4.0, 4.0, cells).expect("an axis"),
        threads: 0,
    }
}

fn all(pendulum: &Pendulum, n: usize, w: i64) -> Orbits {
    orbits(pendulum, &request(n, w, 120), &Control::default()).expect("a search")
}

fn same(a: &[PeriodicOrbit], b: &[PeriodicOrbit]) -> bool {
    a.len() == b.len() && a.iter().all(|o| b.iter().any(|p| p.contains(o.points[0], 1e-9)))
}

#[test]
fn every_known_attractor_is_among_them() {
    for known in attractors() {
        let found = all(&known.pendulum, known.n, known.w).closed;
        let own = found.iter().find(|orbit| orbit.contains(known.points[0], 1e-9));
        let own = own.unwrap_or_else(|| panic!("{:?} of {}", (known.n, known.w), found.len()));
        assert!(own.is_stable() && own.residual < RESIDUAL);
        for orbit in &found {
            assert_eq!((orbit.n, orbit.w), (known.n, known.w));
        }
    }
}

#[test]
fn a_rotation_has_its_saddle_and_no_orbit_stands_twice() {
    // Created at one fold, the two are all rotations of period 1 in one sense.
    let pendulum = driven(0.1, 1.0, 2.0);
    let found = all(&pendulum, 1, 1).closed;
    assert_eq!(found.len(), 2);
    assert_eq!(found.iter().filter(|o| o.is_stable()).count(), 1);
    let saddle = found.iter().find(|o| !o.is_stable()).expect("the other one");
    assert!(saddle.multipliers.0[0].re > 1.0);
    let mirrored = all(&pendulum, 1, -1).closed;
    let images: Vec<PeriodicOrbit> = found.iter().map(|o| o.mirrored().0).collect();
    assert!(same(&images, &mirrored));
}

#[test]
fn where_no_orbit_attracts_near_the_first_point_the_others_are_tried() {
    let pendulum = driven(0.1, 1.0, 2.0);
    let both = all(&pendulum, 1, 1).closed;
    let point = |stable: bool| {
        both.iter().find(|o| o.is_stable() == stable).expect("a saddle and a node").points[0]
    };
    let [saddle, node] = [false, true].map(point);
    let strobe = Strobe::new(&pendulum, 40, instruction_sets()[0]);
    let map = PoincareMap::of_steps(&strobe);
    let starts = [(vec![saddle], 1), (vec![node], 1), (vec![saddle, saddle, node], 1)];
    let found = attracting(&strobe, &map, &starts);
    assert!(found[0].is_none());
    for orbit in &found[1..] {
        assert!(orbit.as_ref().is_some_and(|o| o.is_stable() && o.contains(node, 1e-3)));
    }
}

#[test]
fn a_finer_grid_finds_no_more() {
    for (p, omega) in [(1.0, 2.0), (1.7, 0.87)] {
        let pendulum = driven(0.1, p, omega);
        for (n, w) in [(1, 0), (2, 0), (1, 1), (2, 1), (2, 2)] {
            let [coarse, fine] = [80, 120].map(|cells| {
                orbits(&pendulum, &request(n, w, cells), &Control::default()).expect("a search")
            });
            let counts = (coarse.closed.len(), fine.closed.len());
            assert!(same(&coarse.closed, &fine.closed), "p = {p}, {:?}: {counts:?}", (n, w));
        }
    }
}

#[test]
fn fixed_points_add_up() {
    // On the cylinder the Lefschetz number of a dissipative map is 0: as many fixed points of index
    // +1 as of index -1, over all windings.
    for (gamma, p, omega) in [(0.1, 1.0, 2.0), (0.1, 1.7, 0.87), (0.2, 0.3, 1.4), (0.1, 2.0, 2.0)] {
        let pendulum = driven(gamma, p, omega);
        let mut sum = 0;
        let mut count = 0;
        for w in -4..=4 {
            let mut box_of = request(1, w, 160);
            box_of.velocity = Axis::new("velocity", -9.0, 9.0, 360).expect("an axis");
            for orbit in orbits(&pendulum, &box_of, &Control::default()).expect("it").closed {
                let m = orbit.monodromy[0];
                let index = (1.0 - m.trace() + m.determinant()).signum();
                sum += index as i32;
                count += 1;
            }
        }
        assert!(count >= 2, "hanging and upright rest at least");
        assert_eq!(sum, 0, "{count} fixed points at p = {p}");
    }
}

#[test]
fn exponents_with_friction_are_the_reference_ones() {
    for (key, n, w) in [("rotation", 1, 1), ("oscillation", 2, 0)] {
        for entry in list(&truths()["coulomb_forced"][key]) {
            let value = |name: &str| number(&entry[name]);
            let pendulum = driven(value("gamma"), value("p"), value("omega"))
                .with_friction(value("theta_r"))
                .expect("in range");
            let found = all(&pendulum, n, w).closed;
            let at = [value("theta"), value("v")];
            let own = found.iter().find(|o| o.contains(at, 1e-8));
            assert!(own.is_some_and(PeriodicOrbit::is_stable), "{key}: {at:?} of {}", found.len());
            // States held by friction form a set, not an orbit.
            let held = |o: &PeriodicOrbit| o.points.iter().all(|p| p[1] == 0.0);
            assert!(!found.iter().any(held));
        }
    }
}

#[test]
fn without_drive_there_are_rests_and_the_running_state() {
    let pendulum = undriven(0.1, 0.4);
    let rests = all(&pendulum, 1, 0).closed;
    let mut angles: Vec<f64> = rests.iter().map(|o| o.points[0][0]).collect();
    angles.sort_by(f64::total_cmp);
    let hanging = 0.4_f64.asin();
    assert_eq!(angles.len(), 2);
    assert!((angles[0] - hanging).abs() < 1e-10 && (angles[1] - (PI - hanging)).abs() < 1e-10);
    let running = all(&pendulum, 1, 1).running;
    assert_eq!(running.len(), 1);
    assert!(all(&pendulum, 1, -1).running.is_empty());
    assert!(all(&pendulum, 2, 1).running.is_empty());
}

#[test]
fn a_box_limits_where_they_are_looked_for() {
    let pendulum = driven(0.1, 1.0, 2.0);
    let everywhere = all(&pendulum, 1, 1).closed;
    let only = everywhere[0].points[0];
    let mut small = request(1, 1, 20);
    small.theta = Axis::new("theta", only[0] - 0.2, only[0] + 0.2, 20).expect("an axis");
    small.velocity = Axis::new("velocity", only[1] - 0.2, only[1] + 0.2, 20).expect("an axis");
    let found = orbits(&pendulum, &small, &Control::default()).expect("a search").closed;
    assert_eq!(found.len(), 1);
    assert!(found[0].contains(only, 1e-10));
    // Shifted by a turn it is the same box.
    small.theta = Axis::new("theta", only[0] - 0.2 + TAU, only[0] + 0.2 + TAU, 20).expect("it");
    let again = orbits(&pendulum, &small, &Control::default()).expect("a search").closed;
    assert!(again.len() == 1 && distance(again[0].points[0], only) < 1e-9);
}

#[test]
fn invalid_requests_are_refused() {
    let control = Control::default();
    let pendulum = driven(0.1, 1.0, 2.0);
    for n in [0, 65] {
        let refused = orbits(&pendulum, &request(n, 0, 20), &control);
        assert!(matches!(refused, Err(Error::Range { name: "n", .. })));
    }
    control.cancel();
    assert!(matches!(orbits(&pendulum, &request(1, 0, 20), &control), Err(Error::Interrupted)));
}

#[test]
fn newton_alone_finds_no_orbit_that_the_search_has_not() {
    let pendulum = driven(0.1, 1.3, 2.0);
    let map = PoincareMap::new(&pendulum);
    let known = all(&pendulum, 2, 0).closed;
    let mut met = 0;
    for start in crate::support::spread(400, PI, 3.0) {
        let Some(orbit) = find(&map, start, 2, f64::INFINITY) else { continue };
        let inside = orbit.points.iter().any(|p| p[1].abs() < 4.0);
        if (orbit.n, orbit.w) == (2, 0) && inside {
            met += 1;
            assert!(known.iter().any(|o| o.contains(orbit.points[0], 1e-8)), "{:?}", orbit.points);
        }
    }
    assert!(met > 20 && !known.is_empty());
}

/// Distance in p from a bifurcation at which orbits are examined.
const BESIDE: f64 = 1e-6;

/// All orbits just before and just after the value `p`.
fn about(p: f64, omega: f64, n: usize, w: i64) -> [Vec<PeriodicOrbit>; 2] {
    [p - BESIDE, p + BESIDE].map(|p| all(&driven(0.1, p, omega), n, w).closed)
}

fn near(orbits: &[PeriodicOrbit], point: [f64; 2]) -> Vec<&PeriodicOrbit> {
    orbits.iter().filter(|o| o.contains(point, 0.05)).collect()
}

fn point(entry: &serde_json::Value) -> [f64; 2] {
    [number(&entry["theta"]), number(&entry["v"])]
}

#[test]
fn rotations_are_born_in_pairs() {
    let folds = &truths()["rotation_saddle_node"];
    let at_two = &truths()["bifurcations_gamma0.1_omega2"]["rot_SN"];
    for (entry, omega) in [(at_two, 2.0), (&folds["rotSN_w1.0"], 1.0), (&folds["rotSN_w3.0"], 3.0)]
    {
        let [before, after] = about(number(&entry["p"]), omega, 1, 1);
        assert!(near(&before, point(entry)).is_empty(), "before the fold at omega = {omega}");
        let pair = near(&after, point(entry));
        assert_eq!(pair.len(), 2, "after the fold at omega = {omega}");
        let mut largest: Vec<f64> = pair.iter().map(|o| o.multipliers.0[0].re).collect();
        largest.sort_by(f64::total_cmp);
        assert!(0.9 < largest[0] && largest[0] < 1.0 && 1.0 < largest[1], "{largest:?}");
    }
}

#[test]
fn the_subcritical_oscillation_has_a_fold_and_rest_an_onset() {
    let onset = &truths()["rest_onset"];
    let entry = &onset["res_w1.8"];
    let fold = [number(&entry["fold_theta"]), number(&entry["fold_v"])];
    let [before, after] = about(number(&entry["p_fold"]), 1.8, 2, 0);
    assert!(near(&before, fold).is_empty());
    let pair = near(&after, fold);
    assert_eq!(pair.len(), 2);
    assert_eq!(pair.iter().filter(|o| o.is_stable()).count(), 1);
    for (key, omega) in [("res_w1.8", 1.8), ("res_w2.0", 2.0), ("res_w2.2", 2.2)] {
        let entry = &onset[key];
        let p = number(&entry["p_onset"]);
        let rests = about(p, omega, 1, 0).map(|orbits| {
            let rest = orbits.iter().find(|o| o.contains([0.0; 2], 1e-9)).expect("rest");
            rest.multipliers.0[0].re
        });
        assert!(-1.0 < rests[0] && rests[0] < -0.9 && rests[1] < -1.0, "{key}: {rests:?}");
        // The small oscillation exists on one side alone: after the onset, or before.
        let small = about(p, omega, 2, 0).map(|orbits| near(&orbits, [0.0; 2]).len());
        let super_critical = entry["criticality"] == "supercritical";
        assert_eq!(small, if super_critical { [0, 1] } else { [1, 0] }, "{key}");
    }
}

#[test]
fn twins_part_where_symmetry_breaks() {
    let entry = &truths()["bifurcations_gamma0.1_omega2"]["osc_SB"];
    let [before, after] = about(number(&entry["p"]), 2.0, 2, 0);
    let [one] = near(&before, point(entry))[..] else { panic!("one before") };
    assert!(one.is_stable() && one.multipliers.0[0].re > 0.99);
    let three = near(&after, point(entry));
    assert_eq!(three.len(), 3);
    let (stable, lost): (Vec<_>, Vec<_>) = three.into_iter().partition(|o| o.is_stable());
    assert_eq!((stable.len(), lost.len()), (2, 1));
    assert!(lost[0].multipliers.0[0].re > 1.0);
    assert!(same(&[lost[0].mirrored().0], &[lost[0].clone()]), "the symmetric one loses");
    assert!(same(&[stable[0].mirrored().0], &[stable[1].clone()]), "twins");
}

#[test]
fn doublings_leave_an_orbit_of_twice_the_period() {
    let at_two = &truths()["bifurcations_gamma0.1_omega2"];
    for (name, n, w) in [("osc_PD1", 2, 0), ("osc_PD2", 4, 0), ("rot_PD1", 1, 1)] {
        let entry = &at_two[name];
        let p = number(&entry["p"]);
        // There are many orbits of long periods elsewhere: only those here are requested.
        let [theta, velocity] = point(entry);
        let here = |times: usize| {
            let mut here = request(times * n, times as i64 * w, 40);
            here.theta = Axis::new("theta", theta - 0.03, theta + 0.03, 40).expect("an axis");
            here.velocity =
                Axis::new("velocity", velocity - 0.03, velocity + 0.03, 40).expect("it");
            [p - BESIDE, p + BESIDE].map(|p| {
                let pendulum = driven(0.1, p, 2.0);
                orbits(&pendulum, &here, &Control::default()).expect("a search").closed
            })
        };
        let own = |orbits: &[PeriodicOrbit]| near(orbits, point(entry))[0].multipliers.0[0].re;
        let [stable, lost] = here(1).map(|orbits| own(&orbits));
        assert!(-1.0 < stable && stable < -0.99 && lost < -1.0, "{name}: {stable}, {lost}");
        let [before, after] = here(2);
        assert!(near(&before, point(entry)).is_empty(), "{name}");
        let doubled = near(&after, point(entry));
        assert!(doubled.len() == 1 && doubled[0].is_stable(), "{name}: {}", doubled.len());
    }
}

#[test]
fn held_states_are_no_orbits() {
    for (p, theta_r) in [(0.1, 0.5), (0.29, 0.013), (0.3, 3.0)] {
        let pendulum = driven(0.008, p, 2.0).with_friction(theta_r).expect("in range");
        let request = request(1, 0, 20);
        let found = orbits(&pendulum, &request, &Control::default()).expect("a search");
        let resting: Vec<_> =
            found.closed.iter().filter(|orbit| orbit.points[0][1].abs() < 1e-9).collect();
        assert!(resting.is_empty(), "p = {p}, theta_r = {theta_r}: {}", resting.len());
    }
}
