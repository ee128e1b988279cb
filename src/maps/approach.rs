//! Newton's method on a field for many starts at once, by differences: it only says where to begin.

use std::collections::HashSet;

use nalgebra::{Matrix2, Vector2};

use crate::error::Error;
use crate::integrate::State;

/// Steps.
const ITERATIONS: usize = 16;
/// After so many the field must have fallen tenfold, or the start was too far.
const PROMISING: usize = 8;
/// Steps by which slopes are measured.
const DIFFERENCE: f64 = 1e-5;
/// No step is longer.
const LONGEST_STEP: f64 = 0.5;
/// A field this small is near enough.
const NEAR: f64 = 1e-4;
/// Places nearer than this are one.
const SAME: f64 = 1e-5;

struct Walker {
    first: State,
    point: State,
    least: f64,
    best: State,
    begun_at: f64,
}

/// Where the starts arrive that approach a zero of the field, each place once.
///
/// # Errors
/// Those of `field`, which is asked for its values at many points at once.
pub(super) fn approach(
    starts: &[State],
    reach: f64,
    mut field: impl FnMut(&[State]) -> Result<Vec<State>, Error>,
) -> Result<Vec<State>, Error> {
    let walker = |start: &State| Walker {
        first: *start,
        point: *start,
        least: f64::INFINITY,
        best: *start,
        begun_at: f64::INFINITY,
    };
    let mut walkers: Vec<Walker> = starts.iter().map(walker).collect();
    let mut arrived: Vec<State> = Vec::new();
    for iteration in 0..ITERATIONS {
        if walkers.is_empty() {
            break;
        }
        let nodes: Vec<State> = walkers
            .iter()
            .flat_map(|w| {
                let [x, y] = w.point;
                [[x, y], [x + DIFFERENCE, y], [x, y + DIFFERENCE]]
            })
            .collect();
        let values = field(&nodes)?;
        let mut on = Vec::new();
        for (mut w, values) in walkers.into_iter().zip(values.chunks_exact(3)) {
            let [at, right, above] = [values[0], values[1], values[2]].map(Vector2::from);
            let size = at.norm();
            if iteration == 0 {
                w.begun_at = size;
            }
            if size < w.least {
                (w.least, w.best) = (size, w.point);
            }
            if size < NEAR {
                arrived.push(w.point);
                continue;
            }
            if !size.is_finite() || iteration == PROMISING && w.least > 0.1 * w.begun_at {
                continue;
            }
            let slope = Matrix2::from_columns(&[right - at, above - at]) / DIFFERENCE;
            let Some(step) = slope.lu().solve(&-at) else { continue };
            let damped = (LONGEST_STEP / step.norm()).min(1.0);
            w.point = [w.point[0] + damped * step[0], w.point[1] + damped * step[1]];
            let way = (w.point[0] - w.first[0]).hypot(w.point[1] - w.first[1]);
            // Not true either where the step is no number.
            if way <= reach {
                on.push(w);
            }
        }
        walkers = on;
    }
    // Close to a zero and slow: branches meet there.
    arrived.extend(walkers.iter().map(|w| w.best));
    let mut seen = HashSet::new();
    arrived.retain(|point| seen.insert(point.map(|x| (x / SAME).round() as i64)));
    Ok(arrived)
}
