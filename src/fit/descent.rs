//! Gauss-Newton steps with Levenberg's and Marquardt's damping, at fixed windows.

use std::sync::atomic::{AtomicBool, Ordering};

use super::normal::{Normal, Step};
use super::problem::Problem;
use super::window::Window;
use crate::error::Error;

/// The first damping that is tried after a step that failed.
const FIRST_DAMPING: f64 = 1e-4;
/// By how much it grows after a failure; it falls by the square of that.
const GROWTH: f64 = 8.0;
/// Beyond this damping no step is left.
const MOST_DAMPING: f64 = 1e8;
/// Times that a descent may go up to come down elsewhere ...
const CROSSINGS: usize = 2;
/// ... in so many steps ...
const UPHILL: usize = 3;
/// ... and to so many times the sum of squares.
const STEEP: f64 = 100.0;

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
        let all = || problem.ways.iter().zip(self.values.iter().zip(&step.values));
        let part = all().map(|(way, (value, by))| way.part(*value, *by)).fold(1.0, f64::min);
        let values = all().map(|(way, (value, by))| way.gone(*value, part * by)).collect();
        let mut windows = self.windows.clone();
        for (window, step) in windows.iter_mut().zip(&step.starts) {
            window.start[0] += part * step[0];
            window.start[1] += part * step[1];
        }
        Self::new(problem, values, windows).ok()
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
    let (mut damping, mut steps, mut crossings) = (0.0, 0, CROSSINGS);
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
        steps += 1;
        let next = point.moved(problem, &step);
        let across = match &next {
            Some(high) if damping == 0.0 && high.normal.chi2 >= chi2 && crossings > 0 => {
                crossings -= 1;
                across(problem, high, held, chi2, &mut steps)
            }
            _ => None,
        };
        match across.or(next) {
            Some(next) if next.normal.chi2 < chi2 => {
                let fair = chi2 - next.normal.chi2 > 0.25 * step.gain;
                *point = next;
                if fair {
                    damping =
                        if damping > FIRST_DAMPING { damping / (GROWTH * GROWTH) } else { 0.0 };
                }
            }
            _ => {
                damping = (damping * GROWTH).max(FIRST_DAMPING);
                // At a kink, as where a half swing more or less is made before the last stop, the
                // sum of squares has a least value without being flat.
                if step.gain <= limit.gain + limit.part * chi2 || damping > MOST_DAMPING {
                    return Ok(Outcome { steps, converged: true });
                }
            }
        }
    }
}

/// Whole steps, from where one has led up, until they lead below `chi2`.
///
/// Out of a valley that is narrow and bent the way leads over its side, where steps that only lead
/// down creep along the bottom (the watchdog of Chamberlain, Powell, Lemarechal & Pedersen 1982,
/// Mathematical Programming Studies 16, 1).
fn across(
    problem: &Problem,
    high: &Point,
    held: &[usize],
    chi2: f64,
    steps: &mut usize,
) -> Option<Point> {
    let mut point = high.clone();
    for _ in 0..UPHILL {
        if point.normal.chi2 > STEEP * chi2 {
            return None;
        }
        *steps += 1;
        point = point.moved(problem, &point.normal.step(0.0, held))?;
        if point.normal.chi2 < chi2 {
            return Some(point);
        }
    }
    None
}
