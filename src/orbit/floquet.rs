//! Floquet multipliers of a periodic orbit.

use nalgebra::{Complex, Matrix2};
use serde::{Deserialize, Serialize};

/// The eigenvalues of the derivative of `P^n`, the larger first.
///
/// Their product is `exp(-gamma n T)` whatever the orbit, since damping alone shrinks phase area; with
/// friction times the ratios of the accelerations after and before each turn, and 0 after a stick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Multipliers(pub [Complex<f64>; 2]);

impl Multipliers {
    /// The largest modulus: the orbit attracts if it is below 1.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.0[0].norm()
    }

    /// The largest Lyapunov exponent of an orbit of the given duration.
    #[must_use]
    pub fn exponent(&self, duration: f64) -> f64 {
        self.largest().ln() / duration
    }
}

/// The multipliers, from the monodromy matrix and the exact product of its eigenvalues.
///
/// The trace comes from the matrix; the product is the exact one, since the difference of large
/// entries loses it where the contraction is strong.
#[must_use]
pub fn multipliers(monodromy: &Matrix2<f64>, product: f64) -> Multipliers {
    let half = 0.5 * monodromy.trace();
    let square = half * half - product;
    if square < 0.0 {
        let imaginary = (-square).sqrt();
        return Multipliers([Complex::new(half, imaginary), Complex::new(half, -imaginary)]);
    }
    let large = half + square.sqrt().copysign(half);
    let small = if large == 0.0 { 0.0 } else { product / large };
    Multipliers([Complex::new(large, 0.0), Complex::new(small, 0.0)])
}
