//! Starting points for Newton's method: all points at which a field over the plane may vanish.
//!
//! [`places`] divides the plane into cells. In a cell the field is compared with its linear part `J`, both
//! multiplied by `1 / J`: at a zero, at `x` from the centre in cells, `x + J^-1 F(0)` is the negative of the
//! nonlinear part. The nonlinear part is estimated on the nodes of the cell and the ring of cells about it, an area
//! nine times the cell, on which the quadratic part is nine times larger too. A cell is dropped if this estimate
//! excludes a zero in it; the other cells are quartered and tested again.
//!
//! [`approach`] then takes steps of Newton's method by finite differences from many places at once.

use std::collections::HashSet;

use nalgebra::{Matrix2, Vector2};

use super::starts::Axis;
use crate::error::Error;
use crate::integrate::State;

/// Number of times that a cell is quartered.
const LEVELS: usize = 4;
/// Largest distance of a zero from the centre of its cell, in cells, by the linear part.
const HALF: f64 = 0.75;
/// A component whose sign is the same on all nodes, with a margin of this part of its range, has no zero in the cell.
const CLEAR: f64 = 0.5;

/// Steps of Newton's method.
const ITERATIONS: usize = 16;
/// Steps after which the field must have fallen tenfold; otherwise the start was too far.
const PROMISING: usize = 8;
/// Finite difference, in angle and in velocity, by which slopes are measured.
const DIFFERENCE: f64 = 1e-5;
/// Largest step in the plane.
const LONGEST_STEP: f64 = 0.5;
/// Size of the field at which Newton's method has converged.
const NEAR: f64 = 1e-4;
/// Distance below which two points are identical.
const SAME: f64 = 1e-5;

/// The nodes of a cell and its ring, rows of equal velocity, the lowest first.
type Patch = [State; 16];

/// A cell that may hold a zero.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Its corner with the lowest values.
    corner: State,
    /// The zero of the linear part.
    aim: State,
    /// The value that the first component has there.
    goal: f64,
}

/// Points from which Newton's method should find all zeros in the box; with a `period` all points at which the first
/// component is a multiple of it. Above `most` cells the field is not resolved, and they are not quartered.
///
/// # Errors
/// Errors of `field`, which is evaluated at many points at once.
pub(super) fn places(
    axes: [Axis; 2],
    period: Option<f64>,
    most: usize,
    mut field: impl FnMut(&[State]) -> Result<Vec<State>, Error>,
) -> Result<Vec<State>, Error> {
    let [theta, velocity] = axes;
    let mut size = axes.map(|axis| (axis.high - axis.low) / axis.count as f64);
    // From a ring outside the box on.
    let (columns, rows) = (theta.count + 3, velocity.count + 3);
    let node = |k: usize| {
        let (i, j) = ((k % columns) as f64 - 1.0, (k / columns) as f64 - 1.0);
        [theta.low + i * size[0], velocity.low + j * size[1]]
    };
    let nodes: Vec<State> = (0..columns * rows).map(node).collect();
    let values = field(&nodes)?;
    let mut cells = Vec::new();
    for j in 0..velocity.count {
        for i in 0..theta.count {
            let patch = |k: usize| values[(j + k / 4) * columns + i + k % 4];
            let corner = nodes[(j + 1) * columns + i + 1];
            let patch: Patch = std::array::from_fn(patch);
            for goal in goals(&patch, period) {
                cells.extend(judge(corner, size, &patch, goal));
            }
        }
    }
    for _ in 0..LEVELS {
        if cells.len() > most {
            break;
        }
        let half = size.map(|s| 0.5 * s);
        let around = |cell: &Cell| {
            let [x, y] = cell.corner;
            (0..25).map(move |k| {
                let (i, j) = (f64::from(k % 5) - 1.0, f64::from(k / 5) - 1.0);
                [x + i * half[0], y + j * half[1]]
            })
        };
        let nodes: Vec<State> = cells.iter().flat_map(around).collect();
        let values = field(&nodes)?;
        let mut smaller = Vec::new();
        let patches = nodes.chunks_exact(25).zip(values.chunks_exact(25)).zip(&cells);
        for ((nodes, values), cell) in patches {
            for quarter in 0..4 {
                let (i, j) = (quarter % 2, quarter / 2);
                let patch = |k: usize| values[(j + k / 4) * 5 + i + k % 4];
                let corner = nodes[(j + 1) * 5 + i + 1];
                smaller.extend(judge(corner, half, &std::array::from_fn(patch), cell.goal));
            }
        }
        (cells, size) = (smaller, half);
    }
    Ok(cells.iter().map(|cell| cell.aim).collect())
}

/// The multiples of the period that the first component may have in a cell.
fn goals(patch: &Patch, period: Option<f64>) -> Vec<f64> {
    let Some(period) = period else { return vec![0.0] };
    let all = || patch.iter().map(|value| value[0]);
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(-f64::INFINITY, f64::max));
    let spare = CLEAR * (high - low);
    let [from, to] = [(low - spare) / period, (high + spare) / period];
    (from.ceil() as i64..=to.floor() as i64).map(|k| k as f64 * period).collect()
}

/// The cell, if the first component may be `goal` in it and the second one 0.
fn judge(corner: State, size: [f64; 2], patch: &Patch, goal: f64) -> Option<Cell> {
    let patch = patch.map(|[first, second]| [first - goal, second]);
    let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for value in patch.iter().flatten().zip([0, 1].into_iter().cycle()) {
        let (value, k) = value;
        low[k] = low[k].min(*value);
        high[k] = high[k].max(*value);
    }
    for k in 0..2 {
        let spare = CLEAR * (high[k] - low[k]);
        // False too if a value is not a number.
        if !(low[k] <= spare && high[k] >= -spare) {
            return None;
        }
    }
    let centre = [corner[0] + 0.5 * size[0], corner[1] + 0.5 * size[1]];
    let value = |k: usize| Vector2::from(patch[k]);
    let mean = 0.25 * (value(5) + value(6) + value(9) + value(10));
    let along = 0.5 * (value(6) + value(10) - value(5) - value(9));
    let up = 0.5 * (value(9) + value(10) - value(5) - value(6));
    let unresolved = Some(Cell { corner, aim: centre, goal });
    let Some(inverse) = Matrix2::from_columns(&[along, up]).try_inverse() else {
        return unresolved;
    };
    let from_centre = inverse * mean;
    let mut bent = [0.0_f64; 2];
    for k in 0..16 {
        let at = Vector2::new((k % 4) as f64 - 1.5, (k / 4) as f64 - 1.5);
        let rest = inverse * value(k) - from_centre - at;
        bent = [bent[0].max(rest[0].abs()), bent[1].max(rest[1].abs())];
    }
    if (0..2).any(|k| from_centre[k].abs() > HALF + bent[k]) {
        return None;
    }
    if !(bent[0] + bent[1]).is_finite() {
        return unresolved;
    }
    // At most to the cell's edge: the linear part is unknown beyond.
    let aim = [0, 1].map(|k| centre[k] - from_centre[k].clamp(-1.0, 1.0) * size[k]);
    Some(Cell { corner, aim, goal })
}

/// A start during the iteration.
struct Iteration {
    first: State,
    point: State,
    least: f64,
    best: State,
    begun_at: f64,
}

/// The points near zeros of the field that the starts reach within `reach`, each once.
///
/// # Errors
/// Errors of `field`, which is evaluated at many points at once.
pub(super) fn approach(
    starts: &[State],
    reach: f64,
    mut field: impl FnMut(&[State]) -> Result<Vec<State>, Error>,
) -> Result<Vec<State>, Error> {
    let begun = |start: &State| Iteration {
        first: *start,
        point: *start,
        least: f64::INFINITY,
        best: *start,
        begun_at: f64::INFINITY,
    };
    let mut iterations: Vec<Iteration> = starts.iter().map(begun).collect();
    let mut arrived: Vec<State> = Vec::new();
    for iteration in 0..ITERATIONS {
        if iterations.is_empty() {
            break;
        }
        let nodes: Vec<State> = iterations
            .iter()
            .flat_map(|w| {
                let [x, y] = w.point;
                [[x, y], [x + DIFFERENCE, y], [x, y + DIFFERENCE]]
            })
            .collect();
        let values = field(&nodes)?;
        let mut on = Vec::new();
        for (mut w, values) in iterations.into_iter().zip(values.chunks_exact(3)) {
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
            let travel = (w.point[0] - w.first[0]).hypot(w.point[1] - w.first[1]);
            // False too if the step is not a number.
            if travel <= reach {
                on.push(w);
            }
        }
        iterations = on;
    }
    // Close to a zero and slow: branches meet there.
    arrived.extend(iterations.iter().map(|w| w.best));
    let mut seen = HashSet::new();
    arrived.retain(|point| seen.insert(point.map(|x| (x / SAME).round() as i64)));
    Ok(arrived)
}
