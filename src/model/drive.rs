//! The harmonic drive of the pivot.

use std::f64::consts::TAU;

use crate::error::Error;
use crate::lanes::Real;
use crate::lanes::sine::Fine;

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
        let finite = "a finite number";
        for (name, value) in [("p", p), ("phase", phase)] {
            if !value.is_finite() {
                return Err(Error::Range { name, value, allowed: finite });
            }
        }
        if !(omega.is_finite() && omega > 0.0) {
            return Err(Error::Range { name: "omega", value: omega, allowed: "a number above 0" });
        }
        // Without whole turns: added to a large phase the time would be lost in rounding.
        Ok(Self { p, omega, phase: if phase.abs() > TAU { phase % TAU } else { phase } })
    }
}

/// The pivot's acceleration over gravity, with all that effects have added to the harmonic drive.
///
/// Upward `p cos(a) + second p cos(2 a + second_phase)` and, toward positive theta,
/// `lateral p cos(a + lateral_phase)`, where `a = omega tau + phase + chirp tau^2 / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<R> {
    /// Amplitude of the harmonic drive.
    pub p: R,
    /// Its angular frequency.
    pub omega: R,
    /// Its phase at `tau = 0`, rad.
    pub phase: R,
    /// Amplitude at twice the frequency, over `p`.
    pub second: R,
    /// Its phase against the drive, rad.
    pub second_phase: R,
    /// Amplitude of the sideways acceleration, over `p`.
    pub lateral: R,
    /// Its phase against the drive, rad.
    pub lateral_phase: R,
    /// Rate of change of the angular frequency.
    pub chirp: R,
}

impl<R: Real> Motion<R> {
    /// `1 + a(tau)` with the upward acceleration `a`; without second harmonic and chirp if `plain`.
    #[inline(always)]
    pub fn vertical(&self, tau: R, plain: bool) -> R {
        if plain {
            return self.p * cosine(self.omega * tau + self.phase) + tau.like(1.0);
        }
        let angle = self.angle(tau);
        let second = self.second * cosine(angle.scale(2.0) + self.second_phase);
        self.p * (cosine(angle) + second) + tau.like(1.0)
    }

    /// The sideways acceleration.
    #[inline(always)]
    pub fn sideways(&self, tau: R) -> R {
        self.p * self.lateral * cosine(self.angle(tau) + self.lateral_phase)
    }

    #[inline(always)]
    fn angle(&self, tau: R) -> R {
        (self.omega + self.chirp.scale(0.5) * tau) * tau + self.phase
    }
}

#[inline(always)]
fn cosine<R: Real>(angle: R) -> R {
    angle.scale(std::f64::consts::FRAC_1_PI).cosine::<Fine>()
}
