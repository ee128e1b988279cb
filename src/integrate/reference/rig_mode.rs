//! A mode of the rig coupled to the pendulum: within a step, and while friction holds the pendulum.

use std::f64::consts::TAU;

use super::problem::{Field, OdeProblem, Past};
use crate::integrate::dop853::{A, ALL_STAGES, STAGES};
use crate::integrate::tangent::Number;
use crate::model::rest::{Load, Release, release};
use crate::model::{Equation, effects::Point};

/// Terms of an exponential's series, whose argument is at most [`SHORT`].
const TERMS: usize = 15;
const SHORT: f64 = 0.5;
/// Pulls below this part of the holding friction are neglected.
const FAINT: f64 = 1e-10;
/// The envelope of a decay over what its start shows, at most.
const ENVELOPE: f64 = 10.0;

/// Displacement and momentum of the mode over a step.
#[derive(Clone, Debug)]
pub struct Sway<N> {
    /// Their rates at the stages.
    pub slopes: [[N; ALL_STAGES]; 2],
    /// Both at the end.
    pub end: [N; 2],
}

impl<N: Number> Sway<N> {
    /// No step yet.
    #[must_use]
    pub fn none(shape: N) -> Self {
        let zero = shape.like(0.0);
        Self { slopes: [[zero; ALL_STAGES]; 2], end: [zero; 2] }
    }

    /// Without derivatives.
    #[must_use]
    pub fn values(&self) -> Sway<f64> {
        let slopes = [0, 1].map(|of| self.slopes[of].map(N::value));
        Sway { slopes, end: self.end.map(N::value) }
    }

    /// Both at stage `i` of the step of `length` from `start`.
    #[inline(always)]
    pub fn stage(&mut self, i: usize, length: f64, start: [N; 2]) -> [N; 2] {
        let [mut moved, mut gained] = [start[0].like(0.0); 2];
        let mut j = 0;
        while j < i {
            let weight = A[i][j];
            if weight != 0.0 {
                moved = self.slopes[0][j].scale_add(weight, moved);
                gained = self.slopes[1][j].scale_add(weight, gained);
            }
            j += 1;
        }
        let both = [moved.scale_add(length, start[0]), gained.scale_add(length, start[1])];
        if i == STAGES {
            self.end = both;
        }
        both
    }

    /// Keeps the rates at stage `i`.
    #[inline(always)]
    pub fn keep(&mut self, i: usize, [x, y]: [N; 2]) {
        (self.slopes[0][i], self.slopes[1][i]) = (x, y);
    }
}

/// The mode while the pendulum is held: its equation is linear.
#[derive(Clone, Copy, Debug)]
pub struct Ring<N> {
    /// The matrix of its rates, by rows.
    rates: [[N; 2]; 2],
}

impl<N: Number> Ring<N> {
    /// The mode with the pendulum held at `theta`; none if the model has no mode.
    #[must_use]
    pub fn at(field: &Field<N>, theta: N) -> Option<Self> {
        if !field.sways() {
            return None;
        }
        let [zero, one] = [0.0, 1.0].map(|value| theta.like(value));
        let of = |x: N, y: N| field.sway([theta, zero], [theta, zero, zero, x, y]);
        let [by_x, by_y] = [of(one, zero), of(zero, one)];
        Some(Self { rates: [[by_x[0], by_y[0]], [by_x[1], by_y[1]]] })
    }

    /// Displacement and momentum after some time.
    #[must_use]
    pub fn after(&self, time: f64, [x, y]: [N; 2]) -> [N; 2] {
        let halvings = (time * self.rate() / SHORT).log2().ceil().max(0.0);
        let step = time * (-halvings).exp2();
        let [zero, one] = [0.0, 1.0].map(|value| x.like(value));
        let mut term = [[one, zero], [zero, one]];
        let mut sum = term;
        for k in 1..=TERMS {
            let factor = step / k as f64;
            term = product(&term, &self.rates).map(|row| row.map(|entry| entry.scale(factor)));
            sum = [0, 1].map(|i| [0, 1].map(|j| sum[i][j] + term[i][j]));
        }
        for _ in 0..halvings as usize {
            sum = product(&sum, &sum);
        }
        sum.map(|[by_x, by_y]| by_x.mul_add(x, by_y * y))
    }

    /// Half the sum and the product of the eigenvalues.
    fn invariants(&self) -> [f64; 2] {
        let [[a, b], [c, d]] = self.rates.map(|row| row.map(N::value));
        [0.5 * (a + d), a * d - b * c]
    }

    /// The greatest rate.
    fn rate(&self) -> f64 {
        let [half, square] = self.invariants();
        square.abs().sqrt().max(2.0 * half.abs())
    }

    /// The time after which it pulls by less than `least`; infinite if it does not decay.
    fn fades(&self, sway: [f64; 2], least: f64) -> f64 {
        let [half, square] = self.invariants();
        let decay = -half - (half * half - square).max(0.0).sqrt();
        let pull = ENVELOPE * self.rate() * sway[1].hypot(self.rate() * sway[0]);
        if pull <= least {
            0.0
        } else if decay > 0.0 {
            (pull / least).ln() / decay
        } else {
            f64::INFINITY
        }
    }
}

fn product<N: Number>(a: &[[N; 2]; 2], b: &[[N; 2]; 2]) -> [[N; 2]; 2] {
    [0, 1].map(|i| [0, 1].map(|j| a[i][0].mul_add(b[0][j], a[i][1] * b[1][j])))
}

/// The pendulum at rest: the memory of an effect, and a mode that oscillates freely from its
/// displacement and momentum at a time.
#[derive(Debug)]
pub struct Resting<'a, N> {
    ode: &'a OdeProblem<N>,
    kept: f64,
    ring: Option<(Ring<f64>, f64, [f64; 2])>,
}

impl<'a, N> Resting<'a, N> {
    /// Whether there is no mode, or it has decayed.
    #[must_use]
    pub fn still(ode: &'a OdeProblem<N>, kept: f64) -> Self {
        Self { ode, kept, ring: None }
    }
}

impl<N: Number> Load for Resting<'_, N> {
    fn load_and_hold(&self, tau: f64, theta: f64) -> [f64; 2] {
        let equation = self.equation();
        let forcing = self.ode.plain().forcing(tau, theta);
        let past = [theta, self.kept];
        let sway = self
            .ring
            .as_ref()
            .map_or([0.0; 2], |(ring, since, sway)| ring.after(tau - since, *sway));
        let at = Point { past, sway, ..equation.point(&forcing, theta, 0.0, 1.0) };
        [equation.load(&forcing, &at), equation.friction(&at).max(0.0)]
    }
    fn equation(&self) -> &Equation<f64> {
        self.ode.plain().equation()
    }
    fn has_closed_release(&self) -> bool {
        self.ring.is_none() && self.ode.is_harmonic()
    }
    fn period(&self) -> Option<f64> {
        self.ode.period().filter(|_| self.ring.is_none())
    }
    fn time_scale(&self) -> f64 {
        let own = self.ode.look();
        self.ring.as_ref().map_or(own, |(ring, ..)| own.min(TAU / ring.rate()))
    }
}

/// The time at which a pendulum that came to rest at `theta` at time `tau` moves; sought up to
/// `until` if the equation is not periodic.
pub fn let_go<N: Number>(
    ode: &OdeProblem<N>,
    tau: f64,
    theta: f64,
    past: Past<N>,
    until: f64,
) -> Release {
    let [_, kept, _, x, y] = past.map(N::value);
    let still = Resting::still(ode, kept);
    let Some(ring) = Ring::at(ode.plain(), theta) else {
        return release(&still, tau, theta, until);
    };
    let [load, hold] = still.load_and_hold(tau, theta);
    let constant = ode.period().is_some() && still.equation().is_autonomous();
    let spare = if constant { hold - load.abs() } else { 0.0 };
    let least = spare.max(FAINT * hold).max(f64::MIN_POSITIVE);
    let faint = tau + ring.fades([x, y], least);
    let ringing = Resting { ode, kept, ring: Some((ring, tau, [x, y])) };
    if faint <= tau {
        return release(&still, tau, theta, until);
    }
    match release(&ringing, tau, theta, faint.min(until)) {
        Release::Later if faint < until => match release(&still, faint, theta, until) {
            Release::Now(sense) => Release::At(faint, sense),
            later => later,
        },
        found => found,
    }
}
