//! Branches of orbits along a parameter: against reference values, exact multipliers, and finite differences.

use std::sync::atomic::AtomicBool;

use pendmap::continuation::branch::{Bounds, End};
use pendmap::continuation::course::{Course, Law};
use pendmap::continuation::cycle::{Closure, Orbit};
use pendmap::continuation::event::Kind as Happens;
use pendmap::continuation::family::{Branch, Family};
use pendmap::continuation::period::Period;
use pendmap::error::Error;
use pendmap::integrate::reference::event::EventKind;
use pendmap::integrate::trajectory::{Request as Trajectory, simulate};
use pendmap::maps::branches::{Branches, Request, branches};
use pendmap::maps::control::Control;
use pendmap::maps::tongues::{Balance, tongues};
use pendmap::model::{Effect, Formula, Kind, Parameter, Pendulum};
use pendmap::orbit::PoincareMap;
use pendmap::orbit::newton::find;

use crate::effects_as_formulas::formula;
use crate::support::driven;

/// All branches of `n:w` in a range of `p`.
fn along_p(base: &Pendulum, range: [f64; 2], winding: (usize, i64), longest: usize) -> Branches {
    along(&Course::of(base, Parameter::P), range, winding, longest)
}

fn along(course: &Course, [low, high]: [f64; 2], (n, w): (usize, i64), longest: usize) -> Branches {
    let request = Request { n, w, longest, start: None, threads: 0 };
    branches(course, Bounds { low, high }, &request, &Control::default()).expect("branches")
}

/// Places of the events of a kind on branches of period `n`, twins left out.
fn events(found: &Branches, n: usize, kind: Happens) -> Vec<f64> {
    let family = &found.family;
    let own = family.branches.iter().enumerate();
    let own = own.filter(|(k, b)| b.of.n == n && b.twin.is_none_or(|twin| twin > *k));
    let mut all: Vec<f64> = own.flat_map(|(_, branch)| of_kind(family, branch, kind)).collect();
    all.sort_by(f64::total_cmp);
    all
}

fn of_kind(family: &Family, branch: &Branch, kind: Happens) -> Vec<f64> {
    let cycles = family.cycles(branch.of);
    let events = branch.run.events.iter().filter(|event| event.kind == kind);
    events.map(|event| cycles.at(&branch.run.orbits[event.orbit].place)).collect()
}

fn assert_near(found: &[f64], expected: &[f64], error: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < error, "{a:.13} {b:.13}");
    }
}

#[test]
fn folds_and_doublings_of_rotations() {
    for (omega, fold) in [
        (0.87, 0.311387955004),
        (1.2, 0.307512970661),
        (2.0, 0.416787572822),
        (3.0, 0.605110511155),
    ] {
        let found = along_p(&driven(0.1, 1.0, omega), [0.25, 1.6], (1, 1), 1);
        assert_near(&events(&found, 1, Happens::Fold), &[fold], 1e-10);
        let branch = &found.family.branches[0];
        assert_eq!(found.family.branches.len(), 1);
        assert_eq!(branch.ends, [End::Range; 2]);
        let cycles = found.family.cycles(branch.of);
        let exact = (-0.1 * std::f64::consts::TAU / omega).exp();
        for orbit in &branch.run.orbits {
            let [a, b] = cycles.multipliers(orbit).0;
            assert!(((a * b).re / exact - 1.0).abs() < 1e-12);
            let at = cycles.at(&orbit.place);
            let map = PoincareMap::new(&driven(0.1, at, omega));
            let [point] = cycles.points(&orbit.place)[..] else { panic!("one point") };
            let image = map.once(point);
            assert!(map.gap(point, image.state).norm() < 1e-11 * (1.0 + image.derivative.norm()));
            let trace = (a + b).re;
            assert!((image.derivative.trace() - trace).abs() < 1e-9 * (1.0 + trace.abs()));
        }
    }
    let found = along_p(&driven(0.1, 1.0, 2.0), [0.3, 1.6], (1, 1), 1);
    assert_near(&events(&found, 1, Happens::PeriodDoubling), &[1.346858522521], 1e-10);
}

#[test]
fn symmetric_oscillations_break_once_and_fold_once() {
    let found = along_p(&driven(0.1, 1.0, 2.0), [0.1, 1.6], (2, 0), 2);
    // By scipy: where the half map of the symmetric orbit has the multiplier -1.
    assert_near(&events(&found, 2, Happens::SymmetryBreaking), &[1.258943005924], 1e-10);
    let branches = &found.family.branches;
    assert_eq!(branches.len(), 3, "the symmetric one and a pair of twins");
    assert!(branches[0].ends.contains(&End::Rest) && branches[0].run.events.len() == 1);
    assert_eq!([branches[1].twin, branches[2].twin], [Some(2), Some(1)]);
    assert_eq!(branches[1].meets[0], Some((0, 0)));
    assert_eq!(branches[0].run.events[0].supercritical, Some(true));
    let found = along_p(&driven(0.1, 1.0, 1.8), [0.15, 0.8], (2, 0), 2);
    assert_near(&events(&found, 2, Happens::Fold), &[0.210425102330], 1e-10);
    // It begins at the doubling of rest, which Floquet's theory gives.
    let branch = &found.family.branches[0];
    let cycles = found.family.cycles(branch.of);
    let ends = [&branch.run.orbits[0], &branch.run.orbits[branch.run.orbits.len() - 1]];
    let onset = ends.into_iter().zip(branch.ends).find(|(_, end)| *end == End::Rest).expect("one");
    let level = tongues(
        &driven(0.1, 1.0, 1.8),
        Balance::Hanging,
        &[1.8],
        0.8,
        false,
        1,
        &Control::default(),
    );
    let critical = level.expect("rest")[0].critical[0].p;
    assert_near(&[cycles.at(&onset.0.place)], &[critical], 1e-9);
}

#[test]
fn friction_moves_folds_and_symmetry_breakings() {
    let base = driven(0.1, 1.0, 1.8).with_friction(0.05).expect("in range");
    let found = along_p(&base, [0.2, 1.0], (2, 0), 1);
    assert_near(&events(&found, 2, Happens::Fold), &[0.32594808], 1e-8);
    assert_near(&events(&found, 2, Happens::SymmetryBreaking), &[0.94380974], 1e-8);
}

#[test]
fn sticks_and_grazings_are_where_motions_have_them() {
    let base = driven(0.05, 1.0, 1.0).with_friction(0.4).expect("in range");
    let found = along_p(&base, [1.0, 3.0], (1, 1), 1);
    let family = &found.family;
    let mut checked = 0;
    for branch in &family.branches {
        let cycles = family.cycles(branch.of);
        for event in branch.run.events.iter().filter(|event| !event.smooth) {
            let orbit = &branch.run.orbits[event.orbit];
            let at = cycles.at(&orbit.place);
            // Turns and sticks of the orbit on either side, as a trajectory has them.
            let counts = [-1e-6, 1e-6].map(|by| {
                let near = branch.at(&cycles, at + by);
                let point = cycles.points(&orbit.place)[0];
                let away = |one: &Orbit| (cycles.points(&one.place)[0][0] - point[0]).abs();
                let closest = near.iter().min_by(|a, b| away(a).total_cmp(&away(b))).expect("one");
                let start = cycles.points(&closest.place)[0];
                let pendulum = family.pendulum(at + by);
                let until = pendulum.period();
                let asked = Trajectory { start, until, tol: 1e-12, samples: 16, lyapunov: false };
                let run = simulate(&pendulum, &asked, &AtomicBool::new(false)).expect("a motion");
                let of = |kind| run.events.iter().filter(|event| event.kind == kind).count();
                [of(EventKind::Turn), of(EventKind::Stick)]
            });
            assert_ne!(counts[0], counts[1], "{:?} at {at}", event.kind);
            checked += 1;
        }
    }
    assert!(checked >= 4, "{checked} changes of slips and sticks");
    assert_near(&events(&found, 1, Happens::Grazing)[..1], &[1.86155707819], 1e-9);
}

#[test]
fn rest_swallows_a_stick_slip_motion() {
    // A push of amplitude k moves the pendulum from 0 only above the friction.
    let spec = formula("push", "k*cos(phase)", &[("k", 2.0)]);
    let push = Effect::new(Kind::Formula(Formula::new(&spec).expect("a formula")), &[0.6]);
    let base = Pendulum::new(0.3, 0.0, 0.5, 0.0, 0.0).expect("in range").with_friction(0.3);
    let base = base.expect("in range").with_effect(push.expect("in range")).expect("once");
    let course = Course::of(&base, base.parameter("push.k").expect("there"));
    // The motion that attracts from rest.
    let until = 12.0 * base.period();
    let asked = Trajectory { start: [0.0; 2], until, tol: 1e-10, samples: 16, lyapunov: false };
    let run = simulate(&base, &asked, &AtomicBool::new(false)).expect("a motion");
    let last = run.theta.len() - 1;
    let start = Some(([run.theta[last], run.velocity[last]], 0.6));
    let request = Request { n: 1, w: 0, longest: 1, start, threads: 1 };
    let bounds = Bounds { low: 0.2, high: 0.7 };
    let found = branches(&course, bounds, &request, &Control::default()).expect("a branch");
    assert!(found.family.branches[0].ends.contains(&End::Sticks));
    let at = events(&found, 1, Happens::RestBoundary);
    // The push exceeds the friction from there on.
    assert_near(&at, &[0.3], 1e-10);
}

#[test]
fn doublings_accumulate_by_feigenbaums_ratio() {
    let found = along_p(&driven(0.1, 1.0, 2.0), [1.3, 1.85], (1, 1), 32);
    let at: Vec<f64> = [1, 2, 4, 8, 16, 32]
        .iter()
        .map(|n| *events(&found, *n, Happens::PeriodDoubling).first().expect("a doubling"))
        .collect();
    let ratios: Vec<f64> =
        at.windows(3).map(|three| (three[1] - three[0]) / (three[2] - three[1])).collect();
    assert!((ratios[3] - 4.669201609).abs() < 0.1, "{ratios:?}");
}

#[test]
fn branches_of_rest_change_where_floquets_theory_says() {
    let base = driven(0.1, 1.0, 2.0);
    let found = along_p(&base, [0.05, 6.0], (1, 0), 1);
    for (balance, centre) in
        [(Balance::Hanging, 0.0_f64), (Balance::Inverted, std::f64::consts::PI)]
    {
        let level = tongues(&base, balance, &[2.0], 6.0, false, 1, &Control::default());
        let critical: Vec<f64> = level.expect("rest")[0].critical.iter().map(|c| c.p).collect();
        let own = found.family.branches.iter().find(|branch| {
            branch.of.closure == Closure::Rest && (branch.of.centre.abs() - centre).abs() < 1.0
        });
        let own = own.expect("rest is an orbit");
        let mut at: Vec<f64> = [Happens::SymmetryBreaking, Happens::PeriodDoubling]
            .into_iter()
            .flat_map(|kind| of_kind(&found.family, own, kind))
            .collect();
        at.sort_by(f64::total_cmp);
        assert_near(&at, &critical, 1e-10);
    }
}

#[test]
fn derivatives_are_those_of_differences() {
    let drag = Effect::new(Kind::QuadraticDrag, &[0.03]).expect("in range");
    let smooth = Pendulum::new(0.1, 0.9, 1.7, 0.3, 0.05).expect("in range");
    let rough = smooth.clone().with_friction(0.15).expect("in range");
    let own = smooth.clone().with_effect(drag).expect("once");
    let of_drag = own.parameter("quadratic_drag.q").expect("there");
    let common = [Parameter::P, Parameter::Omega, Parameter::Gamma, Parameter::Torque];
    let mut cases: Vec<(&Pendulum, Parameter)> = Vec::new();
    for base in [&smooth, &rough, &own] {
        cases.extend(common.map(|parameter| (base, parameter)));
    }
    cases.extend([(&rough, Parameter::ThetaR), (&own, of_drag), (&smooth, Parameter::Phase)]);
    let start = [0.7, 0.9];
    for (base, parameter) in cases {
        let course = Course::of(base, parameter);
        let at = base.value(parameter);
        for part in [1.0, 0.5] {
            let image = |value: f64, start: [f64; 2]| {
                Period::<3>::new(&course, &[value]).images(&[start], part).remove(0)
            };
            let here = image(at, start);
            let by = 1e-5;
            let slope =
                |low: [f64; 2], high: [f64; 2]| [0, 1].map(|k| (high[k] - low[k]) / (2.0 * by));
            let expected = slope(image(at - by, start).state, image(at + by, start).state);
            let name = base.name_of(parameter);
            for k in 0..2 {
                let miss = here.by_course[0][k] - expected[k];
                assert!(miss.abs() < 1e-7, "{name}: {:?} {expected:?}", here.by_course[0]);
                let mut sides = [start, start];
                sides[0][k] -= by;
                sides[1][k] += by;
                let [low, high] = sides.map(|side| image(at, side).state);
                let column = slope(low, high);
                for row in 0..2 {
                    let miss = here.by_state[(row, k)] - column[row];
                    assert!(miss.abs() < 1e-7, "{name}: {:?} {column:?}", here.by_state);
                }
            }
            if let Some(product) = here.product {
                assert!((here.by_state.determinant() / product - 1.0).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn equal_steps_agree_with_the_integrator_for_any_model() {
    let base = driven(0.1, 0.9, 1.7);
    let none = Effect::new(Kind::QuadraticDrag, &[0.0]).expect("in range");
    let same = base.clone().with_effect(none).expect("once");
    for parameter in [Parameter::P, Parameter::Omega, Parameter::Gamma] {
        let [a, b] = [&base, &same].map(|pendulum| {
            let course = Course::of(pendulum, parameter);
            Period::<3>::new(&course, &[base.value(parameter)]).images(&[[0.7, 0.9]], 1.0).remove(0)
        });
        for k in 0..2 {
            assert!((a.state[k] - b.state[k]).abs() < 1e-13);
            assert!((a.by_course[0][k] - b.by_course[0][k]).abs() < 1e-11);
        }
        assert!((a.by_state - b.by_state).norm() < 1e-12);
    }
}

#[test]
fn a_torque_opens_the_pitchfork_and_no_step_jumps_across() {
    // The pieces come within 1e-4 to 1e-6 of one another, and turn there.
    for torque in [1e-6, 1e-10] {
        let mut base = driven(0.1, 1.0, 2.0);
        base.torque = torque;
        let found = along_p(&base, [1.2, 1.32], (2, 0), 2);
        assert_eq!(found.family.branches.len(), 2, "torque {torque}");
        let folds = events(&found, 2, Happens::Fold);
        assert_eq!(folds.len(), 1, "one of the pieces turns back: {folds:?}");
        assert!((folds[0] - 1.258943).abs() < 1e-2);
        for branch in &found.family.branches {
            assert_eq!(branch.ends, [End::Range; 2]);
        }
    }
}

#[test]
fn rotations_along_a_torque_close_on_themselves() {
    let found =
        along(&Course::of(&driven(0.1, 0.6, 2.0), Parameter::Torque), [-1.5, 2.0], (1, 1), 1);
    let branch = &found.family.branches[0];
    assert_eq!(found.family.branches.len(), 1);
    assert_eq!(branch.ends, [End::Closed; 2]);
    let folds = events(&found, 1, Happens::Fold);
    assert_eq!(folds.len(), 2, "locked between two torques: {folds:?}");
    // No orbit turns with the drive beyond them.
    for at in [folds[0] - 1e-3, folds[1] + 1e-3] {
        assert!(branch.at(&found.family.cycles(branch.of), at).is_empty());
    }
}

#[test]
fn a_direct_drive_has_symmetric_orbits_of_odd_period() {
    let spec = formula("push", "k*cos(phase)", &[("k", 2.0)]);
    let push = Effect::new(Kind::Formula(Formula::new(&spec).expect("a formula")), &[0.2])
        .expect("in range");
    let base =
        Pendulum::new(0.2, 0.0, 0.8, 0.0, 0.0).expect("in range").with_effect(push).expect("once");
    let course = Course::of(&base, base.parameter("push.k").expect("there"));
    let found = along(&course, [0.05, 0.9], (1, 0), 2);
    let family = &found.family;
    let half = family.branches.iter().filter(|b| b.of.closure == Closure::Half);
    assert!(half.count() >= 1);
    for branch in &family.branches {
        assert!(
            !branch.ends.iter().any(|end| matches!(end, End::Lost(_) | End::Crossing)),
            "{:?}",
            branch.ends
        );
    }
}

#[test]
fn negative_damping_sheds_a_torus() {
    let spec = formula("pump", "b*v - c*v^3", &[("b", 1.0), ("c", -1.0)]);
    let pump = Effect::new(Kind::Formula(Formula::new(&spec).expect("a formula")), &[0.1, 0.5])
        .expect("in range");
    let base = driven(0.2, 0.05, 1.3).with_effect(pump).expect("once");
    let course = Course::of(&base, base.parameter("pump.b").expect("there"));
    let found = along(&course, [0.1, 0.3], (1, 0), 1);
    let all: Vec<f64> = events(&found, 1, Happens::NeimarkSacker);
    // Rest, hanging: the damping is none where the effect feeds what gamma takes.
    assert_near(&all, &[0.2], 1e-10);
}

#[test]
fn a_start_gives_the_one_branch_through_its_orbit() {
    let base = driven(0.1, 0.6, 2.0);
    let course = Course::of(&base, Parameter::P);
    let start = [-0.9637656868217229, 2.4287080359130084];
    let request = Request { n: 1, w: 1, longest: 1, start: Some((start, 0.6)), threads: 1 };
    let bounds = Bounds { low: 0.3, high: 1.0 };
    let found = branches(&course, bounds, &request, &Control::default()).expect("a branch");
    assert_eq!(found.family.branches.len(), 1);
    assert!(found.sections.is_empty());
    let orbit = find(&PoincareMap::new(&base), start, 1, 0.3).expect("an orbit");
    assert!(found.family.passes(&orbit, 0.6));
    let nowhere = Request { start: Some(([0.3, 9.0], 0.6)), ..request };
    let refused = branches(&course, bounds, &nowhere, &Control::default());
    assert!(matches!(refused, Err(Error::NoOrbit { .. })));
}

#[test]
fn bad_ranges_are_refused() {
    let base = driven(0.1, 0.6, 2.0);
    for (parameter, [low, high]) in [
        (Parameter::P, [1.0, 0.5]),
        (Parameter::Gamma, [-0.1, 0.2]),
        (Parameter::Omega, [0.0, 1.0]),
    ] {
        assert!(Family::new(Course::of(&base, parameter), Bounds { low, high }, 1).is_err());
    }
    let law = Law::through(&[0.0, 1.0, 2.0], &[1.0, 3.0, 9.0]).expect("of degree 2");
    assert!((law.at(1.5)[0] - 5.5).abs() < 1e-12 && (law.at(1.5)[1] - 6.0).abs() < 1e-12);
    assert!(Law::through(&[0.0, 1.0, 2.0, 3.0], &[0.0, 1.0, 0.0, 5.0]).is_err());
    let mut stopped =
        Family::new(Course::of(&base, Parameter::P), Bounds { low: 0.3, high: 1.0 }, 1)
            .expect("a range");
    let map = PoincareMap::new(&base);
    let orbit = find(&map, [-0.96, 2.43], 1, 0.3).expect("an orbit");
    assert!(matches!(stopped.add(&orbit, 0.6, &AtomicBool::new(true)), Err(Error::Interrupted)));
}
