//! Gauss-Newton steps with Levenberg's and Marquardt's damping, at fixed windows.

use std::sync::atomic::{AtomicBool, Ordering};

use super::normal::{Normal, Step};
use super::problem::Problem;
use super::way::Way;
use super::window::Window;
use crate::error::Error;

/// The first damping that is tried after a step that failed.
const FIRST_DAMPING: f64 = 1e-4;
/// By how much it grows after a failure; it falls by the square of that.
const GROWTH: f64 = 8.0;
/// The part of what a step promised that it must gain for no other way to be tried.
const KEPT: f64 = 0.75;
/// The most steps by which all else follows the widths.
const FOLLOWED: usize = 2;
/// The part of what a step promised that such a step has to promise.
const FOLLOWED_GAIN: f64 = 0.1;
/// Beyond this damping no step is left.
const MOST_DAMPING: f64 = 1e8;

/// A point of the search.
#[derive(Clone, Debug)]
pub struct Point {
    /// Values of the free parameters.
    pub values: Vec<f64>,
    /// Windows with their initial states.
    pub windows: Vec<Window>,
    /// The equations there.
    pub normal: Normal,
}

impl Point {
    /// The point at `values`.
    ///
    /// # Errors
    /// [`Error::Diverges`] where a motion leaves the range of numbers, or a value is out of range.
    pub fn new(problem: &Problem, values: Vec<f64>, windows: Vec<Window>) -> Result<Self, Error> {
        let normal = Normal::at(problem, &values, &windows).ok_or(Error::Diverges)?;
        Ok(Self { values, windows, normal })
    }

    /// The samples that count, less the parameters and initial states that were adapted to them.
    #[must_use]
    pub fn degrees(&self, problem: &Problem) -> usize {
        problem.samples().saturating_sub(self.values.len() + 2 * self.windows.len())
    }

    /// The point a step further; none where it cannot be.
    #[must_use]
    pub fn moved(&self, problem: &Problem, step: &Step) -> Option<Self> {
        self.gone(problem, step, |_| Way::Straight)
    }

    fn gone(&self, problem: &Problem, step: &Step, way: impl Fn(usize) -> Way) -> Option<Self> {
        let all = || self.values.iter().zip(&step.values).enumerate();
        let part = all().map(|(k, (value, by))| way(k).part(*value, *by)).fold(1.0, f64::min);
        let values = all().map(|(k, (value, by))| way(k).gone(*value, part * by)).collect();
        let mut windows = self.windows.clone();
        for (window, step) in windows.iter_mut().zip(&step.starts) {
            window.start[0] += part * step[0];
            window.start[1] += part * step[1];
        }
        Self::new(problem, values, windows).ok()
    }

    /// The point a step further if it is lower, and how many were tried: straight; where that leads
    /// less far down than it promised in ratios too, all else following the widths.
    fn lower(&self, problem: &Problem, step: &Step, held: &[usize]) -> (usize, Option<Self>) {
        let chi2 = self.normal.chi2;
        let straight = self.moved(problem, step).filter(|next| next.normal.chi2 < chi2);
        let kept = straight.as_ref().is_some_and(|p| chi2 - p.normal.chi2 > KEPT * step.gain);
        let widths = || (0..problem.ways.len()).filter(|k| problem.ways[*k] == Way::Width);
        if kept || widths().next().is_none() {
            return (1, straight);
        }
        let Some(bent) = self.gone(problem, step, |place| problem.ways[place]) else {
            return (2, straight);
        };
        let held: Vec<usize> = held.iter().copied().chain(widths()).collect();
        let (followed, bent) = bent.followed(problem, &held, FOLLOWED_GAIN * step.gain);
        let best = straight.as_ref().map_or(chi2, |point| point.normal.chi2);
        (2 + followed, if bent.normal.chi2 < best { Some(bent) } else { straight })
    }

    /// The point to which all but `held` follows, and how many were tried, while steps gain `enough`.
    ///
    /// A step that is too long for the widths leads up only because sizes and initial states, which
    /// go with them nearly linearly, are not yet those of the new widths.
    fn followed(mut self, problem: &Problem, held: &[usize], enough: f64) -> (usize, Self) {
        for tried in 0..FOLLOWED {
            let step = self.normal.step(0.0, held);
            if step.gain < enough {
                return (tried, self);
            }
            match self.moved(problem, &step) {
                Some(next) if next.normal.chi2 < self.normal.chi2 => self = next,
                _ => return (tried + 1, self),
            }
        }
        (FOLLOWED, self)
    }
}

/// How far to go.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// The gain in the sum of squares, expected of the next step, at which it is over ...
    pub gain: f64,
    /// ... or the part of the sum of squares that this is.
    pub part: f64,
    /// The most steps.
    pub steps: usize,
}

/// How a descent ended.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Points at which the equations were set up.
    pub steps: usize,
    /// Whether the limit was reached, or no step leads further down.
    pub converged: bool,
}

/// Goes down from `point`, parameters `held` kept where they are.
///
/// # Errors
/// [`Error::Interrupted`] when `cancel` is set.
pub fn descend(
    problem: &Problem,
    point: &mut Point,
    held: &[usize],
    limit: Limit,
    cancel: &AtomicBool,
) -> Result<Outcome, Error> {
    let (mut damping, mut steps) = (0.0, 0);
    loop {
        if cancel.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let chi2 = point.normal.chi2;
        let step = point.normal.step(damping, held);
        if damping == 0.0 && step.gain <= limit.gain + limit.part * chi2 {
            // The last step costs one more point and is worth it: what is left is its square.
            if let Some(next) = point.moved(problem, &step).filter(|next| next.normal.chi2 <= chi2)
            {
                *point = next;
            }
            return Ok(Outcome { steps: steps + 1, converged: true });
        }
        if steps >= limit.steps {
            return Ok(Outcome { steps, converged: false });
        }
        let (tried, next) = point.lower(problem, &step, held);
        steps += tried;
        if let Some(next) = next {
            let fair = chi2 - next.normal.chi2 > 0.25 * step.gain;
            *point = next;
            if fair {
                damping = if damping > FIRST_DAMPING { damping / (GROWTH * GROWTH) } else { 0.0 };
            }
        } else {
            damping = (damping * GROWTH).max(FIRST_DAMPING);
            // At a kink, as where a half swing more or less is made before the last stop, the sum
            // of squares has a least value without being flat.
            if step.gain <= limit.gain + limit.part * chi2 || damping > MOST_DAMPING {
                return Ok(Outcome { steps, converged: true });
            }
        }
    }
}
