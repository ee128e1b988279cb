//! Curves in the plane of two parameters.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use pendmap::continuation::branch::{Bounds, End};
use pendmap::continuation::course::{Course, Law};
use pendmap::continuation::critical::Critical;
use pendmap::continuation::curve::Degenerate;
use pendmap::continuation::cycle::Closure;
use pendmap::continuation::event::Kind;
use pendmap::continuation::family::Family;
use pendmap::continuation::plane::{Curve, Plane, Seed};
use pendmap::maps::control::Control;
use pendmap::maps::curves::{Request, curves};
use pendmap::maps::pieces::{LEAST, Layer, SIDE, pieces};
use pendmap::model::{Parameter, Pendulum};
use pendmap::orbit::{PoincareMap, newton};

use crate::hill;

const P: [f64; 2] = [0.0, 2.5];
const OMEGA: [f64; 2] = [0.5, 3.0];

fn course(base: Pendulum) -> Course {
    let law = |[low, high]: [f64; 2]| Law::Quadratic([low, high - low, 0.0]);
    Course::new(base, vec![vec![(Parameter::P, law(P))], vec![(Parameter::Omega, law(OMEGA))]])
}

/// The values of a point.
fn values(place: &nalgebra::DVector<f64>) -> [f64; 2] {
    let [a, b] = Critical::at(place);
    [P[0] + a * (P[1] - P[0]), OMEGA[0] + b * (OMEGA[1] - OMEGA[0])]
}

/// The curves through the events of the branches of some orbits at each frequency.
fn plane(
    base: &Pendulum,
    omegas: &[f64],
    p: f64,
    starts: &[([f64; 2], usize)],
    longest: usize,
) -> Plane {
    let (course, cancel) = (course(base.clone()), AtomicBool::new(false));
    let mut plane = Plane::new(course.clone(), longest).unwrap();
    let at = (p - P[0]) / (P[1] - P[0]);
    let bounds = Bounds { low: 0.0, high: 1.0 };
    for omega in omegas {
        let held = (omega - OMEGA[0]) / (OMEGA[1] - OMEGA[0]);
        let mut family = Family::new(course.along(0, held), bounds, longest).unwrap();
        let map = PoincareMap::new(&plane.pendulum([at, held]));
        for (start, n) in starts {
            let orbit = newton::find(&map, *start, *n, 1.0).unwrap();
            family.add(&orbit, at, &cancel).unwrap();
        }
        for branch in &family.branches {
            let cycles = family.cycles(branch.of);
            for event in branch.run.events.iter().filter(|event| event.smooth) {
                let orbit = &branch.run.orbits[event.orbit];
                let points = cycles.points(&orbit.place);
                let at = [cycles.at(&orbit.place), held];
                let seed = Seed { of: branch.of, kind: event.kind, points, at, along: 1 };
                plane.add(&seed, &cancel).unwrap();
            }
        }
    }
    plane
}

/// Amplitudes of a curve at a frequency.
fn amplitudes(plane: &Plane, curve: &Curve, omega: f64) -> Vec<f64> {
    let held = (omega - OMEGA[0]) / (OMEGA[1] - OMEGA[0]);
    let found = plane.points(curve, 1, held);
    found.iter().map(|point| values(&point.orbit.place)[0]).collect()
}

#[test]
fn the_fold_of_the_rotation_has_its_known_amplitudes_and_ends_on_the_edges() {
    let base = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.0).unwrap();
    let plane = plane(&base, &[2.0], 1.0, &[([-2.82, 1.5], 1)], 1);
    let folds: Vec<&Curve> = plane.curves.iter().filter(|c| c.kind == Kind::Fold).collect();
    assert_eq!(folds.len(), 1);
    assert_eq!(folds[0].ends, [End::Range; 2]);
    let known = [
        (0.87, 0.311387955004),
        (1.2, 0.307512970661),
        (2.0, 0.416787572822),
        (3.0, 0.605110511155),
    ];
    for (omega, p) in known {
        let found = amplitudes(&plane, folds[0], omega);
        assert!(found.iter().any(|one| (one - p).abs() < 1e-11), "{omega}: {found:?}");
    }
    let doubling = plane.curves.iter().find(|c| c.kind == Kind::PeriodDoubling).unwrap();
    let found = amplitudes(&plane, doubling, 2.0);
    assert!(found.iter().any(|one| (one - 1.346858522521).abs() < 1e-11), "{found:?}");
}

#[test]
fn rest_changes_where_its_linear_equation_says() {
    let base = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.0).unwrap();
    let plane = plane(&base, &[1.0, 2.0], 1.0, &[([0.0, 0.0], 1), ([PI, 0.0], 1)], 1);
    let omegas = [1.1, 1.2, 1.75, 2.4];
    for side in [1.0, -1.0] {
        let own = |curve: &&Curve| {
            curve.of.closure == Closure::Rest && side * curve.of.centre.cos() > 0.0
        };
        for omega in omegas {
            let curves = plane.curves.iter().filter(own);
            let all: Vec<f64> = curves.flat_map(|c| amplitudes(&plane, c, omega)).collect();
            for (exact, _) in hill::critical(0.1, omega, side, P[1]) {
                let near = all.iter().any(|p| (p - exact).abs() < 1e-9);
                assert!(near, "{side} {omega}: {exact} of {all:?}");
            }
        }
    }
}

#[test]
fn the_fold_of_the_oscillation_begins_where_the_doubling_of_rest_changes() {
    let base = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.0).unwrap();
    let plane = plane(&base, &[2.0], 1.0, &[([0.0, 0.0], 1)], 2);
    let (number, doubling) =
        plane.curves.iter().enumerate().find(|(_, c)| !c.degenerate.is_empty()).unwrap();
    let (kind, index) = doubling.degenerate[0];
    assert_eq!(kind, Degenerate::GeneralisedDoubling);
    // By heyoka's variational equations of second order and differences of them.
    let [p, omega] = values(&doubling.points[index].orbit.place);
    assert!((p - 0.200032729604).abs() < 1e-8 && (omega - 1.993746585880).abs() < 1e-8);
    let fold = plane.curves.iter().find(|c| c.meets.contains(&Some((number, 0)))).unwrap();
    assert_eq!((fold.kind, fold.of.n, fold.of.closure), (Kind::Fold, 2, Closure::Half));
    let found = amplitudes(&plane, fold, 1.8);
    assert!(found.iter().any(|p| (p - 0.210425102330).abs() < 1e-11), "{found:?}");
}

#[test]
fn curves_of_a_part_of_the_plane_have_regions_with_their_stable_orbits() {
    let base = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.0).unwrap();
    let request = Request { longest: 2, only: None, threads: 1 };
    let law = |[low, high]: [f64; 2]| Law::Quadratic([low, high - low, 0.0]);
    let axes =
        vec![vec![(Parameter::P, law([0.0, 1.6]))], vec![(Parameter::Omega, law([1.8, 2.2]))]];
    let mut found = curves(&Course::new(base, axes), &request, &Control::default()).unwrap();
    let turning = |curve: &&Curve| (curve.of.n, curve.of.w) == (1, 1);
    let kinds: Vec<Kind> = found.plane.curves.iter().filter(turning).map(|c| c.kind).collect();
    assert!(kinds.contains(&Kind::Fold) && kinds.contains(&Kind::PeriodDoubling));
    for curve in found.plane.curves.iter().filter(turning) {
        assert_eq!(curve.ends, [End::Range; 2]);
    }
    // At omega 2 the rotation is born at .4168 and doubles at 1.3469; the oscillation 2:0 breaks its symmetry at 1.2589.
    let layers = pieces(&mut found, &request, &Control::default()).unwrap();
    let stable = |p: f64, n: usize, w: i64, closure: Closure| {
        let like = |layer: &&Layer| (layer.of.n, layer.of.w, layer.of.closure) == (n, w, closure);
        let layer = layers.iter().find(like).unwrap();
        let point = (p / 1.6 * SIDE as f64) as usize + SIDE * (SIDE / 2);
        layer.pieces[layer.piece[point]].stable
    };
    let rotations = [0.3, 0.5, 1.3, 1.4].map(|p| stable(p, 1, 1, Closure::Whole));
    assert_eq!(rotations, [Some(0), Some(1), Some(1), Some(0)]);
    let oscillations = [1.2, 1.29].map(|p| stable(p, 2, 0, Closure::Half));
    assert_eq!(oscillations, [Some(1), Some(0)]);
    assert_eq!([1.2, 1.29].map(|p| stable(p, 2, 0, Closure::Whole)), [Some(0), Some(2)]);
    assert!(
        layers
            .iter()
            .all(|layer| layer.pieces.iter().all(|p| p.points < LEAST || p.stable.is_some()))
    );
}

#[test]
fn a_branch_has_few_steps_where_motions_part_within_a_period() {
    let base = Pendulum::new(0.1, 2.4975, 1.0, 0.0, 0.0).unwrap();
    let course = Course::of(&base, Parameter::Omega);
    let mut family = Family::new(course, Bounds { low: 0.6, high: 1.5 }, 1).unwrap();
    let rest = newton::find(&PoincareMap::new(&base), [0.0, 0.0], 1, 1.0).unwrap();
    family.add(&rest, 1.0, &AtomicBool::new(false)).unwrap();
    let shed = family.branches.iter().filter(|branch| branch.of.closure == Closure::Whole);
    let steps: Vec<usize> = shed.map(|branch| branch.run.orbits.len()).collect();
    assert!(!steps.is_empty() && steps.iter().all(|count| *count < 400), "{steps:?}");
}

#[test]
fn without_damping_no_curve_lies_where_nothing_drives() {
    let base = Pendulum::new(0.0, 1.0, 2.0, 0.0, 0.0).unwrap();
    let request = Request { longest: 1, only: Some(vec![(1, 0), (1, 1)]), threads: 1 };
    let law = |[low, high]: [f64; 2]| Law::Quadratic([low, high - low, 0.0]);
    let axes =
        vec![vec![(Parameter::P, law([0.0, 1.5]))], vec![(Parameter::Omega, law([1.5, 2.5]))]];
    let found = curves(&Course::new(base, axes), &request, &Control::default()).unwrap();
    assert!(found.plane.curves.iter().any(|curve| curve.ends.contains(&End::Undriven)));
    for curve in &found.plane.curves {
        assert!(curve.points.iter().any(|point| Critical::at(&point.orbit.place)[0] > 1e-6));
    }
}
