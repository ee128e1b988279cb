//! Curves in the plane of two parameters at which slips and sticks change.

use pendmap::continuation::branch::{Bounds, End};
use pendmap::continuation::course::{Course, Law};
use pendmap::continuation::critical::Critical;
use pendmap::continuation::event::Kind;
use pendmap::continuation::period::Period;
use pendmap::maps::branches::{Request as Along, Sought, branches};
use pendmap::maps::control::Control;
use pendmap::maps::curves::{Curves, Request, curves};
use pendmap::model::{Parameter, Pendulum};

use crate::support::driven;

type Range = (Parameter, [f64; 2]);

fn plane(base: &Pendulum, axes: [Range; 2], only: (usize, i64)) -> Curves {
    let law =
        |(parameter, [low, high]): Range| vec![(parameter, Law::Quadratic([low, high - low, 0.0]))];
    let course = Course::new(base.clone(), axes.map(law).to_vec());
    let request = Request { longest: only.0, only: Some(vec![only]), threads: 1 };
    curves(&course, &request, &Control::default()).expect("curves")
}

fn values(axes: [Range; 2], point: &nalgebra::DVector<f64>) -> [f64; 2] {
    let at = Critical::at(point);
    [0, 1].map(|k| axes[k].1[0] + at[k] * (axes[k].1[1] - axes[k].1[0]))
}

#[test]
fn curves_hold_the_events_along_one_parameter() {
    let base = driven(0.05, 1.0, 1.0).with_friction(0.4).expect("in range");
    let axes = [(Parameter::P, [1.0, 2.5]), (Parameter::Omega, [0.8, 1.2])];
    let found = plane(&base, axes, (1, 1));
    let mut checked = 0;
    for omega in [0.9, 1.05] {
        let mut base = base.clone();
        base.drive.omega = omega;
        let request = Along { sought: Sought::Type(1, 1), longest: 1, threads: 1 };
        let bounds = Bounds { low: 1.0, high: 2.5 };
        let course = Course::of(&base, Parameter::P);
        let along = branches(&course, bounds, &request, &Control::default()).expect("branches");
        for branch in &along.family.branches {
            let cycles = along.family.cycles(branch.of);
            for event in &branch.run.events {
                if event.smooth || !event.kind.is_of_friction() {
                    continue;
                }
                let at = cycles.at(&branch.run.orbits[event.orbit].place);
                let jumped = branch.run.events.iter().find(|other| {
                    !other.smooth && other.orbit == event.orbit && other.kind != event.kind
                });
                let held = (omega - 0.8) / 0.4;
                let on = found.plane.curves.iter().filter(|curve| curve.kind == event.kind);
                let near = on.flat_map(|curve| {
                    let critical = found.plane.critical(curve.of, curve.kind);
                    let points = found.plane.points(curve, 1, held).into_iter();
                    points.map(move |point| {
                        (values(axes, &point.orbit.place)[0], critical.jumped(&point))
                    })
                });
                // A motion neglects an excess of 1e-10 of the friction, a curve does not.
                let near: Vec<_> = near.filter(|(p, _)| (p - at).abs() < 1e-9).collect();
                assert_eq!(near.len(), 1, "{:?} at {at}, {omega}", event.kind);
                assert_eq!(near[0].1, jumped.map(|other| other.kind), "{at}, {omega}");
                checked += 1;
            }
        }
    }
    assert!(checked >= 5, "{checked} events");
}

#[test]
fn the_boundary_of_rest_is_exact() {
    // The loads torque - (1 +- p) sin th exceed the friction alike where sin th = torque: p torque = theta_r.
    let mut base = Pendulum::new(0.1, 1.0, 1.6, 0.0, 0.15).expect("in range");
    base = base.with_friction(0.1).expect("in range");
    for second in [(Parameter::Omega, [1.2, 2.0]), (Parameter::Torque, [0.1, 0.3])] {
        let axes = [(Parameter::P, [0.05, 1.6]), second];
        let found = plane(&base, axes, (1, 0));
        let boundary = found.plane.curves.iter().filter(|c| c.kind == Kind::RestBoundary);
        let boundary: Vec<_> = boundary.collect();
        assert!(!boundary.is_empty());
        for curve in boundary {
            assert_eq!(curve.ends, [End::Range; 2]);
            for point in &curve.points {
                let [p, other] = values(axes, &point.orbit.place);
                let torque = if second.0 == Parameter::Torque { other } else { 0.15 };
                assert!((p * torque - 0.1).abs() < 1e-13, "{p} {torque}");
            }
        }
    }
}

#[test]
fn numbers_of_events_have_the_derivatives_of_differences() {
    let base = driven(0.1, 1.3, 1.1).with_friction(0.2).expect("in range");
    let axes = [Parameter::P, Parameter::Omega].map(|one| vec![(one, Law::IDENTITY)]);
    let course = Course::new(base, axes.to_vec());
    let mut checked = [0; 2];
    for start in [[0.7, 0.9], [-0.4, 1.6], [2.9, 0.3], [1.0, -2.0]] {
        for (which, kind) in [Kind::StickOnset, Kind::Grazing].into_iter().enumerate() {
            let at = |x: [f64; 4]| {
                let map = Period::<4>::new(&course, &x[2..]).watching(kind);
                map.images(&[[x[0], x[1]]], 1.0).remove(0).edges
            };
            let here = [start[0], start[1], 1.3, 1.1];
            for (number, (_, slopes)) in at(here).iter().enumerate() {
                for k in 0..4 {
                    let [mut low, mut high] = [here; 2];
                    low[k] -= 1e-5;
                    high[k] += 1e-5;
                    let rise = (at(high)[number].0 - at(low)[number].0) / 2e-5;
                    let size = 1.0 + rise.abs();
                    assert!(
                        (rise - slopes[k]).abs() < 1e-6 * size,
                        "{kind:?} {rise} {}",
                        slopes[k]
                    );
                    checked[which] += 1;
                }
            }
        }
    }
    assert!(checked[0] >= 8 && checked[1] >= 4, "{checked:?}");
}
