//! Basin entropy: a measure of how finely basins are interwoven.

use rayon::prelude::*;

use super::label::{Labels, UNDECIDED};
use super::starts::Starts;

/// Side of the boxes of the basin entropy, in cells.
const BOX: usize = 5;

/// Measures of a basin map's texture.
///
/// Entropies are those of Daza, Wagemakers, Georgeot, Guery-Odelin & Sanjuan (2016), Scientific
/// Reports 6, 31416: of a box of 5 x 5 cells `S = -sum p ln p`, `p` the shares of the labels in it.
/// Cells without a known attractor, undecided or failed, are left out; so are cells beyond the last
/// whole box, if there is a whole one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Basin entropy: the mean of `S` over the boxes with a known cell.
    pub basin_entropy: f64,
    /// Boundary basin entropy: the mean of `S` over the boxes with more than one label; 0 if there
    /// are none.
    pub boundary_basin_entropy: f64,
    /// Standard error of that mean, from the spread over the boxes; infinite with fewer than two.
    pub boundary_stderr: f64,
    /// Number of boxes with a known cell.
    pub boxes: usize,
    /// Number of boxes with more than one label.
    pub boundary_boxes: usize,
    /// Share of pairs of neighbouring cells that have the same label.
    pub neighbours_agree: f64,
    /// That share for labels drawn at random with the fractions of the map: `sum f^2`.
    pub chance: f64,
}

impl Texture {
    /// The values of a plane without basins: all labels are equal.
    #[must_use]
    pub const fn plain() -> Self {
        Self {
            basin_entropy: 0.0,
            boundary_basin_entropy: 0.0,
            boundary_stderr: f64::INFINITY,
            boxes: 0,
            boundary_boxes: 0,
            neighbours_agree: 1.0,
            chance: 1.0,
        }
    }
}

/// The entropies of the labels of a grid; zeros for a list of starts, which has no neighbours.
#[must_use]
pub fn texture(labels: &Labels, starts: &Starts, pool: &rayon::ThreadPool) -> Texture {
    let Starts::Grid { theta, .. } = starts else {
        return Texture { neighbours_agree: 0.0, chance: 0.0, ..Texture::plain() };
    };
    of_cells(&labels.label, theta.count, pool)
}

/// The entropies of labels in rows of `columns` cells.
#[must_use]
pub fn of_cells(cells: &[i16], columns: usize, pool: &rayon::ThreadPool) -> Texture {
    let rows = cells.len() / columns.max(1);
    if rows == 0 {
        return Texture::plain();
    }
    // Bands of one box's height, summed in their order: the result does not depend on threads.
    let bands: Vec<Band> = pool.install(|| {
        let tops: Vec<usize> = (0..rows).step_by(BOX).collect();
        tops.into_par_iter().map(|top| band(cells, columns, rows, top)).collect()
    });
    let mut all: Vec<(i16, usize)> = Vec::new();
    for (label, number) in bands.iter().flat_map(|b| &b.counts) {
        count(&mut all, *label, *number);
    }
    let pairs = rows * (columns - 1) + columns * (rows - 1);
    let same: usize = bands.iter().map(|b| b.same).sum();
    let boxes: usize = bands.iter().map(|b| b.boxes).sum();
    let mixed: Vec<f64> = bands.into_iter().flat_map(|b| b.mixed).collect();
    // The sum of nothing is -0.
    let (sum, number) = (0.0 + mixed.iter().sum::<f64>(), mixed.len() as f64);
    let mean = if mixed.is_empty() { 0.0 } else { sum / number };
    let spread = mixed.iter().map(|s| (s - mean).powi(2)).sum::<f64>();
    let several = mixed.len() > 1;
    Texture {
        basin_entropy: sum / boxes.max(1) as f64,
        boundary_basin_entropy: mean,
        boundary_stderr: if several {
            (spread / (number - 1.0) / number).sqrt()
        } else {
            f64::INFINITY
        },
        boxes,
        boundary_boxes: mixed.len(),
        neighbours_agree: same as f64 / pairs.max(1) as f64,
        chance: all.iter().map(|(_, c)| (*c as f64 / cells.len() as f64).powi(2)).sum(),
    }
}

/// The contribution of a row of boxes.
struct Band {
    /// Entropies of the boxes that hold more than one label.
    mixed: Vec<f64>,
    boxes: usize,
    same: usize,
    counts: Vec<(i16, usize)>,
}

fn band(cells: &[i16], columns: usize, rows: usize, top: usize) -> Band {
    let bottom = (top + BOX).min(rows);
    let whole = bottom - top == BOX.min(rows);
    let mut band = Band { mixed: Vec::new(), boxes: 0, same: 0, counts: Vec::new() };
    let mut counts: Vec<(i16, usize)> = Vec::new();
    for left in (0..columns).step_by(BOX) {
        let right = (left + BOX).min(columns);
        counts.clear();
        for j in top..bottom {
            for i in left..right {
                let own = cells[j * columns + i];
                count(&mut counts, own, 1);
                band.same += usize::from(i + 1 < columns && cells[j * columns + i + 1] == own);
                band.same += usize::from(j + 1 < rows && cells[(j + 1) * columns + i] == own);
            }
        }
        for (label, number) in &counts {
            count(&mut band.counts, *label, *number);
        }
        counts.retain(|(label, _)| *label > UNDECIDED);
        if whole && right - left == BOX.min(columns) && !counts.is_empty() {
            band.boxes += 1;
            if counts.len() > 1 {
                band.mixed.push(entropy(&counts));
            }
        }
    }
    band
}

/// `-sum p ln p` over the shares of these counts.
fn entropy(counts: &[(i16, usize)]) -> f64 {
    let total = counts.iter().map(|(_, number)| *number).sum::<usize>() as f64;
    counts.iter().map(|(_, number)| *number as f64 / total).map(|p| p * (1.0 / p).ln()).sum()
}

fn count(counts: &mut Vec<(i16, usize)>, label: i16, number: usize) {
    match counts.iter_mut().find(|(l, _)| *l == label) {
        Some((_, c)) => *c += number,
        None => counts.push((label, number)),
    }
}
