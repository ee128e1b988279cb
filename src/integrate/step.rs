//! One step of the Runge-Kutta-Nystrom method, for any number type.

use std::f64::consts::{FRAC_1_PI, PI};

use super::schedule::{Schedule, StageLoads};
use super::tableau::{A, B, BP, C, STAGES};
use crate::lanes::Real;
use crate::lanes::sine::Degree;
use crate::model::pendulum::conservative_load;

/// A trajectory within a schedule: the angle in half turns, and the velocity times the schedule's
/// `kick`.
#[derive(Clone, Copy, Debug)]
pub struct Moving<R> {
    /// The angle over pi.
    pub half_turns: R,
    /// `h_u th' / pi`.
    pub kick: R,
}

impl<R: Real> Moving<R> {
    /// From the angle in rad and the velocity.
    #[inline(always)]
    #[must_use]
    pub fn new(schedule: &Schedule, theta: R, velocity: R) -> Self {
        Self { half_turns: theta.scale(FRAC_1_PI), kick: velocity.scale(schedule.kick) }
    }

    /// The angle, rad.
    #[inline(always)]
    #[must_use]
    pub fn theta(&self) -> R {
        self.half_turns.scale(PI)
    }

    /// The velocity `th'`.
    #[inline(always)]
    #[must_use]
    pub fn velocity(&self, schedule: &Schedule) -> R {
        self.kick.scale(1.0 / schedule.kick)
    }

    /// One step.
    #[inline(always)]
    pub fn step<D: Degree>(&mut self, loads: &StageLoads, decay: f64) {
        let Self { half_turns, kick } = *self;
        let mut k =
            [conservative_load::<D, R>(loads.modulation[0], loads.torque[0], half_turns); STAGES];
        for i in 1..STAGES {
            let mut at = kick.scale_add(C[i], half_turns);
            for j in 0..i {
                if A[i][j] != 0.0 {
                    at = k[j].scale_add(A[i][j], at);
                }
            }
            k[i] = conservative_load::<D, R>(loads.modulation[i], loads.torque[i], at);
        }
        let mut position = half_turns + kick;
        let mut speed = kick;
        for i in 0..STAGES {
            if B[i] != 0.0 {
                position = k[i].scale_add(B[i], position);
            }
            if BP[i] != 0.0 {
                speed = k[i].scale_add(BP[i], speed);
            }
        }
        *self = Self { half_turns: position, kick: speed.scale(decay) };
    }

    /// All steps of the schedule.
    #[inline(always)]
    pub fn run<D: Degree>(&mut self, schedule: &Schedule) {
        for loads in schedule.steps() {
            self.step::<D>(loads, schedule.decay);
        }
    }
}
