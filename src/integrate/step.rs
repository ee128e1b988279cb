//! One step of the Runge-Kutta-Nystrom method, for any number type.

use std::f64::consts::{FRAC_1_PI, PI};

use super::schedule::{Schedule, StageLoads};
use super::tableau::{A, B, BP, C, STAGES};
use crate::lanes::Real;
use crate::lanes::sine::Degree;
use crate::model::equation::conservative_load;

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
        let mut k = [half_turns; STAGES];
        // Written out by a macro: as a loop over the stages the compiler keeps it a loop, looks the
        // coefficients up and branches on their zeros.
        macro_rules! stage {
            ($i:literal: $($j:literal)*) => {
                let at = if C[$i] == 0.0 { half_turns } else { kick.scale_add(C[$i], half_turns) };
                $(let at = if A[$i][$j] == 0.0 { at } else { k[$j].scale_add(A[$i][$j], at) };)*
                k[$i] = conservative_load::<D, R>(loads.modulation[$i], loads.torque[$i], at);
            };
        }
        stage!(0:);
        stage!(1: 0);
        stage!(2: 0 1);
        stage!(3: 0 1 2);
        stage!(4: 0 1 2 3);
        stage!(5: 0 1 2 3 4);
        stage!(6: 0 1 2 3 4 5);
        stage!(7: 0 1 2 3 4 5 6);
        let mut position = half_turns + kick;
        let mut speed = kick;
        macro_rules! weigh {
            ($($i:literal)*) => {$(
                position = if B[$i] == 0.0 { position } else { k[$i].scale_add(B[$i], position) };
                speed = if BP[$i] == 0.0 { speed } else { k[$i].scale_add(BP[$i], speed) };
            )*};
        }
        weigh!(0 1 2 3 4 5 6 7);
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
