//! One step of the Runge-Kutta method of order 8, its error and the curve between its ends.
//!
//! Hairer, Norsett & Wanner (1993), Solving Ordinary Differential Equations I, section II.10;
//! coefficients in [`super::dop853`].

use std::ops::Range;

use super::course::Field;
use super::dop853::{A, ALL_STAGES, C, D, E3, E5, STAGES};
use super::tangent::Number;
use crate::lanes::Work;

/// A step from one time to another with the sense of the motion and the side of a corner held, so that
/// the equation is analytic even where the velocity or the switching function passes zero.
#[derive(Clone, Copy, Debug)]
pub struct Leap<N> {
    /// Where it starts.
    pub tau: f64,
    /// How long it is.
    pub length: f64,
    /// The sense and the side held: 1 or -1.
    pub signs: [f64; 2],
    /// The angle of the last turn, and what an effect and the sensor's play kept there.
    pub past: [N; 3],
    /// Angle and velocity at its start.
    pub start: [N; 2],
    /// Angle and velocity at its end.
    pub end: [N; 2],
    velocity: [N; ALL_STAGES],
    acceleration: [N; ALL_STAGES],
}

impl<N: Number> Leap<N> {
    /// No step yet, at `start`, where the motion begins.
    #[must_use]
    pub fn none(start: [N; 2]) -> Self {
        let none = [start[0].like(0.0); ALL_STAGES];
        let (tau, length, signs) = (0.0, 0.0, [1.0; 2]);
        let zero = start[0].like(0.0);
        let past = [start[0], zero, zero];
        Self { tau, length, signs, past, start, end: start, velocity: none, acceleration: none }
    }

    /// The step of `length` from `start` at `tau`, where the acceleration is `first`.
    #[must_use]
    pub fn new(
        field: &Field<N>,
        tau: f64,
        start: [N; 2],
        first: N,
        signs: [f64; 2],
        length: f64,
    ) -> Self {
        let mut leap = Self::none(start);
        leap.take(field, tau, start, first, signs, length);
        leap
    }

    /// Becomes that step.
    pub fn take(
        &mut self,
        field: &Field<N>,
        tau: f64,
        start: [N; 2],
        first: N,
        signs: [f64; 2],
        length: f64,
    ) {
        (self.tau, self.start, self.signs) = (tau, start, signs);
        self.velocity[0] = start[1];
        self.acceleration[0] = first;
        self.shorten(field, length);
    }

    /// Becomes the step from the same start with another length.
    pub fn shorten(&mut self, field: &Field<N>, length: f64) {
        self.length = length;
        // The thirteenth stage stands at the new point.
        self.fill(field, 1..STAGES + 1);
    }

    /// The step without its derivatives.
    #[must_use]
    pub fn values(&self) -> Leap<f64> {
        Leap {
            tau: self.tau,
            length: self.length,
            signs: self.signs,
            past: self.past.map(N::value),
            start: self.start.map(N::value),
            end: self.end.map(N::value),
            velocity: self.velocity.map(N::value),
            acceleration: self.acceleration.map(N::value),
        }
    }

    /// Fills stages: the one place where the formulas stand in a loop.
    #[inline(never)]
    fn fill(&mut self, field: &Field<N>, stages: Range<usize>) {
        self.start[0].aside(Filling { leap: self, field, stages });
    }

    /// Fills stage `i`.
    #[inline(always)]
    fn stage(&mut self, field: &Field<N>, i: usize) {
        let [mut turned, mut gained] = [self.start[0].like(0.0); 2];
        let mut j = 0;
        while j < i {
            let weight = A[i][j];
            // Half of the table is empty.
            if weight != 0.0 {
                turned = self.velocity[j].scale_add(weight, turned);
                gained = self.acceleration[j].scale_add(weight, gained);
            }
            j += 1;
        }
        let theta = turned.scale_add(self.length, self.start[0]);
        let velocity = gained.scale_add(self.length, self.start[1]);
        let tau = self.tau + C[i] * self.length;
        self.velocity[i] = velocity;
        self.acceleration[i] = field.at(tau, [theta, velocity], self.signs, self.past);
        if i == STAGES {
            self.end = [theta, velocity];
        }
    }

    /// The acceleration at the end.
    #[must_use]
    pub fn last(&self) -> N {
        self.acceleration[STAGES]
    }

    /// The acceleration at the start.
    #[must_use]
    pub fn first(&self) -> N {
        self.acceleration[0]
    }

    /// The error estimated, over what `tolerance` allows: that much in the angle, and in the
    /// velocity that much times the speed where it is above 1.
    #[must_use]
    pub fn error(&self, tolerance: f64) -> f64 {
        let speed = self.start[1].value().abs().max(self.end[1].value().abs());
        let allowed = [tolerance, tolerance * speed.max(1.0)];
        let mut squares = [0.0; 2];
        for (weights, square) in [E5, E3].iter().zip(&mut squares) {
            for (slopes, allowed) in [&self.velocity, &self.acceleration].into_iter().zip(allowed) {
                let sum: f64 = weights.iter().zip(slopes).map(|(w, k)| w * k.value()).sum();
                *square += (sum / allowed).powi(2);
            }
        }
        let [fifth, third] = squares;
        if fifth == 0.0 {
            return 0.0;
        }
        self.length.abs() * fifth / (2.0 * (fifth + 0.01 * third)).sqrt()
    }

    /// Whether the velocity clearly keeps its sense, by the greatest acceleration of the stages.
    #[must_use]
    pub fn surely_keeps_sense(&self) -> bool {
        let greatest =
            self.acceleration[..=STAGES].iter().fold(0_f64, |most, a| most.max(a.value().abs()));
        // From either end the velocity falls no faster than that.
        let ends = self.signs[0] * (self.start[1].value() + self.end[1].value());
        ends > 1.2 * self.length * greatest
    }

    /// The curve between the ends, of order 7.
    #[must_use]
    pub fn curve(&mut self, field: &Field<N>) -> Curve<N> {
        let mut curve = Curve::none(self.start);
        self.trace(field, &mut curve);
        curve
    }

    /// The same into a curve that there is.
    pub fn trace(&mut self, field: &Field<N>, curve: &mut Curve<N>) {
        (curve.tau, curve.length) = (self.tau, self.length);
        (curve.theta[0], curve.velocity[0]) = (self.start[0], self.start[1]);
        self.fill(field, STAGES + 1..ALL_STAGES);
        self.start[0].aside(Curving { leap: self, curve });
    }

    #[inline(always)]
    fn coefficients(&self, of: usize, slopes: &[N; ALL_STAGES], all: &mut [N; 8]) {
        let gain = self.end[of] - self.start[of];
        let (first, last) = (slopes[0].scale(self.length), slopes[STAGES].scale(self.length));
        all[1] = gain;
        all[2] = first - gain;
        all[3] = gain.scale(2.0) - (last + first);
        let mut k = 0;
        while k < D.len() {
            let mut sum = gain.like(0.0);
            let mut j = 0;
            while j < ALL_STAGES {
                sum = slopes[j].scale_add(D[k][j], sum);
                j += 1;
            }
            all[4 + k] = sum.scale(self.length);
            k += 1;
        }
    }
}

/// Stages of a step.
struct Filling<'a, N> {
    leap: &'a mut Leap<N>,
    field: &'a Field<N>,
    stages: Range<usize>,
}

impl<N: Number> Work for Filling<'_, N> {
    #[inline(always)]
    fn run(self) {
        let mut i = self.stages.start;
        while i < self.stages.end {
            self.leap.stage(self.field, i);
            i += 1;
        }
    }
}

/// The coefficients of a curve.
struct Curving<'a, N> {
    leap: &'a Leap<N>,
    curve: &'a mut Curve<N>,
}

impl<N: Number> Work for Curving<'_, N> {
    #[inline(always)]
    fn run(self) {
        let Self { leap, curve } = self;
        leap.coefficients(0, &leap.velocity, &mut curve.theta);
        leap.coefficients(1, &leap.acceleration, &mut curve.velocity);
    }
}

/// Angle and velocity over a step: with `x` the part of the step that has passed,
/// `c0 + x (c1 + (1 - x) (c2 + x (c3 + (1 - x) (c4 + ...))))`.
#[derive(Clone, Copy, Debug)]
pub struct Curve<N> {
    tau: f64,
    length: f64,
    theta: [N; 8],
    /// The coefficients of the velocity.
    pub velocity: [N; 8],
}

impl<N: Number> Curve<N> {
    /// No curve yet.
    #[must_use]
    pub fn none([theta, velocity]: [N; 2]) -> Self {
        Self { tau: 0.0, length: 0.0, theta: [theta; 8], velocity: [velocity; 8] }
    }

    /// Angle and velocity at time `tau` of the step.
    #[must_use]
    pub fn at(&self, tau: f64) -> [N; 2] {
        let mut state = [self.theta[7], self.velocity[7]];
        let part = (tau - self.tau) / self.length;
        self.theta[0].aside(Summing { curve: self, part, state: &mut state });
        state
    }
}

/// The values of a curve at a part of its step.
struct Summing<'a, N> {
    curve: &'a Curve<N>,
    part: f64,
    state: &'a mut [N; 2],
}

impl<N: Number> Work for Summing<'_, N> {
    #[inline(always)]
    fn run(self) {
        let Self { curve, part, state } = self;
        let mut k = 7;
        while k > 0 {
            k -= 1;
            let factor = if k % 2 == 0 { part } else { 1.0 - part };
            state[0] = state[0].scale_add(factor, curve.theta[k]);
            state[1] = state[1].scale_add(factor, curve.velocity[k]);
        }
    }
}
