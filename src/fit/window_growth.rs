//! Fits over windows that grow from short to long.
//!
//! Within a window of about a swing the model is nearly linear in all unknowns, so that the search
//! converges from far; each stage starts from the preceding one's curve. Long windows are precise,
//! since small errors of the parameters accumulate in them.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::levenberg_marquardt::{Limit, Outcome, Point, descend};
use super::problem::Problem;
use super::single_window::{SingleWindow, fit_alone};
use super::window::{Window, guess, halves, windows_of};
use crate::error::Error;
use crate::integrate::State;

/// Windows whose mean squared residual exceeds this multiple of the squared median are split.
const ASTRAY: f64 = 36.0;
/// Number of times they are split.
const MOST_SPLITS: usize = 3;
/// Largest number of steps for a window's own initial state.
const SETTLED: usize = 10;

/// Choices of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Length of the first windows, in units of time; infinite to begin with the longest.
    pub shortest: f64,
    /// Factor by which windows grow from stage to stage.
    pub growth: f64,
    /// Largest number of steps of a stage.
    pub steps: usize,
    /// Gain in the sum of squares below which the descent ends.
    pub gain: f64,
    /// Number of leading parameters that stay at their starts: to test a model on a record that it was
    /// not fitted to, the initial states alone are adapted.
    pub hold: usize,
    /// [`Limit::target`] of a search that begins at given windows.
    pub target: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { shortest: TAU, growth: 4.0, steps: 40, gain: 1e-3, hold: 0, target: f64::INFINITY }
    }
}

/// The result of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The best point.
    pub point: Point,
    /// Steps of all stages together.
    pub steps: usize,
    /// Number of stages.
    pub stages: usize,
    /// Whether the last stage converged.
    pub converged: bool,
    /// Whether it was given up.
    pub given_up: bool,
}

impl Fit {
    /// The factor by which the sum of squares exceeds its degrees of freedom, where that is more than
    /// chance and an error of `doubt` (relative) of the standard errors allow; else 1. Birge (1932),
    /// Physical Review 40, 207: the intervals of a model that does not fit are widened by its root.
    #[must_use]
    pub fn widening(&self, problem: &Problem, doubt: f64) -> f64 {
        let degrees = self.point.degrees(problem).max(1) as f64;
        let ratio = self.point.normal.chi2 / degrees;
        let allowed = 1.0 + 4.0 * (2.0 / degrees + 4.0 * doubt * doubt).sqrt();
        if ratio > allowed { ratio } else { 1.0 }
    }
}

/// Fits the free parameters of `problem`. With `windows` the search begins at these, and at the
/// parameters' starts, with one stage alone.
///
/// # Errors
/// [`Error::Diverges`] where a motion leaves the range of numbers at the start,
/// [`Error::Interrupted`] when `cancel` is set.
pub fn fit(
    problem: &Problem,
    settings: Settings,
    windows: Option<Vec<Window>>,
    cancel: &AtomicBool,
) -> Result<Fit, Error> {
    let Settings { gain, steps, target, .. } = settings;
    let last = Limit { gain, part: 1e-9, steps, target };
    let Some(windows) = windows else {
        // Short windows predict nothing about long ones.
        return widened(problem, settings, Limit { target: f64::INFINITY, ..last }, cancel);
    };
    let held = held(problem, settings);
    let mut point = Point::new(problem, problem.start(), windows).ok_or(Error::Diverges)?;
    let outcome = descend(problem, &mut point, &held, last, cancel)?;
    let Outcome { steps, converged, given_up } = outcome;
    Ok(Fit { point, steps, stages: 1, converged, given_up })
}

/// The parameters that are held fixed.
fn held(problem: &Problem, settings: Settings) -> Vec<usize> {
    (0..settings.hold.min(problem.free.len())).collect()
}

fn widened(
    problem: &Problem,
    settings: Settings,
    last: Limit,
    cancel: &AtomicBool,
) -> Result<Fit, Error> {
    let span = |times: &[f64]| times[times.len() - 1] - times[0];
    let most = problem.records.iter().map(|r| span(&r.times).min(r.longest)).fold(0.0, f64::max);
    let rough = Limit { gain: 0.1, part: 1e-3, ..last };
    let held = held(problem, settings);
    let mut length = settings.shortest.min(most);
    let windows = windows_of(problem, length, |record, at| guess(&problem.records[record], at));
    let windows = settled(problem, &problem.start(), windows, cancel)?;
    let mut point = Point::new(problem, problem.start(), windows).ok_or(Error::Diverges)?;
    let (mut steps, mut stages) = (0, 0);
    loop {
        let limit = if length < most { rough } else { last };
        let mut outcome = descend(problem, &mut point, &held, limit, cancel)?;
        (steps, stages) = (steps + outcome.steps, stages + 1);
        for _ in 0..MOST_SPLITS {
            let Some(split) = split(problem, &point, cancel)? else { break };
            point = split;
            outcome = descend(problem, &mut point, &held, limit, cancel)?;
            steps += outcome.steps;
        }
        if length >= most {
            let converged = outcome.converged;
            return Ok(Fit { point, steps, stages, converged, given_up: false });
        }
        // Not a rest of the record at the end that is much shorter than the others.
        length *= settings.growth;
        if length > 0.6 * most {
            length = most;
        }
        let windows = windows_of(problem, length, states(problem, &point));
        // A curve that was good in parts may be lost as a whole: then the initial states are all
        // that is known.
        let Some(next) = Point::new(problem, point.values.clone(), windows) else {
            return Ok(Fit { point, steps, stages, converged: false, given_up: false });
        };
        point = next;
    }
}

/// The states at the samples of a point's windows; outside windows, from the readings.
fn states<'a>(problem: &'a Problem, point: &'a Point) -> impl FnMut(usize, usize) -> State + 'a {
    |record, at| {
        let within = |w: &Window| w.record == record && (w.from..w.to).contains(&at);
        point.windows.iter().position(within).map_or_else(
            || guess(&problem.records[record], at),
            |k| point.normal.states[k][at - point.windows[k].from],
        )
    }
}

/// The point with windows of outlying residuals split; none if there are none.
fn split(problem: &Problem, point: &Point, cancel: &AtomicBool) -> Result<Option<Point>, Error> {
    let mean = |all: &Vec<f64>| {
        let counted = all.iter().filter(|r| **r != 0.0).count().max(1);
        all.iter().map(|r| r * r).sum::<f64>() / counted as f64
    };
    let means: Vec<f64> = point.normal.residuals.iter().map(mean).collect();
    let mut sorted = means.clone();
    sorted.sort_by(f64::total_cmp);
    let limit = ASTRAY * sorted[(sorted.len() - 1) / 2].max(1.0);
    let mut windows = Vec::with_capacity(means.len());
    for (window, mean) in point.windows.iter().zip(&means) {
        let parts = if *mean > limit { halves(problem, window) } else { None };
        match parts {
            Some(parts) => {
                windows.extend(settled(problem, &point.values, parts.into(), cancel)?);
            }
            None => windows.push(*window),
        }
    }
    if windows.len() == point.windows.len() {
        return Ok(None);
    }
    Ok(Point::new(problem, point.values.clone(), windows))
}

/// The windows with the initial states that fit best at fixed parameters, each by itself: a motion
/// that goes over the top the wrong way would hold up all others. The first of a record is tried at
/// rest too, where friction may hold the pendulum: a fit from any other start stays at another one.
fn settled(
    problem: &Problem,
    values: &[f64],
    windows: Vec<Window>,
    cancel: &AtomicBool,
) -> Result<Vec<Window>, Error> {
    let begins = |window: &Window| {
        let weights = &problem.records[window.record].weights;
        weights[..window.from].iter().all(|weight| *weight == 0.0)
    };
    let settle = |window: Window| {
        let mut best = fit_alone(problem, values, window, SETTLED, cancel)?;
        if begins(&window) {
            let resting = Window { start: [window.start[0], 0.0], ..window };
            let other = fit_alone(problem, values, resting, SETTLED, cancel)?;
            let chi2 = |one: &Option<SingleWindow>| {
                one.as_ref().map_or(f64::INFINITY, |a| a.point.normal.chi2)
            };
            if chi2(&other) < chi2(&best) {
                best = other;
            }
        }
        Ok(best.map_or(window, |found| found.point.windows[0]))
    };
    windows.into_par_iter().map(settle).collect()
}
