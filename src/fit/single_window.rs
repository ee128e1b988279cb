//! The fit of the initial state of one window, with all parameters fixed.

use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::levenberg_marquardt::{Limit, Point, descend};
use super::normal::Step;
use super::problem::Problem;
use super::window::Window;
use crate::error::Error;

/// Gain in the sum of squares below which the fit ends.
const GAIN: f64 = 0.1;
/// Part of the sum of squares below which a gain ends the fit: the parameters then matter more.
const PART: f64 = 1e-3;
/// Largest number of steps after a step of all windows failed: at a kink, more do not help.
const RELAXED: usize = 6;
/// A window is fitted again if it missed this part of the largest missed gain.
const PART_MISSED: f64 = 0.1;
/// A window is at a kink if its gain is at most this part of the predicted one.
const KEPT_AT_KINK: f64 = 0.1;
/// Largest number of windows that are fitted again.
const FEW: usize = 2;

/// A window with the initial state that fits best at fixed parameters.
#[derive(Clone, Debug)]
pub struct SingleWindow {
    /// The point of this window alone.
    pub point: Point,
    /// Predicted gain that no step realises: at a kink, for example where friction just holds, the
    /// gradient does not vanish at the minimum.
    pub in_vain: f64,
}

/// Fits the initial state of `window` alone in at most `steps` steps; none where its motion leaves
/// the range of numbers.
///
/// # Errors
/// [`Error::Interrupted`] when `cancel` is set.
pub fn fit_alone(
    problem: &Problem,
    values: &[f64],
    window: Window,
    steps: usize,
    cancel: &AtomicBool,
) -> Result<Option<SingleWindow>, Error> {
    let held: Vec<usize> = (0..values.len()).collect();
    let Some(mut point) = Point::new(problem, values.to_vec(), vec![window]) else {
        return Ok(None);
    };
    let promised = point.normal.step(0.0, &held).gain;
    let chi2 = point.normal.chi2;
    let limit = Limit { gain: GAIN, part: PART, steps, target: f64::INFINITY };
    descend(problem, &mut point, &held, limit, cancel)?;
    let kept = chi2 - point.normal.chi2;
    let in_vain = if kept < KEPT_AT_KINK * promised { promised - kept } else { 0.0 };
    Ok(Some(SingleWindow { point, in_vain }))
}

/// Windows of `point` that rose although `step` from `before` predicted a fall get initial states
/// fitted separately.
///
/// A motion near the top, or one that friction nearly holds, may take another course after a
/// slightly too long step, which no other window can compensate: one alone would block the descent.
///
/// # Errors
/// [`Error::Interrupted`] when `cancel` is set.
pub fn relax(
    problem: &Problem,
    point: &mut Point,
    before: &Point,
    step: &Step,
    cancel: &AtomicBool,
) -> Result<(), Error> {
    if point.windows.len() == 1 {
        return Ok(());
    }
    let missed: Vec<f64> = (0..point.windows.len())
        .map(|k| point.normal.parts[k] - before.normal.parts[k] + step.gains[k])
        .collect();
    let most = missed.iter().copied().fold(0.0, f64::max);
    let risen: Vec<usize> = (0..missed.len()).filter(|k| missed[*k] > PART_MISSED * most).collect();
    if risen.len() > FEW {
        // Not one or two windows: the step itself is too long.
        return Ok(());
    }
    let fitted = |values: &[f64], window| fit_alone(problem, values, window, RELAXED, cancel);
    let relaxed = |k: usize| -> Result<Option<(usize, Point, f64)>, Error> {
        // From where the step led, and from where it was.
        let led = fitted(&point.values, point.windows[k])?;
        let was = fitted(&point.values, before.windows[k])?;
        let chi2 = |one: &SingleWindow| one.point.normal.chi2;
        let both = led.into_iter().chain(was);
        let Some(best) = both.min_by(|a, b| chi2(a).total_cmp(&chi2(b))) else { return Ok(None) };
        let old = fitted(&before.values, before.windows[k])?;
        Ok(old.map(|old| (k, best.point, old.in_vain)))
    };
    let all: Vec<_> = risen.into_par_iter().map(relaxed).collect::<Result<_, Error>>()?;
    for (k, best, in_vain) in all.into_iter().flatten() {
        if best.normal.chi2 < point.normal.parts[k] {
            point.windows[k] = best.windows[0];
            point.normal.replace(k, best.normal);
        }
        point.in_vain += in_vain;
    }
    Ok(())
}
