//! Zeros of the velocity within a step.
//!
//! The velocity's polynomial is written in Bernstein's basis: if all its coefficients have one sign
//! it has no zero, if they change sign once it has one, and otherwise it is halved. So the first
//! zero is found however close two of them are, and a step may start at a zero: after a turn or a
//! release the velocity grows from 0 as the first or second power of time, and the first
//! coefficients vanish.

use super::dense::{Curve, DenseStep};
use super::problem::OdeProblem;
use crate::integrate::tangent::Number;

const DEGREE: usize = 7;
/// Rounding error of a coefficient, over the sum of the polynomial's coefficients.
const ROUNDING: f64 = 1e-15;
/// A velocity smaller than this part of those of the step is zero: a contact or a passage.
const CLOSE: f64 = 1e-12;
const MOST_HALVINGS: i32 = 50;
/// Newton's steps; two are common.
const MOST_STEPS: usize = 8;

/// `binomial(n, k)` for `n` up to 7.
const CHOOSE: [[f64; DEGREE + 1]; DEGREE + 1] = {
    let mut table = [[0.0; DEGREE + 1]; DEGREE + 1];
    let mut n = 0;
    while n <= DEGREE {
        table[n][0] = 1.0;
        let mut k = 1;
        while k <= n {
            table[n][k] = table[n - 1][k - 1] + if k < n { table[n - 1][k] } else { 0.0 };
            k += 1;
        }
        n += 1;
    }
    table
};

/// A polynomial over `[0, 1]` by its Bernstein coefficients.
type Bernstein = [f64; DEGREE + 1];

/// Zeros of the velocity within a step.
#[derive(Debug)]
pub enum Turning {
    /// The velocity keeps its sign.
    None,
    /// The velocity passes zero at the end of a step of this length, where it is 0 to rounding.
    At(f64),
    /// The interpolant has a zero that the motion lacks: the step is too long for its interpolant.
    Unclear,
}

/// The first zero of the velocity of `dense`, located by integrating again from the step's start,
/// without derivatives.
pub fn first<N: Number>(ode: &OdeProblem<N>, dense: &DenseStep<N>) -> Turning {
    if dense.surely_keeps_sense() {
        return Turning::None;
    }
    let (field, mut step) = (ode.plain(), dense.values());
    let curve = forward(&step.curve(field), step.signs[0]);
    let Some(part) = first_below_zero(&curve) else { return Turning::None };
    let mut length = part * dense.length;
    step.shorten(field, length);
    let mut velocity = step.end[1];
    for _ in 0..MOST_STEPS {
        let next = length - velocity / step.last();
        if !(next > 0.0 && next <= dense.length) {
            break;
        }
        step.shorten(field, next);
        if step.end[1].abs() >= velocity.abs() {
            break;
        }
        (velocity, length) = (step.end[1], next);
    }
    let size: f64 = curve.iter().map(|c| c.abs()).sum();
    if velocity.abs() <= CLOSE * size { Turning::At(length) } else { Turning::Unclear }
}

/// The velocity in the sense of the motion.
fn forward(curve: &Curve<f64>, sense: f64) -> Bernstein {
    let mut all = [sense * curve.velocity[0]; DEGREE + 1];
    for (k, coefficient) in curve.velocity.iter().enumerate().skip(1) {
        // x^i (1 - x)^j times (x + 1 - x)^rest.
        let (i, j) = (k.div_ceil(2), k / 2);
        let rest = DEGREE - i - j;
        for l in 0..=rest {
            all[i + l] += sense * coefficient * CHOOSE[rest][l] / CHOOSE[DEGREE][i + l];
        }
    }
    all
}

/// The first point of `[0, 1]` from which the polynomial is negative beyond rounding.
fn first_below_zero(whole: &Bernstein) -> Option<f64> {
    let limit = -ROUNDING * whole.iter().map(|c| c.abs()).sum::<f64>();
    if whole.iter().all(|c| *c >= limit) {
        return None;
    }
    let mut open = vec![(0.0, 0, *whole)];
    while let Some((left, halvings, all)) = open.pop() {
        if all.iter().all(|c| *c >= limit) {
            continue;
        }
        if all[0] < limit || halvings == MOST_HALVINGS {
            return Some(left);
        }
        let width = 0.5_f64.powi(halvings);
        let changes = all.windows(2).filter(|w| (w[0] >= limit) != (w[1] >= limit)).count();
        if changes == 1 {
            return Some(left + width * only_zero(&all));
        }
        let (lower, upper) = halved(&all);
        open.push((left + 0.5 * width, halvings + 1, upper));
        open.push((left, halvings + 1, lower));
    }
    None
}

/// The zero of a polynomial whose coefficients change sign once, from positive to negative.
fn only_zero(all: &Bernstein) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    let mut at = 0.5;
    // Regula falsi with halving (Illinois): never leaves the bracket.
    let (mut below, mut above) = (all[0].max(0.0), all[DEGREE]);
    for _ in 0..60 {
        at = if above < below { (low * above - high * below) / (above - below) } else { 0.5 };
        if !(at > low && at < high) || below == 0.0 {
            at = 0.5 * (low + high);
        }
        let value = evaluate(all, at);
        if value == 0.0 || high - low < 1e-15 {
            break;
        }
        if value > 0.0 {
            (low, below, above) = (at, value, 0.5 * above);
        } else {
            (high, above, below) = (at, value, 0.5 * below);
        }
    }
    at
}

fn evaluate(all: &Bernstein, at: f64) -> f64 {
    let mut points = *all;
    for last in (0..DEGREE).rev() {
        for i in 0..=last {
            points[i] += at * (points[i + 1] - points[i]);
        }
    }
    points[0]
}

/// The two halves, by de Casteljau.
fn halved(all: &Bernstein) -> (Bernstein, Bernstein) {
    let (mut lower, mut points) = (*all, *all);
    for (k, coefficient) in lower.iter_mut().enumerate().skip(1) {
        for i in 0..=DEGREE - k {
            points[i] = 0.5 * (points[i] + points[i + 1]);
        }
        *coefficient = points[0];
    }
    (lower, points)
}
