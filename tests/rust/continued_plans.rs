//! Plans of basin maps continued from a similar pendulum: as those searched alone.

use pendmap::attractor::Attractor;
use pendmap::maps::basins::{Labelling, Plan, ends};
use pendmap::maps::control::{Control, pool};
use pendmap::model::Pendulum;

use crate::support::{driven, plane, unchecked};

/// Side of the planes.
const SIDE: usize = 60;

fn alone(pendulum: &Pendulum) -> Plan {
    Plan::new(pendulum, &plane(SIDE), &unchecked(), &Control::default()).expect("a plan")
}

/// Names without the angle, and the labels.
fn mapped(plan: &mut Plan) -> (Vec<String>, Vec<i16>) {
    let pool = pool(1).expect("a pool");
    let (labels, _) = ends(plan, &plane(SIDE), &pool, &Control::default()).expect("labels");
    let name = |a: &Attractor| a.name.split(" at ").next().unwrap_or_default().to_owned();
    (plan.catalogue.attractors.iter().map(name).collect(), labels.label)
}

/// Maps each pendulum alone and continued from the one before.
fn compared(pendulums: impl Iterator<Item = Pendulum>) {
    let mut before: Option<Plan> = None;
    for pendulum in pendulums {
        let mut cold = alone(&pendulum);
        let control = Control::default();
        let mut warm = before.as_ref().map_or_else(
            || cold.clone(),
            |plan| plan.continued(&pendulum, &plane(SIDE), &unchecked(), &control).expect("a plan"),
        );
        assert_eq!(warm.facts.steps, cold.facts.steps, "{pendulum:?}");
        assert_eq!(warm.facts.labelling, cold.facts.labelling, "{pendulum:?}");
        let (names, labels) = mapped(&mut cold);
        let (continued, same) = mapped(&mut warm);
        assert_eq!(continued, names, "{pendulum:?}");
        let differ = labels.iter().zip(&same).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "{pendulum:?}");
        before = Some(warm);
    }
}

#[test]
fn through_births_doublings_and_crises() {
    // Rotations appear near 0.45, oscillations of long periods come and go, the rotations double from 1.35 on.
    compared((0..14).map(|k| driven(0.1, 0.4 + 0.11 * f64::from(k), 2.0)));
}

#[test]
fn under_friction() {
    let pendulum =
        |k: i32| driven(0.05, 0.9, 2.0).with_friction(0.01 * f64::from(k)).expect("a pendulum");
    compared((0..4).map(pendulum));
}

#[test]
fn a_torque_breaks_the_symmetry_that_the_neighbour_had() {
    let pendulum =
        |k: i32| Pendulum::new(0.1, 0.8, 2.0, 0.0, 0.03 * f64::from(k)).expect("a pendulum");
    compared((0..4).map(pendulum));
}

#[test]
fn chaos_that_attracts_everything_is_confirmed_and_left() {
    // Chaos alone, then a window in which every start ends on rotations after long transients.
    let chaos = alone(&driven(0.1, 1.8125, 2.0));
    assert_eq!(chaos.facts.labelling, Labelling::OnlyChaos);
    let control = Control::default();
    let next = |plan: &Plan, p: f64| {
        let pendulum = driven(0.1, p, 2.0);
        plan.continued(&pendulum, &plane(SIDE), &unchecked(), &control).expect("a plan")
    };
    let window = next(&chaos, 1.821875);
    assert_eq!(window.facts.labelling, Labelling::Basins);
    let after = next(&window, 1.85);
    assert_eq!(after.facts.labelling, Labelling::OnlyChaos);
    // An orbit that half a percent of the starts reach beside it.
    let beside = next(&after, 1.859375);
    assert_eq!(beside.catalogue.attractors[0].name, "oscillation 4:0");
    let again = next(&next(&beside, 1.85), 1.9);
    let own = alone(&driven(0.1, 1.9, 2.0));
    assert_eq!(again.facts.labelling, Labelling::OnlyChaos);
    let [a, b] = [&again, &own].map(|plan| &plan.catalogue.attractors[0]);
    assert_eq!(a.kind, b.kind);
    let error = a.exponent_stderr.hypot(b.exponent_stderr);
    assert!((a.exponent - b.exponent).abs() < 4.0 * error, "{} {}", a.exponent, b.exponent);
}
