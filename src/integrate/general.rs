//! One step of the Runge-Kutta method of order 8 for any number type: for torques that depend on the
//! velocity, and for steps of a length that each trajectory has for itself.

use std::ops::Range;

use super::dop853::{A, B, C, STAGES};
use crate::lanes::{Real, Work};
use crate::model::Pendulum;
use crate::model::equation::{Equation, Forcing};

/// When the stages of a step are, and how long it is.
#[derive(Clone, Copy, Debug)]
pub enum Clock<'a, R> {
    /// Every trajectory at the same time: what the drive does at the stages and at the end.
    Shared(&'a [Forcing<f64>; STAGES + 1], R),
    /// Each at its own: when the step begins.
    Own(R, R),
}

impl<R: Real> Clock<'_, R> {
    /// The length of the step.
    #[inline(always)]
    fn length(&self) -> R {
        match self {
            Self::Shared(_, length) | Self::Own(_, length) => *length,
        }
    }

    /// What the drive does at `stage`; `STAGES` is the step's end.
    #[inline(always)]
    fn forcing(&self, equation: &Equation<R>, stage: usize) -> Forcing<R> {
        match self {
            Self::Shared(forcing, length) => forcing[stage].like(*length),
            Self::Own(begin, length) => {
                let part = if stage == STAGES { 1.0 } else { C[stage] };
                equation.forcing(length.scale_add(part, *begin))
            }
        }
    }
}

/// A state of the general path.
#[derive(Clone, Copy, Debug)]
pub struct Running<R> {
    /// Angle, rad.
    pub theta: R,
    /// Velocity.
    pub velocity: R,
}

/// All of a step but the acceleration at its end.
pub const STEP: Range<usize> = 0..STAGES;
/// The acceleration at the end alone, of a step that was taken.
pub const END: Range<usize> = STAGES..STAGES + 1;
/// Both.
pub const WHOLE: Range<usize> = 0..STAGES + 1;

/// One step, or a part of it.
#[derive(Debug)]
pub struct Stepping<'a, R> {
    /// The equation of motion.
    pub equation: &'a Equation<R>,
    /// The times.
    pub clock: Clock<'a, R>,
    /// The sense of the motion, held over the step.
    pub sense: R,
    /// [`STEP`], [`END`] or [`WHOLE`].
    pub part: Range<usize>,
    /// The state at the begin, and then at the end.
    pub state: &'a mut Running<R>,
    /// Takes the accelerations at begin and end.
    pub ends: &'a mut [R; 2],
}

impl<R: Real> Work for Stepping<'_, R> {
    // The formulas of the effects stand here once, in a loop over the stages.
    #[inline(always)]
    fn run(self) {
        let Self { equation, clock, sense, part, state, ends } = self;
        let zero = sense.like(0.0);
        let h = clock.length();
        let mut velocities = [zero; STAGES];
        let mut accelerations = [zero; STAGES];
        let mut i = part.start;
        while i < part.end {
            let mut now = *state;
            if i < STAGES {
                let (mut way, mut gain) = (zero, zero);
                let mut j = 0;
                while j < i {
                    if A[i][j] != 0.0 {
                        way = velocities[j].scale_add(A[i][j], way);
                        gain = accelerations[j].scale_add(A[i][j], gain);
                    }
                    j += 1;
                }
                now.theta = way * h + state.theta;
                now.velocity = gain * h + state.velocity;
            }
            let forcing = clock.forcing(equation, i);
            let at = equation.point(&forcing, now.theta, now.velocity, sense);
            let acceleration = equation.acceleration(&forcing, &at);
            if i == STAGES {
                ends[1] = acceleration;
                return;
            }
            velocities[i] = now.velocity;
            accelerations[i] = acceleration;
            i += 1;
            if i == STAGES {
                let (mut way, mut gain) = (zero, zero);
                let mut j = 0;
                while j < STAGES {
                    if B[j] != 0.0 {
                        way = velocities[j].scale_add(B[j], way);
                        gain = accelerations[j].scale_add(B[j], gain);
                    }
                    j += 1;
                }
                state.theta = way * h + state.theta;
                state.velocity = gain * h + state.velocity;
                ends[0] = accelerations[0];
            }
        }
    }
}

/// What the drive does at every stage of every step of one forcing period.
#[derive(Clone, Debug)]
pub struct Timetable {
    steps: Vec<[Forcing<f64>; STAGES + 1]>,
    /// The length of a step.
    pub length: f64,
}

impl Timetable {
    /// `steps` equal steps over the forcing period that starts at `tau = 0`.
    #[must_use]
    pub fn new(pendulum: &Pendulum, steps: usize) -> Self {
        let equation = pendulum.equation();
        let length = pendulum.period() / steps as f64;
        let at = |k: usize, i: usize| {
            let part = if i == STAGES { 1.0 } else { C[i] };
            equation.forcing(pendulum.period() * (k as f64 + part) / steps as f64)
        };
        let steps = (0..steps).map(|k| std::array::from_fn(|i| at(k, i))).collect();
        Self { steps, length }
    }

    /// The steps, in order.
    #[must_use]
    pub fn steps(&self) -> &[[Forcing<f64>; STAGES + 1]] {
        &self.steps
    }
}
