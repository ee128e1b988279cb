//! One window by itself: its initial state where all parameters are held.

use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::levenberg_marquardt::{Limit, Point, descend};
use super::normal::Step;
use super::problem::Problem;
use super::window::Window;
use crate::error::Error;

/// The gain in the sum of squares up to which it goes ...
const GAIN: f64 = 0.1;
/// ... or the part of the sum that this is: beyond that the parameters say more.
const PART: f64 = 1e-3;
/// The most steps where a step of all windows failed: at a kink more lead nowhere.
const RELAXED: usize = 6;
/// The part of the most that a window missed of what was promised from which others are looked at.
const PART_MISSED: f64 = 0.1;
/// The part of what it promised that a window keeps at most that is at a kink.
const KEPT_AT_KINK: f64 = 0.1;
/// So many windows at most are looked at.
const FEW: usize = 2;

/// A window with the initial state that fits best at fixed parameters.
#[derive(Clone, Debug)]
pub struct SingleWindow {
    /// The point of this window alone.
    pub point: Point,
    /// What it promised in vain: at a kink, as where friction just holds, a least sum of squares is
    /// not flat.
    pub in_vain: f64,
}

/// Fits the initial state of `window` alone in at most so many `steps`; none where its motion leaves
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
    let Ok(mut point) = Point::new(problem, values.to_vec(), vec![window]) else {
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

/// Windows of `point` that rose where `step` from `before` promised a fall find initial states of
/// their own.
///
/// A motion near the top, or one that friction nearly holds, goes another way after the least step
/// too far, and no other window can make that good: one alone would hold up the search.
pub fn relax(
    problem: &Problem,
    point: &mut Point,
    before: &Point,
    step: &Step,
    cancel: &AtomicBool,
) {
    if point.windows.len() == 1 {
        return;
    }
    let missed: Vec<f64> = (0..point.windows.len())
        .map(|k| point.normal.parts[k] - before.normal.parts[k] + step.gains[k])
        .collect();
    let most = missed.iter().copied().fold(0.0, f64::max);
    let risen: Vec<usize> = (0..missed.len()).filter(|k| missed[*k] > PART_MISSED * most).collect();
    if risen.len() > FEW {
        // Not a window or two, but the step itself goes too far.
        return;
    }
    let fitted =
        |values: &[f64], window| fit_alone(problem, values, window, RELAXED, cancel).ok()?;
    let found = |k: usize| {
        // From where the step led, and from where it was.
        let from = [point.windows[k], before.windows[k]];
        let both = from.into_iter().filter_map(|window| fitted(&point.values, window));
        let chi2 = |one: &SingleWindow| one.point.normal.chi2;
        let best = both.min_by(|a, b| chi2(a).total_cmp(&chi2(b)))?;
        let in_vain = fitted(&before.values, before.windows[k])?.in_vain;
        Some((k, best.point, in_vain))
    };
    let all: Vec<(usize, Point, f64)> = risen.into_par_iter().filter_map(found).collect();
    for (k, best, in_vain) in all {
        if best.normal.chi2 < point.normal.parts[k] {
            point.windows[k] = best.windows[0];
            point.normal.replace(k, best.normal);
        }
        point.in_vain += in_vain;
    }
}
