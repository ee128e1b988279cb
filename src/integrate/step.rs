//! One step of the Runge-Kutta-Nystrom method, for any number type.

use super::schedule::{Schedule, StageLoads};
use super::tableau::{A, B, BP, C, STAGES};
use crate::lanes::Real;
use crate::lanes::sine::Degree;
use crate::model::pendulum::conservative_load;

/// A trajectory within a schedule: the angle, and the velocity times the schedule's `kick`.
#[derive(Clone, Copy, Debug)]
pub struct Moving<R> {
    /// The angle, rad.
    pub theta: R,
    /// `h_u th'`.
    pub kick: R,
}

impl<R: Real> Moving<R> {
    /// From angle and velocity.
    #[inline(always)]
    #[must_use]
    pub fn new(schedule: &Schedule, theta: R, velocity: R) -> Self {
        Self { theta, kick: velocity.scale(schedule.kick) }
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
        let Self { theta, kick } = *self;
        let mut k =
            [conservative_load::<D, R>(loads.modulation[0], loads.torque[0], theta); STAGES];
        for i in 1..STAGES {
            let mut at = kick.scale_add(C[i], theta);
            for j in 0..i {
                if A[i][j] != 0.0 {
                    at = k[j].scale_add(A[i][j], at);
                }
            }
            k[i] = conservative_load::<D, R>(loads.modulation[i], loads.torque[i], at);
        }
        let mut position = theta + kick;
        let mut speed = kick;
        for i in 0..STAGES {
            if B[i] != 0.0 {
                position = k[i].scale_add(B[i], position);
            }
            if BP[i] != 0.0 {
                speed = k[i].scale_add(BP[i], speed);
            }
        }
        *self = Self { theta: position, kick: speed.scale(decay) };
    }

    /// All steps of the schedule.
    #[inline(always)]
    pub fn run<D: Degree>(&mut self, schedule: &Schedule) {
        for loads in schedule.steps() {
            self.step::<D>(loads, schedule.decay);
        }
    }
}
