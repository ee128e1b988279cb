//! One step of the Runge-Kutta method of order 8, its error and its interpolant.
//!
//! Hairer, Norsett & Wanner (1993), Solving Ordinary Differential Equations I, section II.10;
//! coefficients in [`crate::integrate::dop853`].

use std::ops::Range;

use super::problem::{Field, Past};
use super::rig_mode::Sway;
use crate::integrate::dop853::{A, ALL_STAGES, C, D, E3, E5, STAGES};
use crate::integrate::tangent::Number;
use crate::lanes::Work;

/// A step from one time to another with the sense of the motion and the side of a corner held, so that
/// the equation is analytic even where the velocity or the switching function passes zero.
#[derive(Clone, Debug)]
pub struct DenseStep<N> {
    /// Time of its start.
    pub tau: f64,
    /// Its length.
    pub length: f64,
    /// The sense and the side held: 1 or -1.
    pub signs: [f64; 2],
    /// Memories at its start.
    pub past: Past<N>,
    /// Angle and velocity at its start.
    pub start: [N; 2],
    /// Angle and velocity at its end.
    pub end: [N; 2],
    velocity: [N; ALL_STAGES],
    acceleration: [N; ALL_STAGES],
    /// The mode of the rig, if the model has one.
    pub sway: Option<Box<Sway<N>>>,
}

impl<N: Number> DenseStep<N> {
    /// No step yet, at `start`, where the motion begins.
    #[must_use]
    pub fn none(start: [N; 2]) -> Self {
        let none = [start[0].like(0.0); ALL_STAGES];
        let (tau, length, signs) = (0.0, 0.0, [1.0; 2]);
        let zero = start[0].like(0.0);
        let past = [start[0], zero, zero, zero, zero];
        let (velocity, acceleration, sway) = (none, none, None);
        Self { tau, length, signs, past, start, end: start, velocity, acceleration, sway }
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
        let mut dense = Self::none(start);
        dense.take(field, tau, start, first, signs, length);
        dense
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
        if field.sways() {
            let sway = self.sway.get_or_insert_with(|| Box::new(Sway::none(first)));
            sway.keep(0, field.sway(start, self.past));
        }
        self.shorten(field, length);
    }

    /// Becomes the step from the same start with another length.
    pub fn shorten(&mut self, field: &Field<N>, length: f64) {
        self.length = length;
        // The thirteenth stage is at the new point.
        self.fill(field, 1..STAGES + 1);
    }

    /// The step without its derivatives.
    #[must_use]
    pub fn values(&self) -> DenseStep<f64> {
        DenseStep {
            tau: self.tau,
            length: self.length,
            signs: self.signs,
            past: self.past.map(N::value),
            start: self.start.map(N::value),
            end: self.end.map(N::value),
            velocity: self.velocity.map(N::value),
            acceleration: self.acceleration.map(N::value),
            sway: self.sway.as_ref().map(|sway| Box::new(sway.values())),
        }
    }

    /// Evaluates stages: the only loop that contains the formulas.
    #[inline(never)]
    fn fill(&mut self, field: &Field<N>, stages: Range<usize>) {
        self.start[0].aside(Filling { dense: self, field, stages });
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
        let mut past = self.past;
        if let Some(sway) = &mut self.sway {
            [past[3], past[4]] = sway.stage(i, self.length, [past[3], past[4]]);
            sway.keep(i, field.sway([theta, velocity], past));
        }
        self.acceleration[i] = field.at(tau, [theta, velocity], self.signs, past);
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

    /// The estimated error over the tolerance, which applies to the angle, and to the velocity
    /// times the speed if that is above 1.
    #[must_use]
    pub fn error(&self, tolerance: f64) -> f64 {
        let speed = self.start[1].value().abs().max(self.end[1].value().abs());
        let allowed = [tolerance, tolerance * speed.max(1.0)];
        let mut squares = [0.0; 2];
        for (weights, square) in [E5, E3].iter().zip(&mut squares) {
            let own = [&self.velocity, &self.acceleration].into_iter();
            // For a mode of the rig alike: its effect on the angle is no larger.
            let all = own.chain(self.sway.iter().flat_map(|sway| &sway.slopes));
            for (slopes, allowed) in all.zip(allowed.into_iter().cycle()) {
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
        // From either end the velocity falls no faster than this.
        let ends = self.signs[0] * (self.start[1].value() + self.end[1].value());
        ends > 1.2 * self.length * greatest
    }

    /// The interpolant, of order 7.
    #[must_use]
    pub fn curve(&mut self, field: &Field<N>) -> Curve<N> {
        let mut curve = Curve::none(self.start);
        self.trace(field, &mut curve);
        curve
    }

    /// The interpolant of the step, written into `curve`.
    pub fn trace(&mut self, field: &Field<N>, curve: &mut Curve<N>) {
        (curve.tau, curve.length) = (self.tau, self.length);
        (curve.theta[0], curve.velocity[0]) = (self.start[0], self.start[1]);
        if self.sway.is_some() {
            let all = curve.sway.get_or_insert_with(|| Box::new([[self.start[0]; 8]; 2]));
            (all[0][0], all[1][0]) = (self.past[3], self.past[4]);
        }
        self.fill(field, STAGES + 1..ALL_STAGES);
        self.start[0].aside(Curving { dense: self, curve });
    }
}

/// The coefficients of an interpolant with this increase over a step of that length.
#[inline(always)]
fn coefficients<N: Number>(gain: N, length: f64, slopes: &[N; ALL_STAGES], all: &mut [N; 8]) {
    let (first, last) = (slopes[0].scale(length), slopes[STAGES].scale(length));
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
        all[4 + k] = sum.scale(length);
        k += 1;
    }
}

/// Stages of a step.
struct Filling<'a, N> {
    dense: &'a mut DenseStep<N>,
    field: &'a Field<N>,
    stages: Range<usize>,
}

impl<N: Number> Work for Filling<'_, N> {
    #[inline(always)]
    fn run(self) {
        let mut i = self.stages.start;
        while i < self.stages.end {
            self.dense.stage(self.field, i);
            i += 1;
        }
    }
}

/// The coefficients of a curve.
struct Curving<'a, N> {
    dense: &'a DenseStep<N>,
    curve: &'a mut Curve<N>,
}

impl<N: Number> Work for Curving<'_, N> {
    #[inline(always)]
    fn run(self) {
        let Self { dense, curve } = self;
        let (start, end, length) = (dense.start, dense.end, dense.length);
        coefficients(end[0] - start[0], length, &dense.velocity, &mut curve.theta);
        coefficients(end[1] - start[1], length, &dense.acceleration, &mut curve.velocity);
        if let (Some(sway), Some(all)) = (&dense.sway, &mut curve.sway) {
            let mut of = 0;
            while of < 2 {
                let gain = sway.end[of] - dense.past[3 + of];
                coefficients(gain, length, &sway.slopes[of], &mut all[of]);
                of += 1;
            }
        }
    }
}

/// Angle and velocity over a step: with `x` the part of the step that has passed,
/// `c0 + x (c1 + (1 - x) (c2 + x (c3 + (1 - x) (c4 + ...))))`.
#[derive(Clone, Debug)]
pub struct Curve<N> {
    tau: f64,
    length: f64,
    theta: [N; 8],
    /// The coefficients of the velocity.
    pub velocity: [N; 8],
    /// The polynomials of displacement and momentum of a mode of the rig.
    sway: Option<Box<[[N; 8]; 2]>>,
}

impl<N: Number> Curve<N> {
    /// No interpolant yet.
    #[must_use]
    pub fn none([theta, velocity]: [N; 2]) -> Self {
        let (theta, velocity) = ([theta; 8], [velocity; 8]);
        Self { tau: 0.0, length: 0.0, theta, velocity, sway: None }
    }

    /// Angle and velocity at time `tau` of the step.
    #[must_use]
    pub fn at(&self, tau: f64) -> [N; 2] {
        self.sum([&self.theta, &self.velocity], tau)
    }

    /// Displacement and momentum of a mode of the rig; none where there is no such mode.
    #[must_use]
    pub fn sway(&self, tau: f64) -> Option<[N; 2]> {
        self.sway.as_ref().map(|all| self.sum([&all[0], &all[1]], tau))
    }

    fn sum(&self, of: [&[N; 8]; 2], tau: f64) -> [N; 2] {
        let mut into = [of[0][7], of[1][7]];
        let part = (tau - self.tau) / self.length;
        self.theta[0].aside(Summing { of, part, into: &mut into });
        into
    }
}

/// The values of two interpolants at a part of their step.
struct Summing<'a, N> {
    of: [&'a [N; 8]; 2],
    part: f64,
    into: &'a mut [N; 2],
}

impl<N: Number> Work for Summing<'_, N> {
    #[inline(always)]
    fn run(self) {
        let Self { of, part, into } = self;
        let mut k = 7;
        while k > 0 {
            k -= 1;
            let factor = if k % 2 == 0 { part } else { 1.0 - part };
            into[0] = into[0].scale_add(factor, of[0][k]);
            into[1] = into[1].scale_add(factor, of[1][k]);
        }
    }
}
