//! Intervals from the profile of the likelihood.
//!
//! The end of an interval is where the least sum of squares that holding one parameter there allows
//! exceeds the least of all by `level` (3.84 for 95 %). It is sought along with the other parameters,
//! by Newton's method on the quadratic model at each point (Venzon & Moolgavkar 1988, Applied
//! Statistics 37, 87).

use std::sync::atomic::AtomicBool;

use nalgebra::DVector;
use rayon::prelude::*;

use super::levenberg_marquardt::Point;
use super::normal::pseudo_inverse;
use super::problem::Problem;
use crate::error::{Error, unless_cancelled};

/// Largest number of steps toward one end.
const MOST_STEPS: usize = 40;
/// Tolerance of the sum of squares at the level, over the level.
const NEAR: f64 = 0.01;

/// The ends of the intervals of the parameters `which`; one that was not found is not a number.
///
/// # Errors
/// [`Error::Interrupted`] when `cancel` is set.
pub fn intervals(
    problem: &Problem,
    best: &Point,
    which: &[usize],
    level: f64,
    cancel: &AtomicBool,
) -> Result<Vec<[f64; 2]>, Error> {
    let ends: Vec<(usize, f64)> = which.iter().flat_map(|k| [(*k, -1.0), (*k, 1.0)]).collect();
    let one = |(k, sense): &(usize, f64)| end(problem, best, *k, *sense, level, cancel);
    let values: Vec<f64> = ends.par_iter().map(one).collect::<Result<_, Error>>()?;
    Ok(values.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
}

fn end(
    problem: &Problem,
    best: &Point,
    which: usize,
    sense: f64,
    level: f64,
    cancel: &AtomicBool,
) -> Result<f64, Error> {
    let target = best.normal.chi2 + level;
    let mut point = best.clone();
    let mut shrink = 1.0;
    for _ in 0..MOST_STEPS {
        unless_cancelled(cancel)?;
        // With the parameter's step b the others follow: h - b k.
        let (information, pull) = point.normal.reduced(0.0);
        let inverse = pseudo_inverse(&information, &[which]);
        let column = information.column(which);
        let (rest, along) = (&inverse * &pull, &inverse * column);
        // The model of the profile: least - 2 slope b + curvature b^2.
        let least = point.normal.completed(&rest, 0.0);
        let remaining = point.normal.chi2 - least.gain;
        let slope = pull[which] - column.dot(&rest);
        let curvature = information[(which, which)] - column.dot(&along);
        let root = slope * slope + curvature * (target - remaining);
        if curvature.is_nan() || curvature <= 0.0 {
            return Ok(f64::NAN);
        }
        let full = (slope + sense * root.max(0.0).sqrt()) / curvature;
        let settled = (remaining - target).abs() < NEAR * level && least.gain < NEAR * level;
        if settled {
            return Ok(point.values[which] + full);
        }
        let aim = |part: f64| {
            let b = part * full;
            let mut values: DVector<f64> = &rest - &along * b;
            values[which] = b;
            point.moved(problem, &point.normal.completed(&values, 0.0))
        };
        let Some(next) = aim(shrink).filter(|next| next.normal.chi2 < target + 20.0 * level) else {
            shrink *= 0.5;
            continue;
        };
        point = next;
        // Along a curved ridge a step that was too long soon is again.
        shrink = (2.0 * shrink).min(1.0);
    }
    Ok(f64::NAN)
}
