//! One step of the Runge-Kutta method of order 8 for any number type: for torques that depend on
//! the velocity, and for steps of individual lengths.

use std::ops::Range;

use crate::integrate::dop853::{A, C, STAGES};
use crate::lanes::{Real, Work};
use crate::model::Pendulum;
use crate::model::equation::{Equation, Forcing};

/// The times of the stages of a step, and the drive at them.
pub trait Clock<R> {
    /// The drive at `stage`; `STAGES` is the end of the step.
    fn forcing(&self, equation: &Equation<R>, stage: usize) -> Forcing<R>;
    /// The length of the step.
    fn length(&self) -> R;
}

/// All trajectories at the same time.
#[derive(Clone, Copy, Debug)]
pub struct Shared<'a, R> {
    /// The drive at the stages and at the end.
    pub forcing: &'a [Forcing<f64>; STAGES + 1],
    /// The length of the step.
    pub length: R,
}

impl<R: Real> Clock<R> for Shared<'_, R> {
    #[inline(always)]
    fn forcing(&self, _: &Equation<R>, stage: usize) -> Forcing<R> {
        self.forcing[stage].like(self.length)
    }
    #[inline(always)]
    fn length(&self) -> R {
        self.length
    }
}

/// Each trajectory at its own time.
#[derive(Clone, Copy, Debug)]
pub struct Own<R> {
    /// The start of the step.
    pub begin: R,
    /// Its length.
    pub length: R,
}

impl<R: Real> Clock<R> for Own<R> {
    #[inline(always)]
    fn forcing(&self, equation: &Equation<R>, stage: usize) -> Forcing<R> {
        let part = if stage == STAGES { 1.0 } else { C[stage] };
        equation.forcing(self.length.scale_add(part, self.begin))
    }
    #[inline(always)]
    fn length(&self) -> R {
        self.length
    }
}

/// A state of the general method.
#[derive(Clone, Copy, Debug)]
pub struct Running<R> {
    /// Angle, rad.
    pub theta: R,
    /// Velocity.
    pub velocity: R,
}

/// All of a step except the acceleration at its end.
pub const STEP: Range<usize> = 0..STAGES;
/// All of a step, including it.
pub const WHOLE: Range<usize> = 0..STAGES + 1;

/// One step, or a part of it.
#[derive(Debug)]
pub struct Stepping<'a, R, K> {
    /// The equation of motion.
    pub equation: &'a Equation<R>,
    /// The times.
    pub clock: K,
    /// The sense of the motion and the side of a corner, held over the step.
    pub signs: [R; 2],
    /// [`STEP`] or [`WHOLE`].
    pub part: Range<usize>,
    /// The state at the begin, and then at the end.
    pub state: &'a mut Running<R>,
    /// Receives the accelerations at both ends.
    pub ends: &'a mut [R; 2],
    /// Buffer for velocities and accelerations at the stages.
    pub stages: &'a mut Stages<R>,
}

/// Velocities and accelerations at the stages of a step: kept from step to step, since to clear them
/// would take as long as a stage.
#[derive(Clone, Copy, Debug)]
pub struct Stages<R> {
    velocities: [R; STAGES],
    accelerations: [R; STAGES],
}

impl<R: Real> Stages<R> {
    /// In the shape of `number`.
    #[inline(always)]
    pub fn new(number: R) -> Self {
        Self { velocities: [number; STAGES], accelerations: [number; STAGES] }
    }
}

impl<R: Real, K: Clock<R>> Work for Stepping<'_, R, K> {
    // A loop over the stages, so that the formulas of the effects stand in it once; the table is
    // written out by a macro, since looked up it takes as long as the formulas.
    #[inline(always)]
    fn run(self) {
        let Self { equation, clock, signs, part, state, ends, stages } = self;
        let h = clock.length();
        let Running { theta: theta0, velocity: velocity0 } = *state;
        let Stages { velocities, accelerations } = stages;
        let (mut theta, mut velocity) = (theta0, velocity0);
        let mut i = part.start;
        while i < part.end {
            macro_rules! row {
                ($i:literal: $($j:literal)*) => {{
                    let change = velocities[0].scale(A[$i][0]);
                    let gain = accelerations[0].scale(A[$i][0]);
                    $(
                        let change = velocities[$j].scale_add(A[$i][$j], change);
                        let gain = accelerations[$j].scale_add(A[$i][$j], gain);
                    )*
                    theta = change.mul_add(h, theta0);
                    velocity = gain.mul_add(h, velocity0);
                }};
            }
            match i {
                1 => row!(1:),
                2 => row!(2: 1),
                3 => row!(3: 2),
                4 => row!(4: 2 3),
                5 => row!(5: 3 4),
                6 => row!(6: 3 4 5),
                7 => row!(7: 3 4 5 6),
                8 => row!(8: 3 4 5 6 7),
                9 => row!(9: 3 4 5 6 7 8),
                10 => row!(10: 3 4 5 6 7 8 9),
                11 => row!(11: 3 4 5 6 7 8 9 10),
                _ => {}
            }
            let forcing = clock.forcing(equation, i);
            let at = equation.point_held(&forcing, theta, velocity, signs);
            let acceleration = equation.acceleration(&forcing, &at);
            if i == STAGES {
                ends[1] = acceleration;
                return;
            }
            velocities[i] = velocity;
            accelerations[i] = acceleration;
            i += 1;
            if i == STAGES {
                // The thirteenth row contains the weights.
                row!(12: 5 6 7 8 9 10 11);
                *state = Running { theta, velocity };
                ends[0] = accelerations[0];
            }
        }
    }
}

/// The drive at every stage of every step of one forcing period.
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
