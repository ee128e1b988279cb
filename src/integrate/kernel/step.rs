//! One step of the Runge-Kutta-Nystrom method, for any number type.

use std::f64::consts::{FRAC_1_PI, PI};

use super::schedule::{Schedule, StageLoads};
use super::tableau::{A, B, BP, C, STAGES};
use crate::lanes::Real;
use crate::lanes::sine::{Degree, Fine};
use crate::model::equation::{Equation, conservative_load};

/// A trajectory within a schedule: the angle in half turns, and the velocity times the schedule's
/// `kick`.
#[derive(Clone, Copy, Debug)]
pub struct Moving<R> {
    /// The angle over pi.
    pub half_turns: R,
    /// `h_u th' / pi`.
    pub kick: R,
}

/// The load in addition to gravity, drive, constant torque and viscous damping.
pub trait Extra<R> {
    /// `load` with it added, at a stage.
    fn on(&self, loads: &StageLoads, stage: usize, load: R) -> R;
}

/// No further load.
#[derive(Clone, Copy, Debug)]
pub struct Nothing;

impl<R: Real> Extra<R> for Nothing {
    #[inline(always)]
    fn on(&self, _: &StageLoads, _: usize, load: R) -> R {
        load
    }
}

/// Coulomb friction with the sense of the motion held over the step.
#[derive(Clone, Copy, Debug)]
pub struct Rubbing<R>(
    /// `-theta_r` times the sense, 1 or -1.
    pub R,
);

impl<R: Real> Extra<R> for Rubbing<R> {
    #[inline(always)]
    fn on(&self, loads: &StageLoads, stage: usize, load: R) -> R {
        self.0.scale_add(loads.factor[stage], load)
    }
}

impl<R: Real> Moving<R> {
    /// The state of an angle in rad and a velocity.
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

    /// One step under gravity, drive, constant torque and viscous damping.
    #[inline(always)]
    pub fn step<D: Degree>(&mut self, loads: &StageLoads, decay: f64) {
        self.step_with::<D, Nothing>(loads, decay, &Nothing);
    }

    /// One step with the load `extra` added; the first and the last stage's load times `factor`:
    /// those at the step's ends.
    #[inline(always)]
    pub fn step_with<D: Degree, X: Extra<R>>(
        &mut self,
        loads: &StageLoads,
        decay: f64,
        extra: &X,
    ) -> [R; 2] {
        let Self { half_turns, kick } = *self;
        let mut k = [half_turns; STAGES];
        // Written out by a macro: the compiler keeps a loop over the stages, looks the coefficients
        // up and branches on their zeros.
        macro_rules! stage {
            ($i:literal: $($j:literal)*) => {
                let at = if C[$i] == 0.0 { half_turns } else { kick.scale_add(C[$i], half_turns) };
                $(let at = if A[$i][$j] == 0.0 { at } else { k[$j].scale_add(A[$i][$j], at) };)*
                let load = conservative_load::<D, R>(loads.modulation[$i], loads.torque[$i], at);
                k[$i] = extra.on(loads, $i, load);
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
        [k[0], k[STAGES - 1]]
    }

    /// One step under all loads, if none depends on the velocity except on its sense, 1 or -1,
    /// which is held. Returns the result of [`Moving::step_with`].
    ///
    /// A loop over the stages, so that the effects' formulas are compiled once.
    #[inline(always)]
    pub fn step_under(
        &mut self,
        equation: &Equation<R>,
        loads: &StageLoads,
        decay: f64,
        sense: R,
    ) -> [R; 2] {
        let Self { half_turns, kick } = *self;
        let standing = sense.like(0.0);
        let mut k = [standing; STAGES];
        let mut i = 0;
        while i < STAGES {
            let mut at = kick.scale_add(C[i], half_turns);
            let mut j = 0;
            while j < i {
                at = k[j].scale_add(A[i][j], at);
                j += 1;
            }
            let forcing = loads.forcing[i].like(half_turns);
            let point = equation.point_held(&forcing, at.scale(PI), standing, [sense; 2]);
            let load = conservative_load::<Fine, R>(loads.modulation[i], loads.torque[i], at);
            let rest = equation.besides(&forcing, &point);
            k[i] = rest.scale_add(loads.factor[i], load);
            i += 1;
        }
        let (mut position, mut speed) = (half_turns + kick, kick);
        let mut i = 0;
        while i < STAGES {
            position = k[i].scale_add(B[i], position);
            speed = k[i].scale_add(BP[i], speed);
            i += 1;
        }
        *self = Self { half_turns: position, kick: speed.scale(decay) };
        [k[0], k[STAGES - 1]]
    }

    /// All steps of the schedule.
    #[inline(always)]
    pub fn run<D: Degree>(&mut self, schedule: &Schedule) {
        for loads in schedule.steps() {
            self.step::<D>(loads, schedule.decay);
        }
    }
}
