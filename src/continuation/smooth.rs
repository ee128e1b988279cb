//! Equal steps of the Runge-Kutta-Nystrom method, with derivatives by the state and by parameters.
//!
//! As in [`crate::integrate::kernel::schedule`] viscous damping is folded into the time of each step: with
//! `U = (1 - exp(-gamma h)) / gamma` for the step `h`, stage `c` is at `s = -ln(1 - gamma c U) / gamma` after the
//! step's start, and its load has the factor `(U exp(gamma s))^2 = (U / (1 - gamma c U))^2`. Here `gamma`, `h` and
//! all loads are numbers with derivatives by the parameters. The lanes are stages where loads are computed, and states where
//! those move.

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use super::course::Course;
use crate::integrate::State;
use crate::integrate::kernel::tableau::{A, B, BP, C, STAGES};
use crate::integrate::tangent::Tangent;
use crate::lanes::pack::Bundle;
use crate::lanes::sine::Fine;
use crate::lanes::{InstructionSet, Isa, Job, Lane, MAX_WIDTH, Real, dispatch};
use crate::model::{Equation, Parameter, Pendulum};

/// Below this argument an exponential or logarithm is a series, whose terms above this many are below rounding.
const SHORT: f64 = 0.05;
const TERMS: u32 = 12;
/// Steps of a period at least.
const FEWEST: f64 = 16.0;

/// The number of steps of at most this length, in units of the fastest small oscillation, over a period.
#[must_use]
pub fn count(pendulum: &Pendulum, length: f64) -> usize {
    let duration = pendulum.period() * pendulum.greatest_pull().sqrt();
    (duration / length).ceil().max(FEWEST) as usize
}

/// `states` at the beginning of a period, this part of a period later, with their derivatives, by a number of steps a period.
pub fn carry<const N: usize>(
    course: &Course,
    at: &[f64],
    states: &[State],
    part: f64,
    count: usize,
) -> Vec<[Tangent<f64, N>; 2]> {
    let steps = Steps::new(course, at, part, count);
    let begun = |state: &State| {
        let [theta, velocity] = [0, 1].map(|k| Tangent::seeded(state[k], k));
        [theta.scale(FRAC_1_PI), velocity * steps.kick]
    };
    let mut moving: Vec<[Tangent<f64, N>; 2]> = states.iter().map(begun).collect();
    let simd = InstructionSet::choose().unwrap_or(InstructionSet::Portable);
    dispatch::run(simd, Motions { course, at, steps: &steps, moving: &mut moving });
    moving.into_iter().map(|[x, kick]| [x.scale(PI), kick / steps.kick]).collect()
}

/// The part of the steps that no state changes.
struct Steps<const N: usize> {
    pendulum: Pendulum,
    /// The length of a step.
    length: Tangent<f64, N>,
    /// Times of the stages after the step's start.
    times: [Tangent<f64, N>; STAGES],
    factors: [Tangent<f64, N>; STAGES],
    /// The constant torque times the factor.
    torque: [Tangent<f64, N>; STAGES],
    /// `U / pi`: the velocity times this is what a motion carries.
    kick: Tangent<f64, N>,
    decay: Tangent<f64, N>,
    count: usize,
}

impl<const N: usize> Steps<N> {
    fn new(course: &Course, at: &[f64], part: f64, count: usize) -> Self {
        let pendulum = course.pendulum(at);
        let number = course.number::<N>(at);
        let [gamma, torque, omega] = [Parameter::Gamma, Parameter::Torque, Parameter::Omega]
            .map(|parameter| number(parameter, pendulum.value(parameter)));
        let count = (count as f64 * part).ceil() as usize;
        let length = (omega.like(TAU * part) / omega).scale(1.0 / count as f64);
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
        let torque = factors.map(|factor| factor * torque);
        let decay = gamma.like(1.0) - gamma * folded;
        let kick = folded.scale(FRAC_1_PI);
        Self { pendulum, length, times, factors, torque, kick, decay, count }
    }
}

/// Motions of one period, and the steps that carry them.
struct Motions<'a, const N: usize> {
    course: &'a Course,
    at: &'a [f64],
    steps: &'a Steps<N>,
    moving: &'a mut [[Tangent<f64, N>; 2]],
}

impl<const N: usize> Job for Motions<'_, N> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) {
        self.of::<Bundle<S, 1>>(isa);
    }
}

impl<const N: usize> Motions<'_, N> {
    #[inline(always)]
    fn of<L: Lane>(self, token: L::Token) {
        let Self { course, at, steps, moving } = self;
        let number = course.number::<N>(at);
        let equation = Equation::lift(&steps.pendulum, |parameter, value| {
            splat::<L, N>(token, number(parameter, value))
        });
        let length = splat::<L, N>(token, steps.length);
        let decay = splat::<L, N>(token, steps.decay);
        let torque = steps.torque.map(|one| splat::<L, N>(token, one));
        let (mut times, mut factors) = ([length; STAGES], [length; STAGES]);
        let parts = STAGES / L::WIDTH;
        for part in 0..parts {
            times[part] = gathered(token, &steps.times[part * L::WIDTH..]);
            factors[part] = gathered(token, &steps.factors[part * L::WIDTH..]);
        }
        let mut bundles: Vec<[Tangent<L, N>; 2]> = moving
            .chunks(L::WIDTH)
            .map(|chunk| {
                [0, 1].map(|k| gathered(token, &chunk.iter().map(|one| one[k]).collect::<Vec<_>>()))
            })
            .collect();
        // Value and slopes of the modulation at each stage of a step.
        let (mut values, mut slopes) = ([0.0; MAX_WIDTH], [[0.0; MAX_WIDTH]; N]);
        for k in 0..steps.count {
            let mut modulation = [length; STAGES];
            let start = length.scale(k as f64);
            for part in 0..parts {
                let vertical = equation.forcing(start + times[part]).vertical;
                let load = -(factors[part] * vertical);
                load.value.store(&mut values[part * L::WIDTH..]);
                for (lanes, slope) in load.slope.iter().zip(&mut slopes) {
                    lanes.store(&mut slope[part * L::WIDTH..]);
                }
            }
            for (stage, one) in modulation.iter_mut().enumerate() {
                one.value = L::splat(token, values[stage]);
                for (lanes, slope) in one.slope.iter_mut().zip(&slopes) {
                    *lanes = L::splat(token, slope[stage]);
                }
            }
            for bundle in &mut bundles {
                *bundle = step(*bundle, &modulation, &torque, decay);
            }
        }
        for (chunk, bundle) in moving.chunks_mut(L::WIDTH).zip(&bundles) {
            for (k, lanes) in bundle.iter().enumerate() {
                scattered(lanes, chunk, k);
            }
        }
    }
}

/// A number in every lane.
#[inline(always)]
fn splat<L: Lane, const N: usize>(token: L::Token, number: Tangent<f64, N>) -> Tangent<L, N> {
    let mut slope = [L::splat(token, 0.0); N];
    for (lanes, own) in slope.iter_mut().zip(number.slope) {
        *lanes = L::splat(token, own);
    }
    Tangent { value: L::splat(token, number.value), slope }
}

/// Numbers, one in each lane, the last one in what is left.
#[inline(always)]
fn gathered<L: Lane, const N: usize>(
    token: L::Token,
    numbers: &[Tangent<f64, N>],
) -> Tangent<L, N> {
    let mut lanes = [[0.0; MAX_WIDTH]; 2];
    let mut all = splat::<L, N>(token, numbers[0]);
    for j in 0..L::WIDTH {
        lanes[0][j] = numbers[j.min(numbers.len() - 1)].value;
    }
    all.value = L::load(token, &lanes[0]);
    for i in 0..N {
        for j in 0..L::WIDTH {
            lanes[1][j] = numbers[j.min(numbers.len() - 1)].slope[i];
        }
        all.slope[i] = L::load(token, &lanes[1]);
    }
    all
}

/// The opposite of [`gathered`].
#[inline(always)]
fn scattered<L: Lane, const N: usize>(
    lanes: &Tangent<L, N>,
    into: &mut [[Tangent<f64, N>; 2]],
    k: usize,
) {
    let mut numbers = [0.0; MAX_WIDTH];
    lanes.value.store(&mut numbers);
    for (one, number) in into.iter_mut().zip(numbers) {
        one[k].value = number;
    }
    for i in 0..N {
        lanes.slope[i].store(&mut numbers);
        for (one, number) in into.iter_mut().zip(numbers) {
            one[k].slope[i] = number;
        }
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
#[inline(always)]
fn step<L: Lane, const N: usize>(
    [x, kick]: [Tangent<L, N>; 2],
    modulation: &[Tangent<L, N>; STAGES],
    torque: &[Tangent<L, N>; STAGES],
    decay: Tangent<L, N>,
) -> [Tangent<L, N>; 2] {
    let mut k = [x; STAGES];
    // Written out, as in [`crate::integrate::kernel::step`].
    macro_rules! stage {
        ($i:literal: $($j:literal)*) => {
            let at = if C[$i] == 0.0 { x } else { kick.scale_add(C[$i], x) };
            $(let at = if A[$i][$j] == 0.0 { at } else { k[$j].scale_add(A[$i][$j], at) };)*
            k[$i] = modulation[$i].mul_add(at.sine::<Fine>(), torque[$i]);
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
    let (mut position, mut speed) = (x + kick, kick);
    macro_rules! weigh {
        ($($i:literal)*) => {$(
            position = if B[$i] == 0.0 { position } else { k[$i].scale_add(B[$i], position) };
            speed = if BP[$i] == 0.0 { speed } else { k[$i].scale_add(BP[$i], speed) };
        )*};
    }
    weigh!(0 1 2 3 4 5 6 7);
    [position, speed * decay]
}
