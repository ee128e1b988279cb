//! Where a field over the plane may vanish: cells that shrink around its zeros.
//!
//! In a cell the field is compared with its linear part `J`, both taken times `1 / J`: where it
//! vanishes, at `x` from the centre in cells, `x + J^-1 F(0)` is the negative of what is not linear. That is
//! estimated on the nodes of the cell and the ring of cells about it, nine times the cell, on which
//! what is quadratic is nine times larger too. A cell from which this leads nowhere inside is left;
//! the others are quartered and looked at again.

use nalgebra::{Matrix2, Vector2};

use super::starts::Axis;
use crate::error::Error;
use crate::integrate::State;

/// How often a cell is quartered.
const LEVELS: usize = 4;
/// Cells are not quartered where more than this many remain: the field is not resolved there.
const MOST_CELLS: usize = 60_000;
/// A zero may lie so far from the centre of its cell, in cells.
const HALF: f64 = 0.75;
/// A component that keeps its sign on all nodes by this part of its range has it in between.
const CLEAR: f64 = 0.5;

/// The nodes of a cell and its ring, rows of equal velocity, the lowest first.
type Patch = [State; 16];

/// A cell that may hold a zero.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Its corner with the lowest values.
    corner: State,
    /// Where linearity puts the zero.
    aim: State,
}

/// Places from which Newton's method should find all zeros in the box.
///
/// # Errors
/// Those of `field`, which is asked for its values at many points at once.
pub(super) fn places(
    axes: [Axis; 2],
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
            cells.extend(judge(corner, size, &std::array::from_fn(patch)));
        }
    }
    for _ in 0..LEVELS {
        if cells.len() > MOST_CELLS {
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
        for (nodes, values) in nodes.chunks_exact(25).zip(values.chunks_exact(25)) {
            for quarter in 0..4 {
                let (i, j) = (quarter % 2, quarter / 2);
                let patch = |k: usize| values[(j + k / 4) * 5 + i + k % 4];
                let corner = nodes[(j + 1) * 5 + i + 1];
                smaller.extend(judge(corner, half, &std::array::from_fn(patch)));
            }
        }
        (cells, size) = (smaller, half);
    }
    Ok(cells.iter().map(|cell| cell.aim).collect())
}

/// The cell, if the field may vanish in it.
fn judge(corner: State, size: [f64; 2], patch: &Patch) -> Option<Cell> {
    let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for value in patch.iter().flatten().zip([0, 1].into_iter().cycle()) {
        let (value, k) = value;
        low[k] = low[k].min(*value);
        high[k] = high[k].max(*value);
    }
    for k in 0..2 {
        let spare = CLEAR * (high[k] - low[k]);
        // Not true either where no value is a number.
        if !(low[k] <= spare && high[k] >= -spare) {
            return None;
        }
    }
    let centre = [corner[0] + 0.5 * size[0], corner[1] + 0.5 * size[1]];
    let value = |k: usize| Vector2::from(patch[k]);
    let mean = 0.25 * (value(5) + value(6) + value(9) + value(10));
    let along = 0.5 * (value(6) + value(10) - value(5) - value(9));
    let up = 0.5 * (value(9) + value(10) - value(5) - value(6));
    let unresolved = Some(Cell { corner, aim: centre });
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
    // Not beyond the cell: the linear part is known no further.
    let aim = [0, 1].map(|k| centre[k] - from_centre[k].clamp(-1.0, 1.0) * size[k]);
    Some(Cell { corner, aim })
}
