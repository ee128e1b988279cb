//! The equation over plain numbers: acceleration, and conversion to other numbers.

use std::f64::consts::TAU;

use super::Equation;
use crate::lanes::Real;
use crate::model::drive::Motion;

impl Equation<f64> {
    /// The acceleration `th''` at time `tau`, with the sense of `velocity` unchanged for a long
    /// time.
    #[must_use]
    pub fn acceleration_at(&self, tau: f64, theta: f64, velocity: f64) -> f64 {
        let forcing = self.forcing(tau);
        let at = self.point(&forcing, theta, velocity, 1_f64.copysign(velocity));
        self.acceleration(&forcing, &at)
    }

    /// The equation over numbers in the shape of `number`.
    #[inline(always)]
    #[must_use]
    pub fn map<R: Real>(&self, number: R) -> Equation<R> {
        let Motion { p, omega, phase, second, second_phase, lateral, lateral_phase, chirp } =
            self.motion;
        let mut equation = Equation {
            gamma: number.like(self.gamma),
            theta_r: number.like(self.theta_r),
            torque: number.like(self.torque),
            motion: Motion {
                p: number.like(p),
                omega: number.like(omega),
                phase: number.like(phase),
                second: number.like(second),
                second_phase: number.like(second_phase),
                lateral: number.like(lateral),
                lateral_phase: number.like(lateral_phase),
                chirp: number.like(chirp),
            },
            gravity: [number.like(self.gravity[0]), number.like(self.gravity[1])],
            lab_time: number.like(self.lab_time),
            ages: self.ages,
            torques: Vec::new(),
            inertias: Vec::new(),
            frictions: Vec::new(),
            formulas: Vec::new(),
            keepers: [None, None],
            mode: None,
            corner: self
                .corner
                .clone()
                .map(|(kind, [a, b, c])| (kind, [number.like(a), number.like(b), number.like(c)])),
            sideways: self.sideways,
            plain: self.plain,
            holds: self.holds,
        };
        for (kind, [a, b, c]) in &self.torques {
            equation
                .torques
                .push((kind.clone(), [number.like(*a), number.like(*b), number.like(*c)]));
        }
        for (kind, [a, b, c]) in &self.inertias {
            equation
                .inertias
                .push((kind.clone(), [number.like(*a), number.like(*b), number.like(*c)]));
        }
        for (kind, [a, b, c]) in &self.frictions {
            equation
                .frictions
                .push((kind.clone(), [number.like(*a), number.like(*b), number.like(*c)]));
        }
        for (formula, [a, b, c]) in &self.formulas {
            let parameters = [number.like(*a), number.like(*b), number.like(*c)];
            equation.formulas.push((formula.clone(), parameters));
        }
        equation
    }

    /// The unit of "periods": `2 pi / omega`, or `2 pi` without drive.
    #[must_use]
    pub fn drive_period(&self) -> f64 {
        if self.is_autonomous() { TAU } else { TAU / self.motion.omega }
    }

    /// Whether nothing changes with the drive's phase: the pivot is at rest.
    #[must_use]
    pub fn is_autonomous(&self) -> bool {
        self.motion.p == 0.0 && !self.asks_for_phase()
    }
}
