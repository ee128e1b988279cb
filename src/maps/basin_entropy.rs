//! Basin entropy: a measure of how finely basins are interwoven.

use std::ops::Range;

use rayon::prelude::*;

use super::label::UNDECIDED;

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

    /// The values of a list of starts, which have no neighbours.
    #[must_use]
    pub const fn of_list() -> Self {
        Self { neighbours_agree: 0.0, chance: 0.0, ..Self::plain() }
    }
}

/// The entropies of labels in rows of `columns` cells.
#[must_use]
pub fn texture(cells: &[i16], columns: usize, pool: &rayon::ThreadPool) -> Texture {
    let mut sum = TextureSum::new(columns, cells.len() / columns.max(1));
    sum.add(cells, pool);
    sum.total()
}

/// The texture of a plane whose rows come in parts, from the first to the last.
#[derive(Debug)]
pub struct TextureSum {
    columns: usize,
    rows: usize,
    /// Rows counted so far.
    done: usize,
    bands: Vec<Band>,
}

impl TextureSum {
    /// No rows yet, of a plane of `rows` rows with `columns` cells each.
    #[must_use]
    pub const fn new(columns: usize, rows: usize) -> Self {
        Self { columns, rows, done: 0, bands: Vec::new() }
    }

    /// Adds the labels of the next rows, and of the row after them unless it is beyond the last; the
    /// next part begins with that row, the first of a row of boxes.
    pub fn add(&mut self, cells: &[i16], pool: &rayon::ThreadPool) {
        let given = cells.len() / self.columns.max(1);
        let last = self.done + given == self.rows;
        let own = if last { given } else { given.saturating_sub(1) };
        let tall = self.rows >= BOX;
        // Bands of one box's height, summed in their order: the result does not depend on threads.
        let bands: Vec<Band> = pool.install(|| {
            let tops: Vec<usize> = (0..own).step_by(BOX).collect();
            tops.into_par_iter()
                .map(|top| band(cells, [self.columns, given], top..(top + BOX).min(own), tall))
                .collect()
        });
        self.bands.extend(bands);
        self.done += own;
    }

    /// The texture of all rows.
    #[must_use]
    pub fn total(&self) -> Texture {
        let Self { columns, rows, ref bands, .. } = *self;
        if rows == 0 {
            return Texture::plain();
        }
        let cells = (rows * columns) as f64;
        let mut all: Vec<(i16, usize)> = Vec::new();
        for (label, number) in bands.iter().flat_map(|b| &b.counts) {
            count(&mut all, *label, *number);
        }
        let pairs = rows * (columns - 1) + columns * (rows - 1);
        let same: usize = bands.iter().map(|b| b.same).sum();
        let boxes: usize = bands.iter().map(|b| b.boxes).sum();
        let mixed: Vec<f64> = bands.iter().flat_map(|b| &b.mixed).copied().collect();
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
            chance: all.iter().map(|(_, c)| (*c as f64 / cells).powi(2)).sum(),
        }
    }
}

/// The contribution of a row of boxes.
#[derive(Debug)]
struct Band {
    /// Entropies of the boxes that hold more than one label.
    mixed: Vec<f64>,
    boxes: usize,
    same: usize,
    counts: Vec<(i16, usize)>,
}

/// The boxes in these rows of `cells`; `tall` tells whether the plane has a whole box's height.
fn band(cells: &[i16], [columns, rows]: [usize; 2], within: Range<usize>, tall: bool) -> Band {
    let Range { start: top, end: bottom } = within;
    let whole = bottom - top == BOX || !tall;
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
