//! The interpolating spline of degree 5, and its derivatives, as polynomials between the samples.
//!
//! Piegl & Tiller (1997), The NURBS Book, algorithms A2.2 and A3.3; knots at the samples but the two
//! next to each end, so that polynomials of degree 5 come out exactly.

const DEGREE: usize = 5;
/// Columns of a row of the band matrix: five on either side of the diagonal.
const BAND: usize = 2 * DEGREE + 1;

/// A derivative of the spline through samples; between two of them a polynomial of the time passed.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    pieces: Vec<[f64; DEGREE + 1]>,
}

impl Spline {
    /// The least number of samples.
    pub const FEWEST: usize = DEGREE + 1;

    /// The derivative of this `order` of the spline through `values` at `times`, which rise, are as
    /// many, and [`Spline::FEWEST`] or more.
    #[must_use]
    pub fn derivative(times: &[f64], values: &[f64], order: usize) -> Self {
        let knots = knots(times);
        let mut control = coefficients(&knots, times, values);
        let count = times.len();
        let mut pieces = vec![[0.0; DEGREE + 1]; count - 1];
        let mut factorial = 1.0;
        for derivative in 0..=DEGREE {
            // `control` has the coefficients of this derivative, a spline of a lower degree whose
            // knots lack as many at each end.
            let degree = DEGREE - derivative;
            let inner = &knots[derivative..knots.len() - derivative];
            if derivative >= order {
                let power = derivative - order;
                factorial *= power.max(1) as f64;
                for (piece, time) in pieces.iter_mut().zip(times) {
                    let span = span(inner, degree, control.len(), *time);
                    let weights = basis(inner, degree, span, *time);
                    let sum: f64 = weights
                        .iter()
                        .zip(&control[span - degree..=span])
                        .map(|(w, c)| w * c)
                        .sum();
                    piece[power] = sum / factorial;
                }
            }
            if degree > 0 {
                control = (0..control.len() - 1)
                    .map(|j| {
                        let width = inner[j + degree + 1] - inner[j + 1];
                        degree as f64 * (control[j + 1] - control[j]) / width
                    })
                    .collect();
            }
        }
        Self { pieces }
    }

    /// Its value so long after sample `piece`.
    #[must_use]
    pub fn at(&self, piece: usize, passed: f64) -> f64 {
        self.pieces[piece].iter().rev().fold(0.0, |sum, coefficient| sum * passed + coefficient)
    }
}

/// Six at each end, and the samples but the first three and the last three.
fn knots(times: &[f64]) -> Vec<f64> {
    let count = times.len();
    let margin = DEGREE.div_ceil(2);
    let mut knots = vec![times[0]; DEGREE + 1];
    knots.extend(&times[margin..count - margin]);
    knots.extend([times[count - 1]; DEGREE + 1]);
    knots
}

/// The last knot at or before `time` of those that begin an interval.
fn span(knots: &[f64], degree: usize, count: usize, time: f64) -> usize {
    knots.partition_point(|knot| *knot <= time).clamp(degree + 1, count) - 1
}

/// The basis functions of `degree` that are not zero between the knots `span` and `span + 1`; the
/// first `degree + 1` entries.
fn basis(knots: &[f64], degree: usize, span: usize, time: f64) -> [f64; DEGREE + 1] {
    let mut weights = [0.0; DEGREE + 1];
    weights[0] = 1.0;
    for j in 1..=degree {
        let mut saved = 0.0;
        for r in 0..j {
            let (left, right) = (knots[span + 1 + r - j], knots[span + 1 + r]);
            let part = weights[r] / (right - left);
            weights[r] = saved + (right - time) * part;
            saved = (time - left) * part;
        }
        weights[j] = saved;
    }
    weights
}

/// The coefficients with which the spline goes through the values.
///
/// The matrix is totally positive, so that elimination needs no pivots (de Boor & Pinkus 1977).
fn coefficients(knots: &[f64], times: &[f64], values: &[f64]) -> Vec<f64> {
    let count = times.len();
    let mut rows = vec![[0.0; BAND]; count];
    for (i, time) in times.iter().enumerate() {
        let span = span(knots, DEGREE, count, *time);
        for (k, weight) in basis(knots, DEGREE, span, *time).into_iter().enumerate() {
            // Column `span - DEGREE + k` stands `DEGREE` places right of the diagonal's offset.
            if weight != 0.0 {
                rows[i][span + k - i] = weight;
            }
        }
    }
    let mut solution = values.to_vec();
    for i in 0..count {
        for below in i + 1..(i + 1 + DEGREE).min(count) {
            let factor = rows[below][DEGREE - (below - i)] / rows[i][DEGREE];
            if factor != 0.0 {
                for k in 0..=DEGREE {
                    rows[below][DEGREE - (below - i) + k] -= factor * rows[i][DEGREE + k];
                }
                solution[below] -= factor * solution[i];
            }
        }
    }
    for i in (0..count).rev() {
        let known: f64 =
            (1..=DEGREE.min(count - 1 - i)).map(|k| rows[i][DEGREE + k] * solution[i + k]).sum();
        solution[i] = (solution[i] - known) / rows[i][DEGREE];
    }
    solution
}
