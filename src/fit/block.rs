//! The equations of one window for its initial state and the parameters.

use nalgebra::DMatrix;

use super::linear::Linear;

/// An initial state with this part of the greatest information is not determined; in the triangle,
/// whose squares are the information.
const BLIND: f64 = 1e-11;
/// Columns of the initial state.
pub const STATE: usize = 2;

/// The equations of one window.
#[derive(Clone, Debug)]
pub struct Block {
    /// The free parameters that it depends on.
    pub places: Vec<usize>,
    /// The triangle: columns for the initial state, the parameters and the residual.
    pub triangle: DMatrix<f64>,
}

impl Block {
    /// Adds the rows of a window with nonzero weight; `places` are its columns' parameters.
    #[must_use]
    pub fn new(linear: &Linear, places: Vec<usize>) -> Self {
        let (count, width) = (places.len(), linear.width);
        let counted: Vec<usize> = (0..linear.residuals.len())
            .filter(|k| linear.row(*k).iter().any(|x| *x != 0.0))
            .collect();
        let columns = width + 1;
        let mut all = DMatrix::zeros(counted.len().max(columns), columns);
        for (row, k) in counted.into_iter().enumerate() {
            let slopes = linear.row(k);
            for of in 0..STATE {
                all[(row, of)] = slopes[count + of];
            }
            for (place, slope) in slopes[..count].iter().enumerate() {
                all[(row, STATE + place)] = *slope;
            }
            all[(row, width)] = linear.residuals[k];
        }
        Self { places, triangle: all.qr().r() }
    }

    /// The triangle with every diagonal of the normal equations raised by the part `damping`.
    #[must_use]
    pub fn damped(&self, damping: f64) -> DMatrix<f64> {
        if damping == 0.0 {
            return self.triangle.clone();
        }
        let columns = self.triangle.ncols();
        let mut all = self.triangle.clone().resize_vertically(2 * columns - 1, 0.0);
        for k in 0..columns - 1 {
            all[(columns + k, k)] = damping.sqrt() * self.triangle.column(k).norm();
        }
        all.qr().r()
    }

    /// Whether the triangle determines no direction of the initial state, as while the pendulum is
    /// stuck.
    #[must_use]
    pub fn blind(triangle: &DMatrix<f64>) -> [bool; STATE] {
        let sizes = [0, 1].map(|k| triangle.column(k).norm());
        let limit = BLIND * sizes[0].max(sizes[1]);
        [0, 1].map(|k| triangle[(k, k)].abs() <= limit)
    }
}
