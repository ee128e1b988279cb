//! One step of the Runge-Kutta method of order 8, its error and the curve between its ends.
//!
//! Hairer, Norsett & Wanner (1993), Solving Ordinary Differential Equations I, section II.10;
//! coefficients in [`super::dop853`].

use super::course::Field;
use super::dop853::{A, ALL_STAGES, C, D, E3, E5, STAGES};
use super::tangent::Number;

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
    /// Angle and velocity at its start.
    pub start: [N; 2],
    /// Angle and velocity at its end.
    pub end: [N; 2],
    velocity: [N; ALL_STAGES],
    acceleration: [N; ALL_STAGES],
}

impl<N: Number> Leap<N> {
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
        let zero = first.like(0.0);
        let mut leap = Self {
            tau,
            length,
            signs,
            start,
            end: start,
            velocity: [zero; ALL_STAGES],
            acceleration: [zero; ALL_STAGES],
        };
        leap.velocity[0] = start[1];
        leap.acceleration[0] = first;
        for i in 1..STAGES {
            leap.stage(field, i);
        }
        // The thirteenth stage stands at the new point.
        leap.end = leap.stage(field, STAGES);
        leap
    }

    /// The step without its derivatives.
    #[must_use]
    pub fn values(&self) -> Leap<f64> {
        Leap {
            tau: self.tau,
            length: self.length,
            signs: self.signs,
            start: self.start.map(N::value),
            end: self.end.map(N::value),
            velocity: self.velocity.map(N::value),
            acceleration: self.acceleration.map(N::value),
        }
    }

    /// The step from the same start with another length.
    #[must_use]
    pub fn shortened(&self, field: &Field<N>, length: f64) -> Self {
        Self::new(field, self.tau, self.start, self.first(), self.signs, length)
    }

    /// Fills stage `i` and returns its angle and velocity.
    #[inline]
    fn stage(&mut self, field: &Field<N>, i: usize) -> [N; 2] {
        let [mut turned, mut gained] = [self.start[0].like(0.0); 2];
        for (j, weight) in A[i].iter().enumerate().take(i) {
            // Half of the table is empty.
            if *weight != 0.0 {
                turned = self.velocity[j].scale_add(*weight, turned);
                gained = self.acceleration[j].scale_add(*weight, gained);
            }
        }
        let theta = turned.scale_add(self.length, self.start[0]);
        let velocity = gained.scale_add(self.length, self.start[1]);
        let tau = self.tau + C[i] * self.length;
        self.velocity[i] = velocity;
        self.acceleration[i] = field.acceleration(tau, theta, velocity, self.signs);
        [theta, velocity]
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
        for i in STAGES + 1..ALL_STAGES {
            self.stage(field, i);
        }
        Curve {
            tau: self.tau,
            length: self.length,
            theta: self.coefficients(0, &self.velocity),
            velocity: self.coefficients(1, &self.acceleration),
        }
    }

    fn coefficients(&self, of: usize, slopes: &[N; ALL_STAGES]) -> [N; 8] {
        let gain = self.end[of] - self.start[of];
        let (first, last) = (slopes[0].scale(self.length), slopes[STAGES].scale(self.length));
        let mut all = [self.start[of]; 8];
        all[1] = gain;
        all[2] = first - gain;
        all[3] = gain.scale(2.0) - (last + first);
        for (coefficient, weights) in all[4..].iter_mut().zip(&D) {
            let mut sum = gain.like(0.0);
            for (weight, slope) in weights.iter().zip(slopes) {
                sum = slope.scale_add(*weight, sum);
            }
            *coefficient = sum.scale(self.length);
        }
        all
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
    /// Angle and velocity at time `tau` of the step.
    #[must_use]
    pub fn at(&self, tau: f64) -> [N; 2] {
        let part = (tau - self.tau) / self.length;
        [&self.theta, &self.velocity].map(|coefficients| {
            let mut sum = coefficients[7];
            for k in (0..7).rev() {
                let factor = if k % 2 == 0 { part } else { 1.0 - part };
                sum = sum.scale_add(factor, coefficients[k]);
            }
            sum
        })
    }
}
