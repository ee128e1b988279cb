//! Equal steps of the Runge-Kutta-Nystrom method, with derivatives by the state and by parameters.
//!
//! As in [`crate::integrate::kernel::schedule`] viscous damping is folded into the time of each step: with
//! `U = (1 - exp(-gamma h)) / gamma` for the step `h`, stage `c` is at `s = -ln(1 - gamma c U) / gamma` after the
//! step's start, and its load has the factor `(U exp(gamma s))^2 = (U / (1 - gamma c U))^2`. Here `gamma`, `h` and
//! all loads are numbers with derivatives by the parameters.

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use super::course::Course;
use crate::integrate::State;
use crate::integrate::kernel::tableau::{A, B, BP, C, STAGES};
use crate::integrate::tangent::Tangent;
use crate::lanes::Real;
use crate::lanes::sine::Fine;
use crate::model::Equation;
use crate::orbit::poincare::STEP;

/// Below this argument an exponential or logarithm is a series, whose terms above this many are below rounding.
const SHORT: f64 = 0.05;
const TERMS: u32 = 12;

/// Loads of one step, stage by stage.
struct Loads<const N: usize> {
    /// Gravity under the drive times the factor.
    modulation: [Tangent<f64, N>; STAGES],
    /// The constant torque times the factor.
    torque: [Tangent<f64, N>; STAGES],
}

/// The part of the steps that no state changes.
struct Steps<const N: usize> {
    equation: Equation<Tangent<f64, N>>,
    /// The length of a step.
    length: Tangent<f64, N>,
    /// Times of the stages after the step's start.
    times: [Tangent<f64, N>; STAGES],
    factors: [Tangent<f64, N>; STAGES],
    /// `U / pi`: the velocity times this is what a motion carries.
    kick: Tangent<f64, N>,
    decay: Tangent<f64, N>,
    count: usize,
}

/// `states` at the beginning of a period, this part of a period later, with their derivatives.
pub fn carry<const N: usize>(
    course: &Course,
    at: &[f64],
    states: &[State],
    part: f64,
) -> Vec<[Tangent<f64, N>; 2]> {
    let steps = Steps::new(course, at, part);
    let begun = |state: &State| {
        let [theta, velocity] = [0, 1].map(|k| Tangent::seeded(state[k], k));
        [theta.scale(FRAC_1_PI), velocity * steps.kick]
    };
    let mut moving: Vec<[Tangent<f64, N>; 2]> = states.iter().map(begun).collect();
    for k in 0..steps.count {
        let loads = steps.loads(k);
        for motion in &mut moving {
            *motion = step(*motion, &loads, steps.decay);
        }
    }
    moving.into_iter().map(|[x, kick]| [x.scale(PI), kick / steps.kick]).collect()
}

impl<const N: usize> Steps<N> {
    fn new(course: &Course, at: &[f64], part: f64) -> Self {
        let pendulum = course.pendulum(at);
        let equation = course.equation::<N>(at);
        let omega = equation.motion.omega;
        let duration = omega.like(TAU * part) / omega;
        let pull = pendulum.greatest_pull().sqrt();
        let count = (duration.value * pull / STEP).ceil().max(16.0) as usize;
        let length = duration.scale(1.0 / count as f64);
        let gamma = equation.gamma;
        // (1 - exp(-x)) / x and -ln(1 - y) / y, over the step and over its part.
        let folded = length * shrunk(gamma * length);
        let times = C.map(|c| {
            let part = folded.scale(c);
            part * stretched(gamma * part)
        });
        let factors = C.map(|c| {
            let one = gamma.like(1.0);
            let growth = folded / (one - gamma * folded.scale(c));
            (growth * growth).scale(FRAC_1_PI)
        });
        let decay = gamma.like(1.0) - gamma * folded;
        Self { equation, length, times, factors, kick: folded.scale(FRAC_1_PI), decay, count }
    }

    fn loads(&self, k: usize) -> Loads<N> {
        let start = self.length.scale(k as f64);
        let none = [start; STAGES];
        let mut loads = Loads { modulation: none, torque: none };
        for i in 0..STAGES {
            let forcing = self.equation.forcing(start + self.times[i]);
            loads.modulation[i] = -(self.factors[i] * forcing.vertical);
            loads.torque[i] = self.factors[i] * self.equation.torque;
        }
        loads
    }
}

/// `(1 - exp(-x)) / x`.
fn shrunk<const N: usize>(x: Tangent<f64, N>) -> Tangent<f64, N> {
    series(x, |k| -1.0 / f64::from(k + 1)).unwrap_or_else(|| (x.like(1.0) - (-x).exponential()) / x)
}

/// `-ln(1 - y) / y`.
fn stretched<const N: usize>(y: Tangent<f64, N>) -> Tangent<f64, N> {
    series(y, |k| f64::from(k) / f64::from(k + 1))
        .unwrap_or_else(|| -((y.like(1.0) - y).logarithm()) / y)
}

/// `1 + r(1) x (1 + r(2) x (1 + ...))` of a small number.
fn series<const N: usize>(
    x: Tangent<f64, N>,
    ratio: impl Fn(u32) -> f64,
) -> Option<Tangent<f64, N>> {
    let one = x.like(1.0);
    let sum = |sum: Tangent<f64, N>, k: u32| (sum * x).scale(ratio(k)) + one;
    (x.value.abs() < SHORT).then(|| (1..=TERMS).rev().fold(one, sum))
}

/// One step of the angle in half turns and the kick.
fn step<const N: usize>(
    [x, kick]: [Tangent<f64, N>; 2],
    loads: &Loads<N>,
    decay: Tangent<f64, N>,
) -> [Tangent<f64, N>; 2] {
    let mut k = [x; STAGES];
    for i in 0..STAGES {
        let mut at = kick.scale_add(C[i], x);
        for j in 0..i {
            at = k[j].scale_add(A[i][j], at);
        }
        k[i] = loads.modulation[i].mul_add(at.sine::<Fine>(), loads.torque[i]);
    }
    let (mut position, mut speed) = (x + kick, kick);
    for i in 0..STAGES {
        position = k[i].scale_add(B[i], position);
        speed = k[i].scale_add(BP[i], speed);
    }
    [position, speed * decay]
}
