//! What moves the pivot.

use crate::error::Error;

/// Harmonic vertical motion of the pivot: the factor `1 + p cos(omega tau + phase)` on gravity.
///
/// `p = Y Omega^2 / g` and `omega = Omega / w0`, nondimensional (Horton, Wiercigroch & Xu 2008,
/// eq. 1.2); `phase` in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicDrive {
    /// Amplitude of the pivot's acceleration over gravity.
    pub p: f64,
    /// Angular frequency over the pendulum's own.
    pub omega: f64,
    /// Phase at tau = 0, rad.
    pub phase: f64,
}

impl HarmonicDrive {
    /// Checks the ranges: all finite, omega positive.
    ///
    /// # Errors
    /// [`Error::Range`] for the first value outside them.
    pub fn new(p: f64, omega: f64, phase: f64) -> Result<Self, Error> {
        let finite = "any finite number";
        for (name, value) in [("p", p), ("phase", phase)] {
            if !value.is_finite() {
                return Err(Error::Range { name, value, allowed: finite });
            }
        }
        if !(omega.is_finite() && omega > 0.0) {
            return Err(Error::Range { name: "omega", value: omega, allowed: "a number above 0" });
        }
        Ok(Self { p, omega, phase })
    }

    /// `1 + p cos(omega tau + phase)`.
    #[must_use]
    pub fn modulation(&self, tau: f64) -> f64 {
        1.0 + self.p * (self.omega * tau + self.phase).cos()
    }

    /// Whether the pivot rests.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.p == 0.0
    }

    /// The forcing period `2 pi / omega`; `2 pi` where the pivot rests.
    #[must_use]
    pub fn period(&self) -> f64 {
        if self.is_still() { std::f64::consts::TAU } else { std::f64::consts::TAU / self.omega }
    }
}
