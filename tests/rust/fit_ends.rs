//! Termination of the descent: at its target, abandoned, or at a kink of the sum of squares.

use std::sync::atomic::AtomicBool;

use pendmap::fit::levenberg_marquardt::{Limit, Outcome, Point, descend};
use pendmap::fit::window::Window;
use pendmap::fit::{Problem, Record, Slot};
use pendmap::model::{Kind, Parameter, Pendulum};

use crate::fit_records::{TOLERANCE, free, record, with};
use crate::support::undriven;

const FRICTION: f64 = 0.03;

fn pendulum() -> Pendulum {
    undriven(0.02, 0.0).with_friction(FRICTION).expect("in range")
}

fn searched(
    records: Vec<Record>,
    starts: &[[f64; 2]],
    target: f64,
    steps: usize,
) -> (Point, Outcome) {
    let windows: Vec<Window> = (records.iter().zip(starts).enumerate())
        .map(|(k, (r, start))| Window { record: k, from: 0, to: r.times.len(), start: *start })
        .collect();
    let slots = [Slot::Gravity, Slot::Parameter(Parameter::Gamma)];
    let all = free(&slots, records.len(), &[1.02, 0.026]);
    let problem = Problem::new(records, all, TOLERANCE).expect("a problem");
    let mut point = Point::new(&problem, problem.start(), windows).expect("a motion");
    let limit = Limit { gain: 1e-6, part: 0.0, steps, target };
    let outcome = descend(&problem, &mut point, &[], limit, &AtomicBool::new(false));
    (point, outcome.expect("not cancelled"))
}

/// A decay with a drag that the model lacks, in units of an error of 0.001.
fn with_drag() -> Record {
    let truth = with(pendulum(), &[(Kind::QuadraticDrag, &[0.05])]);
    let mut found = record(truth, None, [1.2, 0.0], 40.0);
    found.pendulum = pendulum();
    found.weights.fill(1000.0);
    found
}

#[test]
fn a_descent_far_from_its_target_is_given_up() {
    let (all, whole) = searched(vec![with_drag()], &[[1.2, 0.0]], f64::INFINITY, 40);
    let least = all.normal.chi2;
    assert!(whole.converged && !whole.given_up && least > 1000.0, "{whole:?} {least}");
    let (point, outcome) = searched(vec![with_drag()], &[[1.2, 0.0]], 0.5 * least, 40);
    assert!(outcome.given_up && !outcome.converged, "{outcome:?}");
    assert!(outcome.steps < whole.steps, "{outcome:?} {whole:?}");
    // Its sum of squares is then near the minimum: abandoning was right.
    assert!(point.normal.chi2 < 1.05 * least, "{} {least}", point.normal.chi2);
    let (point, outcome) = searched(vec![with_drag()], &[[1.2, 0.0]], 1.01 * least, 40);
    assert!(outcome.converged && !outcome.given_up, "{outcome:?}");
    assert!((point.normal.chi2 / least - 1.0).abs() < 1e-9);
}

#[test]
fn a_window_at_a_kink_holds_nothing_up() {
    // It rests just beyond the limit of the model's friction: readings differ by 0.02 rad. Beyond
    // the limit the model slides back; within it the sum of squares falls toward the limit.
    let mut stuck = record(pendulum(), None, [0.01, 0.0], 20.0);
    stuck.readings.fill(FRICTION.asin() + 0.02);
    let decays = [1.2, 0.8].map(|theta| record(pendulum(), None, [theta, 0.0], 40.0));
    let mut records = vec![stuck];
    records.extend(decays);
    for record in &mut records {
        record.weights.fill(1000.0);
    }
    let starts = [[0.02, 0.0], [1.2, 0.0], [0.8, 0.0]];
    let (point, outcome) = searched(records, &starts, f64::INFINITY, 40);
    assert!(outcome.converged, "{outcome:?}");
    let edge = FRICTION.asin();
    let [theta, _] = point.windows[0].start;
    assert!(theta > edge && theta < edge + 0.02, "{theta}");
    assert!((point.values[0] - 1.0).abs() < 1e-6, "{:?}", point.values);
    assert!((point.values[1] - 0.02).abs() < 1e-6, "{:?}", point.values);
}
