//! The part of a run of equal steps that is independent of the trajectory.
//!
//! Viscous damping is folded into the time of each step. With `s` the time since the step's start,
//! `u = (1 - exp(-gamma s)) / gamma` and `w = th' exp(gamma s)`,
//! `d th / du = w`, `d w / du = exp(2 gamma s) (torque - modulation sin th)`:
//! no velocity on the right, so a Runge-Kutta-Nystrom method applies exactly. The factors
//! `h_u^2 exp(2 gamma s)` of each stage go into the table, and the trajectory carries its angle in
//! half turns, `x = th / pi`, and `kick = h_u x'`, so that a step has no other products than the
//! method's own.

use std::f64::consts::FRAC_1_PI;

use super::tableau::{C, STAGES};
use crate::model::Pendulum;
use crate::model::equation::Forcing;

/// One step's loads, stage by stage.
#[derive(Clone, Copy, Debug)]
pub struct StageLoads {
    /// `1 + p cos(omega tau + phase)` times `factor`.
    pub modulation: [f64; STAGES],
    /// The constant torque times `factor`.
    pub torque: [f64; STAGES],
    /// `h_u^2 exp(2 gamma s) / pi`.
    pub factor: [f64; STAGES],
    /// The accelerations of the drive.
    pub forcing: [Forcing<f64>; STAGES],
}

/// A run of equal steps from one time to another, the same for every trajectory.
#[derive(Clone, Debug)]
pub struct Schedule {
    steps: Vec<StageLoads>,
    /// `exp(-gamma h)`: back from `w` to the velocity at a step's end.
    pub decay: f64,
    /// `h_u / pi`: the velocity times this is the kick that a trajectory carries.
    pub kick: f64,
    duration: f64,
}

impl Schedule {
    /// `steps` equal steps from `tau` to `tau + duration`.
    #[must_use]
    pub fn new(pendulum: &Pendulum, tau: f64, duration: f64, steps: usize) -> Self {
        let gamma = pendulum.gamma;
        let equation = pendulum.equation();
        let h = duration / steps as f64;
        // The step in the folded time u.
        let folded = if gamma == 0.0 { h } else { -(-gamma * h).exp_m1() / gamma };
        let stage_time =
            C.map(|c| if gamma == 0.0 { c * h } else { -(-gamma * c * folded).ln_1p() / gamma });
        let table = (0..steps)
            .map(|k| {
                let start = tau + duration * (k as f64 / steps as f64);
                let still =
                    Forcing { vertical: 1.0, lateral: 0.0, per_gravity: 1.0, lab: 0.0, phase: 0.0 };
                let none = [0.0; STAGES];
                let mut loads = StageLoads {
                    modulation: none,
                    torque: none,
                    factor: none,
                    forcing: [still; STAGES],
                };
                for (i, s) in stage_time.into_iter().enumerate() {
                    let factor = folded * folded * (2.0 * gamma * s).exp() * FRAC_1_PI;
                    loads.forcing[i] = equation.forcing(start + s);
                    loads.modulation[i] = factor * loads.forcing[i].vertical;
                    loads.torque[i] = factor * pendulum.torque;
                    loads.factor[i] = factor;
                }
                loads
            })
            .collect();
        Self { steps: table, decay: (-gamma * h).exp(), kick: folded * FRAC_1_PI, duration }
    }

    /// `steps` equal steps over the forcing period that starts at `tau = 0`.
    #[must_use]
    pub fn period(pendulum: &Pendulum, steps: usize) -> Self {
        Self::new(pendulum, 0.0, pendulum.period(), steps)
    }

    /// The steps, in order.
    #[must_use]
    pub fn steps(&self) -> &[StageLoads] {
        &self.steps
    }

    /// Time covered.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.duration
    }
}
