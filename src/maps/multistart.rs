//! Starting points for Newton's method: all points at which a field over the plane may vanish, or have a number of turns.
//!
//! [`places`] divides the plane into cells. In a cell the field is compared with its linear part `J`, both
//! multiplied by `1 / J`: at a zero, at `x` from the centre in cells, `x + J^-1 F(0)` is the negative of the
//! nonlinear part. The nonlinear part is estimated on the nodes of the cell and the ring of cells about it, an area
//! nine times the cell, on which the quadratic part is nine times larger too. A cell is dropped if this estimate
//! excludes a zero in it; the other cells are quartered and tested again.
//!
//! [`approach`] then takes steps of Newton's method by finite differences from many places at once.

use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;

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

/// A node, by its numbers along both axes in the finest division.
type Place = [i64; 2];

/// A cell that may hold a zero.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Its corner with the lowest values.
    place: Place,
    /// The zero of the linear part.
    aim: State,
    /// The turns that the field has there.
    turns: i64,
    /// The nonlinear part on the ring, in cells; infinite where it is not known.
    bend: f64,
}

/// Points from which Newton's method should find all places in the box at which the field is a number of turns from the
/// least to the most, in its first component; with this number. Of more than `most` those where the
/// field is nearly linear come first.
///
/// # Errors
/// Errors of `field`, which is evaluated at many points at once.
pub(super) fn places(
    axes: [Axis; 2],
    turns: [i64; 2],
    most: usize,
    mut field: impl FnMut(&[State]) -> Result<Vec<State>, Error>,
) -> Result<Vec<(State, i64)>, Error> {
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
            let place = [i, j].map(|k| (k << LEVELS) as i64);
            cells.extend(judged((place, corner), size, turns, &std::array::from_fn(patch)));
        }
    }
    let finest = size.map(|s| s / f64::from(1 << LEVELS));
    let at =
        |[i, j]: Place| [theta.low + i as f64 * finest[0], velocity.low + j as f64 * finest[1]];
    let mut known: HashMap<Place, State> = HashMap::new();
    for level in 1..=LEVELS {
        if cells.len() > most {
            break;
        }
        let side = 1 << (LEVELS - level);
        size = size.map(|s| 0.5 * s);
        let around = |cell: &Cell| {
            let [i, j] = cell.place;
            (-1..=3).flat_map(move |y| (-1..=3).map(move |x| [i + x * side, j + y * side]))
        };
        let mut new: Vec<Place> = cells.iter().flat_map(around).collect();
        new.sort_unstable();
        new.dedup();
        new.retain(|place| !known.contains_key(place));
        let values = field(&new.iter().map(|place| at(*place)).collect::<Vec<State>>())?;
        known.extend(new.into_iter().zip(values));
        let mut smaller = Vec::new();
        for cell in &cells {
            let values: Vec<State> = around(cell).map(|place| known[&place]).collect();
            for quarter in 0..4 {
                let (i, j) = (quarter % 2, quarter / 2);
                let patch = std::array::from_fn(|k| values[(j + k / 4) * 5 + i + k % 4]);
                let place = [cell.place[0] + i as i64 * side, cell.place[1] + j as i64 * side];
                smaller.extend(judged((place, at(place)), size, [cell.turns; 2], &patch));
            }
        }
        cells = smaller;
    }
    if cells.len() > most {
        cells.sort_by(|a, b| a.bend.total_cmp(&b.bend));
    }
    Ok(cells.iter().map(|cell| (cell.aim, cell.turns)).collect())
}

/// The cell with each number of turns, from the least to the most, that the field may have in it.
fn judged(
    (place, corner): (Place, State),
    size: [f64; 2],
    [least, most]: [i64; 2],
    patch: &Patch,
) -> impl Iterator<Item = Cell> {
    let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for value in patch {
        for k in 0..2 {
            (low[k], high[k]) = (low[k].min(value[k]), high[k].max(value[k]));
        }
    }
    let [from, to] = [0, 1].map(|k| {
        let spare = CLEAR * (high[k] - low[k]);
        [low[k] - spare, high[k] + spare]
    });
    // Values that are not numbers give none.
    let [first, last] = [(from[0] / TAU).ceil() as i64, (from[1] / TAU).floor() as i64];
    let clear = !(to[0] <= 0.0 && to[1] >= 0.0);
    let turns = first.max(least)..=if clear { i64::MIN } else { last.min(most) };
    let linear = (!turns.is_empty()).then(|| Linear::of(patch)).flatten();
    let centre = [0, 1].map(|k| corner[k] + 0.5 * size[k]);
    turns.filter_map(move |turns| {
        let unresolved = Cell { place, aim: centre, turns, bend: f64::INFINITY };
        let Some(Linear { inverse, mean, bend }) = linear else { return Some(unresolved) };
        let from_centre = inverse * (mean - Vector2::new(TAU * turns as f64, 0.0));
        if (0..2).any(|k| from_centre[k].abs() > HALF + bend[k]) {
            return None;
        }
        let bend = bend[0] + bend[1];
        if !bend.is_finite() {
            return Some(unresolved);
        }
        // At most to the cell's edge: the linear part is unknown beyond.
        let aim = [0, 1].map(|k| centre[k] - from_centre[k].clamp(-1.0, 1.0) * size[k]);
        Some(Cell { place, aim, turns, bend })
    })
}

/// A field on a cell: the inverse of its derivative, in cells, its mean, and the nonlinear part on the ring, in cells.
#[derive(Clone, Copy)]
struct Linear {
    inverse: Matrix2<f64>,
    mean: Vector2<f64>,
    bend: [f64; 2],
}

impl Linear {
    /// None where the derivative has no inverse.
    fn of(patch: &Patch) -> Option<Self> {
        let value = |k: usize| Vector2::from(patch[k]);
        let mean = 0.25 * (value(5) + value(6) + value(9) + value(10));
        let along = 0.5 * (value(6) + value(10) - value(5) - value(9));
        let up = 0.5 * (value(9) + value(10) - value(5) - value(6));
        let inverse = Matrix2::from_columns(&[along, up]).try_inverse()?;
        let mut bend = [0.0_f64; 2];
        for k in 0..16 {
            let at = Vector2::new((k % 4) as f64 - 1.5, (k / 4) as f64 - 1.5);
            let rest = inverse * (value(k) - mean) - at;
            bend = [bend[0].max(rest[0].abs()), bend[1].max(rest[1].abs())];
        }
        Some(Self { inverse, mean, bend })
    }
}

/// A start during the iteration.
struct Iteration {
    first: State,
    point: State,
    turns: i64,
    least: f64,
    best: State,
    begun_at: f64,
}

/// The points that the starts reach within `reach` near places at which the field is their number of turns, each once.
///
/// # Errors
/// Errors of `field`, which is evaluated at many points at once.
pub(super) fn approach(
    starts: &[(State, i64)],
    reach: f64,
    mut field: impl FnMut(&[State]) -> Result<Vec<State>, Error>,
) -> Result<Vec<State>, Error> {
    let begun = |(start, turns): &(State, i64)| Iteration {
        first: *start,
        point: *start,
        turns: *turns,
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
            let shift = Vector2::new(TAU * w.turns as f64, 0.0);
            let [at, right, above] = [0, 1, 2].map(|k| Vector2::from(values[k]) - shift);
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
