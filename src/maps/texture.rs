//! How finely the basins are interwoven.

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
pub fn texture(labels: &Labels, starts: &Starts) -> Texture {
    let Starts::Grid { theta, velocity } = starts else {
        return Texture { basin_entropy: 0.0, neighbours_agree: 0.0, chance: 0.0 };
    };
    let (columns, rows) = (theta.count, velocity.count);
    let at = |i: usize, j: usize| labels.label[j * columns + i];
    let mut entropy = 0.0;
    let mut boxes = 0_usize;
    for top in (0..rows).step_by(BOX) {
        for left in (0..columns).step_by(BOX) {
            let mut counts: Vec<(i16, usize)> = Vec::new();
            let mut total = 0_usize;
            for j in top..(top + BOX).min(rows) {
                for i in left..(left + BOX).min(columns) {
                    count(&mut counts, at(i, j));
                    total += 1;
                }
            }
            boxes += 1;
            entropy -= counts
                .iter()
                .map(|(_, c)| *c as f64 / total as f64)
                .map(|p| p * p.ln())
                .sum::<f64>();
        }
    }
    let (mut same, mut pairs) = (0_usize, 0_usize);
    let mut all: Vec<(i16, usize)> = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let own = at(i, j);
            count(&mut all, own);
            for other in [(i + 1, j), (i, j + 1)] {
                if other.0 < columns && other.1 < rows {
                    pairs += 1;
                    same += usize::from(at(other.0, other.1) == own);
                }
            }
        }
    }
    let cells = (rows * columns) as f64;
    Texture {
        basin_entropy: (entropy / boxes as f64).max(0.0),
        neighbours_agree: same as f64 / pairs.max(1) as f64,
        chance: all.iter().map(|(_, c)| (*c as f64 / cells).powi(2)).sum(),
    }
}

fn count(counts: &mut Vec<(i16, usize)>, label: i16) {
    match counts.iter_mut().find(|(l, _)| *l == label) {
        Some((_, c)) => *c += 1,
        None => counts.push((label, 1)),
    }
}
