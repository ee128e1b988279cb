//! The equation of motion, once.
//!
//! `th'' + gamma th' + (1 + p cos(omega tau + phase)) sin th = torque`, nondimensional time
//! `tau = w0 t`, `gamma = c / (m w0)`: eq. 1.2 of Horton, Wiercigroch & Xu (2008) with a constant
//! torque (over `m l^2 w0^2`) on the right.

use std::f64::consts::FRAC_1_PI;

use super::drive::HarmonicDrive;
use crate::error::Error;
use crate::lanes::sine::Degree;
use crate::lanes::{Lane, Real};

/// The parametrically excited pendulum, nondimensional.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pendulum {
    /// Viscous damping `c / (m w0)`, twice the damping ratio.
    pub gamma: f64,
    /// The motion of the pivot.
    pub drive: HarmonicDrive,
    /// Constant torque over `m l^2 w0^2`.
    pub torque: f64,
}

impl Pendulum {
    /// Checks the ranges: all finite, gamma not negative, omega positive.
    ///
    /// # Errors
    /// [`Error::Range`] for the first value outside them.
    pub fn new(gamma: f64, p: f64, omega: f64, phase: f64, torque: f64) -> Result<Self, Error> {
        if !(gamma.is_finite() && gamma >= 0.0) {
            return Err(Error::Range { name: "gamma", value: gamma, allowed: "0 or more" });
        }
        if !torque.is_finite() {
            let allowed = "any finite number";
            return Err(Error::Range { name: "torque", value: torque, allowed });
        }
        Ok(Self { gamma, drive: HarmonicDrive::new(p, omega, phase)?, torque })
    }

    /// The unit of "periods": `2 pi / omega`, or `2 pi` without drive.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.drive.period()
    }

    /// Whether the equation does not depend on time.
    #[must_use]
    pub fn is_autonomous(&self) -> bool {
        self.drive.is_still()
    }

    /// Whether `(th, th') -> (-th, -th')` maps motions to motions.
    #[must_use]
    pub fn is_mirror_symmetric(&self) -> bool {
        self.torque == 0.0
    }

    /// Whether attractors can exist: without damping phase area is kept, and there are none.
    #[must_use]
    pub fn is_dissipative(&self) -> bool {
        self.gamma > 0.0
    }

    /// The acceleration `th''` at time `tau`.
    #[must_use]
    pub fn acceleration<L: Lane>(&self, tau: f64, theta: L, velocity: L) -> L {
        let load = conservative_load::<crate::lanes::sine::Fine, L>(
            self.drive.modulation(tau),
            self.torque,
            theta.scale(FRAC_1_PI),
        );
        velocity.scale_add(-self.gamma, load)
    }
}

/// What acts besides the viscous damping: `torque - modulation sin(pi half_turns)`.
///
/// The angle is in half turns, as the kernel counts it (see [`crate::lanes::sine`]). Linear in `modulation` and `torque`, so that an integrator may put its own factor into both.
#[inline(always)]
pub fn conservative_load<D: Degree, R: Real>(modulation: f64, torque: f64, half_turns: R) -> R {
    half_turns.sine::<D>().affine(-modulation, torque)
}
