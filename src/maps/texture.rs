//! How finely the basins are interwoven.

use rayon::prelude::*;

use super::label::Labels;
use super::starts::Starts;

/// Side of the boxes of the basin entropy, in cells.
const BOX: usize = 5;

/// Measures of a basin map's texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Basin entropy: the mean over boxes of 5 x 5 cells of `-sum p ln p`, `p` the shares of the
    /// labels in the box (Daza, Wagemakers, Georgeot, Guery-Odelin & Sanjuan 2016, Scientific
    /// Reports 6, 31416).
    pub basin_entropy: f64,
    /// Share of pairs of neighbouring cells that have the same label.
    pub neighbours_agree: f64,
    /// The same share if labels were drawn at random with the fractions of the map: `sum f^2`.
    pub chance: f64,
}

/// From the labels of a grid; zeros for a list of starts, which has no neighbours.
#[must_use]
pub fn texture(labels: &Labels, starts: &Starts, pool: &rayon::ThreadPool) -> Texture {
    let Starts::Grid { theta, velocity } = starts else {
        return Texture { basin_entropy: 0.0, neighbours_agree: 0.0, chance: 0.0 };
    };
    let (columns, rows) = (theta.count, velocity.count);
    let cells = labels.label.as_slice();
    // Bands of one box's height, summed in their order: the result does not depend on threads.
    let bands: Vec<Band> = pool.install(|| {
        let tops: Vec<usize> = (0..rows).step_by(BOX).collect();
        tops.into_par_iter().map(|top| band(cells, columns, rows, top)).collect()
    });
    let mut all: Vec<(i16, usize)> = Vec::new();
    for (label, number) in bands.iter().flat_map(|b| &b.counts) {
        count(&mut all, *label, *number);
    }
    let boxes = rows.div_ceil(BOX) * columns.div_ceil(BOX);
    let pairs = rows * (columns - 1) + columns * (rows - 1);
    let same: usize = bands.iter().map(|b| b.same).sum();
    Texture {
        basin_entropy: (bands.iter().map(|b| b.entropy).sum::<f64>() / boxes as f64).max(0.0),
        neighbours_agree: same as f64 / pairs.max(1) as f64,
        chance: all.iter().map(|(_, c)| (*c as f64 / cells.len() as f64).powi(2)).sum(),
    }
}

/// What a row of boxes adds.
struct Band {
    entropy: f64,
    same: usize,
    counts: Vec<(i16, usize)>,
}

fn band(cells: &[i16], columns: usize, rows: usize, top: usize) -> Band {
    let bottom = (top + BOX).min(rows);
    let mut band = Band { entropy: 0.0, same: 0, counts: Vec::new() };
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
        let total = ((bottom - top) * (right - left)) as f64;
        for (label, number) in &counts {
            let p = *number as f64 / total;
            band.entropy -= p * p.ln();
            count(&mut band.counts, *label, *number);
        }
    }
    band
}

fn count(counts: &mut Vec<(i16, usize)>, label: i16, number: usize) {
    match counts.iter_mut().find(|(l, _)| *l == label) {
        Some((_, c)) => *c += number,
        None => counts.push((label, number)),
    }
}
