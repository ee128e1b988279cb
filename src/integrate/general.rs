//! One step of the Runge-Kutta method of order 8 for any number type: for torques that depend on the
//! velocity, and for steps of a length that each trajectory has for itself.

use super::dop853::{A, B, C, STAGES};
use crate::lanes::Real;
use crate::model::Pendulum;
use crate::model::equation::{Equation, Forcing};

/// When the stages of a step are, and what the drive then does.
pub trait Clock<R> {
    /// What the drive does at `stage`; `STAGES` is the step's end.
    fn forcing(&self, equation: &Equation<R>, stage: usize) -> Forcing<R>;
    /// The length of the step.
    fn length(&self) -> R;
}

/// Every trajectory at the same time.
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
    /// When the step begins.
    pub begin: R,
    /// How long it is.
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

/// A state of the general path, with the acceleration where it has been evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Running<R> {
    /// Angle, rad.
    pub theta: R,
    /// Velocity.
    pub velocity: R,
}

impl<R: Real> Running<R> {
    /// One step in the sense `sense`; the acceleration at its begin.
    #[inline(always)]
    pub fn step<K: Clock<R>>(&mut self, equation: &Equation<R>, clock: &K, sense: R) -> R {
        let zero = sense.like(0.0);
        let h = clock.length();
        let mut velocities = [zero; STAGES];
        let mut accelerations = [zero; STAGES];
        let mut i = 0;
        while i < STAGES {
            let (mut way, mut gain) = (zero, zero);
            let mut j = 0;
            while j < i {
                if A[i][j] != 0.0 {
                    way = velocities[j].scale_add(A[i][j], way);
                    gain = accelerations[j].scale_add(A[i][j], gain);
                }
                j += 1;
            }
            let theta = way * h + self.theta;
            let velocity = gain * h + self.velocity;
            let forcing = clock.forcing(equation, i);
            let at = equation.point(&forcing, theta, velocity, sense);
            velocities[i] = velocity;
            accelerations[i] = equation.acceleration(&forcing, &at);
            i += 1;
        }
        let (mut way, mut gain) = (zero, zero);
        let mut j = 0;
        while j < STAGES {
            if B[j] != 0.0 {
                way = velocities[j].scale_add(B[j], way);
                gain = accelerations[j].scale_add(B[j], gain);
            }
            j += 1;
        }
        self.theta = way * h + self.theta;
        self.velocity = gain * h + self.velocity;
        accelerations[0]
    }

    /// The acceleration at the end of a step.
    #[inline(always)]
    pub fn acceleration<K: Clock<R>>(&self, equation: &Equation<R>, clock: &K, sense: R) -> R {
        let forcing = clock.forcing(equation, STAGES);
        let at = equation.point(&forcing, self.theta, self.velocity, sense);
        equation.acceleration(&forcing, &at)
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
