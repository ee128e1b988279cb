//! Readings rounded to counts: each is an interval, not a value.
//!
//! A sensor that gives whole counts states that the angle plus its own noise was within half a
//! count of the reading. With Gaussian noise of standard error `s` before the rounding, the
//! likelihood of a model `m` is `P = Phi((y + q/2 - m)/s) - Phi((y - q/2 - m)/s)`. As long as `s`
//! exceeds a third of a count this is a Gaussian of variance `s^2 + q^2/12`; below, a reading in
//! the middle of a count has almost no information and one next to a crossed edge has all. Treated
//! as Gaussian, successive readings on one count would be taken for independent.
//!
//! `log P` is concave in `m` (Burridge 1981, J. R. Statist. Soc. B 43, 41), so that its curvature
//! serves as weight: least squares with the residual `u / sqrt(i)` and the weight `sqrt(i)`, `u`
//! the slope and `i` the curvature, is Newton's method on the likelihood.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Argument from which the complementary error function is computed as a continued fraction.
const TAIL: f64 = 2.0;
/// The least weight, over `1 / s`: rows stay as they are, up to their length, where a reading says
/// nothing.
const FAINT: f64 = 1e-6;
/// Distance from its count, in standard errors, above which a reading is a value, before digits are
/// lost.
const FAR: f64 = 1e4;
/// Range of a mean over readings on either side of a count, in standard errors.
const REACH: f64 = 9.0;
/// Points of that mean.
const POINTS: usize = 400;

/// The likelihood of one reading as a function of the model's angle.
#[derive(Clone, Copy, Debug)]
pub struct Likelihood {
    /// `-2 log P`.
    pub deviance: f64,
    /// `d log P / dm` over the root of its curvature: as the residual of a reading that is a value,
    /// over its standard error.
    pub residual: f64,
    /// The root of minus the second derivative of `log P`: as one over a standard error.
    pub weight: f64,
}

/// The likelihood of a reading that differs by `apart` from the model, rounded to a multiple of `count`,
/// with noise of standard error `1 / sharpness` before the rounding.
#[must_use]
pub fn likelihood(apart: f64, count: f64, sharpness: f64) -> Likelihood {
    // Mirrored so that the model lies below the middle of the count.
    let middle = apart.abs() * sharpness;
    let half = 0.5 * count * sharpness;
    let (low, high) = (middle - half, middle + half);
    // The probability above each end, over the density there.
    let root = (0.5 * PI).sqrt();
    let above = |x: f64| root * scaled_erfc(x * FRAC_1_SQRT_2);
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * PI).sqrt();
    // The density at the far end over that at the near one.
    let fall = (-0.5 * (high * high - low * low)).exp();
    let (deviance, ratio) = if low >= 0.0 {
        // All over the density at the near end, which may be too small for a number.
        let share = above(low) - fall * above(high);
        (low * low + (2.0 * PI).ln() - 2.0 * share.ln(), 1.0 / share)
    } else {
        let inside = 1.0 - density(low) * above(-low) - density(high) * above(high);
        (-2.0 * inside.ln(), density(low) / inside)
    };
    let slope = ratio * (1.0 - fall);
    let curvature = if low < FAR { slope * slope + ratio * (high * fall - low) } else { 1.0 };
    let weight = curvature.max(FAINT * FAINT).sqrt();
    Likelihood { deviance, residual: (slope / weight).copysign(apart), weight: weight * sharpness }
}

/// The mean of `-2 log P` of a motion that passes evenly through counts, less 1: with it
/// subtracted, sums of deviances are comparable to those of squared residuals over standard errors.
#[must_use]
pub fn surplus(count: f64, sharpness: f64) -> f64 {
    // By the middle rule over where the model may be, in counts, on either side of a reading.
    let reach = 0.5 + REACH / (count * sharpness);
    let step = reach / POINTS as f64;
    let part = |k: usize| {
        let Likelihood { deviance, .. } =
            likelihood((k as f64 + 0.5) * step * count, count, sharpness);
        (-0.5 * deviance).exp() * deviance
    };
    2.0 * step * (0..POINTS).map(part).sum::<f64>() - 1.0
}

/// `exp(x^2) erfc(x)` of `x >= 0`.
fn scaled_erfc(x: f64) -> f64 {
    let square = x * x;
    if x < TAIL {
        // 1 - erf by the series of Abramowitz & Stegun 7.1.6.
        let (mut term, mut sum, mut n) = (x, x, 0.0);
        while term > 1e-17 * sum {
            n += 1.0;
            term *= 2.0 * square / (2.0 * n + 1.0);
            sum += term;
        }
        return square.exp() - 2.0 / PI.sqrt() * sum;
    }
    // Laplace's continued fraction (7.1.14), from a sufficient depth.
    let depth = (20.0 + 400.0 / square) as usize;
    let mut rest = x;
    for k in (1..=depth).rev() {
        rest = x + 0.5 * k as f64 / rest;
    }
    1.0 / (PI.sqrt() * rest)
}
