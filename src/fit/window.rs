//! A record divided into windows, each with its own initial state.

use super::problem::Problem;
use super::record::Record;
use crate::integrate::State;

/// Least number of trusted samples of a window that determines parameters.
const FEWEST: usize = 8;
/// The initial state comes from a cubic through the readings within this time on either side; at an
/// end of the record, where a cubic's slope is uncertain, from a parabola over twice the time. Where readings are so sparse that
/// [`FEWEST`] take more than twice that, as many as determine the polynomial: a motion turns too much within a longer time.
const REACH: f64 = 0.5;

/// A stretch of a record, from sample `from` to before sample `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Its record.
    pub record: usize,
    /// Its first sample.
    pub from: usize,
    /// Index one after its last sample.
    pub to: usize,
    /// Angle and velocity at its first sample.
    pub start: State,
}

/// Windows of about `length` of all records, one after the other, from the first sample that counts;
/// none is longer than its record allows. `state` tells the state at a sample of a record.
pub fn windows_of(
    problem: &Problem,
    length: f64,
    mut state: impl FnMut(usize, usize) -> State,
) -> Vec<Window> {
    let mut windows = Vec::new();
    for (index, record) in problem.records.iter().enumerate() {
        // Before it the pendulum was held: followed backward, a swing grows and may turn over.
        let first = record.weights.iter().position(|weight| *weight > 0.0).unwrap_or(0);
        let begin = record.times[first];
        let span = record.times[record.times.len() - 1] - begin;
        let count =
            (span / length.min(record.longest)).ceil().clamp(1.0, record.times.len() as f64);
        let mut from = first;
        for k in 1..=count as usize {
            let end = begin + span * k as f64 / count;
            let mut to = record.times.partition_point(|time| *time < end);
            if k == count as usize || trusted(record, to, record.times.len()) < FEWEST {
                to = record.times.len();
            }
            if trusted(record, from, to) >= FEWEST || to == record.times.len() && from < to {
                windows.push(Window { record: index, from, to, start: state(index, from) });
                from = to;
            }
        }
    }
    windows
}

/// The halves of a window; none if they would be too short.
#[must_use]
pub fn halves(problem: &Problem, window: &Window) -> Option<[Window; 2]> {
    let record = &problem.records[window.record];
    let Window { from, to, .. } = *window;
    let middle = 0.5 * (record.times[from] + record.times[to - 1]);
    let between = from + record.times[from..to].partition_point(|time| *time < middle);
    let enough = [(from, between), (between, to)]
        .iter()
        .all(|(from, to)| trusted(record, *from, *to) >= 2 * FEWEST);
    enough.then(|| {
        [(from, between), (between, to)].map(|(from, to)| Window {
            record: window.record,
            from,
            to,
            start: guess(record, from),
        })
    })
}

/// Angle and velocity at a sample from a polynomial through the angles about it, by least squares.
#[must_use]
pub fn guess(record: &Record, at: usize) -> State {
    let now = record.times[at];
    let ends = [record.times[0], record.times[record.times.len() - 1]];
    let edge = now - ends[0] < 0.5 * REACH || ends[1] - now < 0.5 * REACH;
    let (mut reach, degree) = if edge { (2.0 * REACH, 2) } else { (REACH, 3) };
    loop {
        let from = record.times.partition_point(|time| *time < now - reach);
        let to = record.times.partition_point(|time| *time <= now + reach);
        let whole = from == 0 && to == record.times.len();
        let enough = if reach > 2.0 * REACH { degree + 1 } else { FEWEST };
        if trusted(record, from, to) >= enough || whole {
            return polynomial(record, from, to, now, degree);
        }
        reach *= 2.0;
    }
}

fn trusted(record: &Record, from: usize, to: usize) -> usize {
    record.weights[from..to].iter().filter(|weight| **weight > 0.0).count()
}

/// Value and slope at `now` of the polynomial through the trusted readings; a line through few.
fn polynomial(record: &Record, from: usize, to: usize, now: f64, degree: usize) -> State {
    let count = if trusted(record, from, to) > degree { degree + 1 } else { 2 };
    let mut normal = nalgebra::DMatrix::<f64>::zeros(count, count);
    let mut right = nalgebra::DVector::<f64>::zeros(count);
    for k in (from..to).filter(|k| record.weights[*k] > 0.0) {
        let row: Vec<f64> = (0..count).map(|i| (record.times[k] - now).powi(i as i32)).collect();
        for i in 0..count {
            right[i] += row[i] * record.angles()[k];
            for j in 0..count {
                normal[(i, j)] += row[i] * row[j];
            }
        }
    }
    let nearest = (from..to).find(|k| record.weights[*k] > 0.0).unwrap_or(from);
    let fallback = [record.angles()[nearest], 0.0];
    normal.cholesky().map_or(fallback, |factor| {
        let all = factor.solve(&right);
        [all[0], all[1]]
    })
}
