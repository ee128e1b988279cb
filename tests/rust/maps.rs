//! Whole planes: invariances of a map, and consistency of its parts.

use std::sync::atomic::AtomicBool;

use pendmap::integrate::State;
use pendmap::integrate::accuracy::distance;
use pendmap::integrate::trajectory::{Request, simulate};
use pendmap::lanes::InstructionSet;
use pendmap::maps::basins::{Options, basins};
use pendmap::maps::control::Control;
use pendmap::maps::label::{FAILED, Labels, NEVER, UNDECIDED};
use pendmap::maps::starts::{Axis, Starts};
use pendmap::orbit::PoincareMap;

use crate::support::{
    assert_same, basins_on_plane, cell_names, driven, instruction_sets, labelled, plane,
    relabelled, simd, spread, unchecked,
};

#[test]
fn a_list_of_starts_is_the_same_cells() {
    let starts = plane(30);
    let list = Starts::List((0..starts.len()).map(|i| starts.get(i)).collect());
    for p in [0.6, 1.0] {
        let (strobe, catalogue, labels) = labelled(&driven(0.1, p, 2.0), &starts, simd());
        assert_same(&labels, &relabelled(&strobe, &catalogue, &list, None, 1), "list");
        // A part of them in any order gives the same labels.
        let picks: Vec<usize> = (0..900).rev().step_by(7).collect();
        let part = relabelled(&strobe, &catalogue, &starts, Some(&picks), 1);
        for (k, i) in picks.iter().enumerate() {
            assert_eq!(part.label[k], labels.label[*i]);
            assert_eq!((part.settle[k], part.turns[k]), (labels.settle[*i], labels.turns[*i]));
        }
    }
}

#[test]
fn a_part_of_the_plane_has_the_labels_of_the_whole_by_name() {
    let pendulum = driven(0.1, 0.6, 2.0);
    let whole = basins_on_plane(&pendulum, 60);
    // Columns 20 to 49 and rows 5 to 24 of 60.
    let edge = |low: f64, high: f64, i: f64| low + (high - low) * i / 60.0;
    let pi = std::f64::consts::PI;
    let axis = |name, low, high, count| Axis::new(name, low, high, count).expect("an axis");
    let part = Starts::Grid {
        theta: axis("theta", edge(-pi, pi, 20.0), edge(-pi, pi, 50.0), 30),
        velocity: axis("velocity", edge(-3.0, 3.0, 5.0), edge(-3.0, 3.0, 25.0), 20),
    };
    let small = basins(&pendulum, &part, &unchecked(), &Control::default()).expect("a map");
    let (all, some) = (cell_names(&whole), cell_names(&small));
    for (k, name) in some.iter().enumerate() {
        let (column, row) = (k % 30 + 20, k / 30 + 5);
        assert_eq!(*name, all[row * 60 + column], "column {column}, row {row}");
    }
}

#[test]
fn the_tolerance_does_not_change_smooth_basins() {
    let pendulum = driven(0.1, 0.6, 2.0);
    let [rough, exact] = [1e-6, 1e-11].map(|tol| {
        let options = Options { tol, ..unchecked() };
        basins(&pendulum, &plane(100), &options, &Control::default()).expect("a map")
    });
    assert!(rough.steps * 3 < exact.steps && exact.reached_error <= 1e-11);
    assert_eq!(cell_names(&rough), cell_names(&exact));
}

#[test]
fn parts_of_a_map_agree() {
    for pendulum in [driven(0.1, 1.0, 2.0), driven(0.1, 1.8, 2.0)] {
        let map = basins_on_plane(&pendulum, 24);
        let labels = &map.labels;
        let count = |label: i16| labels.label.iter().filter(|l| **l == label).count();
        let last = map.attractors.len() as i16;
        let all: usize = (FAILED..=last).map(count).sum();
        assert_eq!(all, 576, "labels lie between {FAILED} and {last}");
        for (i, fraction) in map.fractions.iter().enumerate() {
            assert!((fraction * 576.0 - count(i as i16 + 1) as f64).abs() < 1e-9);
            assert!(*fraction > 0.0, "an attractor that is listed has starts");
        }
        assert_eq!(labels.open.len(), count(UNDECIDED));
        assert!(labels.open.iter().all(|(i, _)| labels.label[*i] == UNDECIDED));
        for (label, settle) in labels.label.iter().zip(&labels.settle) {
            let settles =
                usize::try_from(label - 1).is_ok_and(|i| !map.attractors[i].kind.is_chaotic());
            assert_eq!(*settle == NEVER, !settles, "label {label} settles at {settle}");
        }
        assert!(labels.work >= labels.settle.iter().map(|s| (*s).max(0) as u64).sum::<u64>());
    }
}

#[test]
fn settling_times_and_turns_are_those_of_the_trajectory() {
    let pendulum = driven(0.1, 0.6, 2.0);
    let starts = plane(40);
    let (_, catalogue, labels) = labelled(&pendulum, &starts, simd());
    for i in starts.sample(60, 3) {
        let periods = f64::from(labels.settle[i]);
        let until = periods * pendulum.period();
        let start = starts.get(i);
        let request = Request { start, until, tol: 1e-9, samples: 1, lyapunov: false };
        let run = simulate(&pendulum, &request, &AtomicBool::new(false)).expect("a trajectory");
        let last = run.theta.len() - 1;
        let end = [run.theta[last], run.velocity[last]];
        let net = ((end[0] - start[0]) / std::f64::consts::TAU).round();
        assert!((net - f64::from(labels.turns[i])).abs() < 0.5, "start {i}: {net} turns");
        let attractor = &catalogue.attractors[labels.label[i] as usize - 1];
        let off = attractor.points.iter().map(|p| distance(*p, end)).fold(9.0, f64::min);
        assert!(off < 1.0, "start {i} has come to within {off} of {}", attractor.name);
        // From there it converges to the attractor of its label.
        let map = PoincareMap::new(&pendulum);
        let settled = map.iterate(end, 200).state;
        assert!(attractor.points.iter().any(|p| distance(*p, settled) < 1e-8), "start {i}");
    }
}

#[test]
fn every_instruction_set_gives_the_same_fractions() {
    for (p, allowed) in [(0.6, 0.0), (1.0, 0.015)] {
        let (pendulum, starts) = (driven(0.1, p, 2.0), plane(60));
        let (_, reference, expected) = labelled(&pendulum, &starts, InstructionSet::Portable);
        for simd in instruction_sets() {
            let (_, catalogue, labels) = labelled(&pendulum, &starts, simd);
            assert_eq!(catalogue.attractors.len(), reference.attractors.len());
            for (i, attractor) in catalogue.attractors.iter().enumerate() {
                assert_eq!(attractor.name, reference.attractors[i].name);
                let share = |labels: &Labels| {
                    let own = labels.label.iter().filter(|l| **l == i as i16 + 1).count();
                    own as f64 / 3600.0
                };
                let moved = (share(&labels) - share(&expected)).abs();
                assert!(moved <= allowed, "{} at p = {p} on {simd}: {moved}", attractor.name);
            }
        }
    }
}

#[test]
fn a_start_that_fails_is_a_status_and_the_others_do_not_see_it() {
    let mut states: Vec<State> = spread(60, 3.0, 2.5);
    let pendulum = driven(0.1, 0.6, 2.0);
    let options = Options { max_periods: Some(400), ..unchecked() };
    let go = |states: &[State]| {
        let starts = Starts::List(states.to_vec());
        basins(&pendulum, &starts, &options, &Control::default()).expect("a map")
    };
    let sound = go(&states);
    states[17] = [f64::NAN, 0.0];
    let map = go(&states);
    assert_eq!((map.labels.label[17], map.labels.settle[17]), (FAILED, NEVER));
    assert!((map.share(FAILED) - 1.0 / 60.0).abs() < 1e-12);
    for i in (0..60).filter(|i| *i != 17) {
        assert_eq!(cell_names(&map)[i], cell_names(&sound)[i], "start {i}");
    }
}

#[test]
fn a_short_bound_leaves_starts_undecided() {
    for p in [1.0, 1.8] {
        for bound in [12, 60, 300] {
            let options = Options { max_periods: Some(bound), ..unchecked() };
            let map = basins(&driven(0.1, p, 2.0), &plane(40), &options, &Control::default());
            let map = map.expect("a map");
            // Undecided is not chaotic: both planes have transients much longer than the bound.
            for attractor in &map.attractors {
                let name = &attractor.name;
                assert!(!attractor.kind.is_chaotic(), "p = {p} within {bound} periods: {name}");
            }
            assert!(map.labels.settle.iter().all(|s| *s <= bound as i32));
            let undecided = map.share(UNDECIDED);
            assert!(bound > 100 || undecided > 0.05, "p = {p}: {undecided} after {bound} periods");
        }
    }
}
