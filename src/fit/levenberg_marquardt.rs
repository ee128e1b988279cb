//! The Levenberg-Marquardt method at fixed windows.

use std::sync::atomic::AtomicBool;

use super::normal::{Normal, Step};
use super::problem::Problem;
use super::single_window::relax;
use super::step_scale::StepScale;
use super::window::Window;
use crate::error::{Error, unless_cancelled};

/// The first damping tried after a step that failed.
const FIRST_DAMPING: f64 = 1e-4;
/// Factor of the damping after a failure; after a good step it falls by the square of that.
const GROWTH: f64 = 8.0;
/// Part of the predicted gain above which a step is good.
const FAIR: f64 = 0.25;
/// Part of the predicted gain above which no other scale is tried.
const KEPT: f64 = 0.75;
/// Largest number of steps in which the other parameters follow the widths.
const FOLLOWED: usize = 2;
/// Part of the predicted gain that each of these steps must predict.
const FOLLOWED_GAIN: f64 = 0.1;
/// Number of accepted steps after which a descent may be given up.
const TRIED: usize = 3;
/// A descent may be given up if the next step predicts at most this part of the last gain.
const SHRINKS: f64 = 0.5;
/// Upper bound on the total further gain, as a multiple of the predicted gain of the next step.
const HOPE: f64 = 3.0;
/// Damping above which the steps are too short to matter.
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
    /// Predicted gain of initial states that no step realises: at a kink, for example where friction
    /// just holds, the gradient does not vanish at the minimum.
    pub(super) in_vain: f64,
}

impl Point {
    /// The point at `values`; none where a motion leaves the range of numbers, or a value is out of
    /// range.
    #[must_use]
    pub fn new(problem: &Problem, values: Vec<f64>, windows: Vec<Window>) -> Option<Self> {
        let normal = Normal::at(problem, &values, &windows)?;
        Some(Self { values, windows, normal, in_vain: 0.0 })
    }

    /// The number of samples with nonzero weight, less that of parameters and initial states
    /// adapted to them.
    #[must_use]
    pub fn degrees(&self, problem: &Problem) -> usize {
        problem.samples().saturating_sub(self.values.len() + 2 * self.windows.len())
    }

    /// The bounds of each parameter.
    fn ends(&self, problem: &Problem) -> Vec<[f64; 2]> {
        let both = self.values.iter().zip(&problem.ranges);
        both.map(|(value, [low, high])| [(low - value).min(0.0), (high - value).max(0.0)]).collect()
    }

    /// The point after a step; none if it cannot be computed.
    #[must_use]
    pub fn moved(&self, problem: &Problem, step: &Step) -> Option<Self> {
        self.gone(problem, step, |_| StepScale::Linear)
    }

    fn gone(
        &self,
        problem: &Problem,
        step: &Step,
        scale: impl Fn(usize) -> StepScale,
    ) -> Option<Self> {
        let all = || self.values.iter().zip(&step.values).enumerate();
        let part = all().map(|(k, (value, by))| scale(k).part(*value, *by)).fold(1.0, f64::min);
        let gone = |(k, (value, by)): (usize, (&f64, &f64))| {
            let [low, high] = problem.ranges[k];
            scale(k).gone(*value, part * by).clamp(low, high)
        };
        let values = all().map(gone).collect();
        let mut windows = self.windows.clone();
        for (window, step) in windows.iter_mut().zip(&step.starts) {
            window.start[0] += part * step[0];
            window.start[1] += part * step[1];
        }
        Self::new(problem, values, windows)
    }

    /// The point after a step if it is lower, and the number of points tried: a linear step; if
    /// that gains less than predicted, a logarithmic one too, with all other parameters following
    /// the widths.
    fn lower(
        &mut self,
        problem: &Problem,
        step: &Step,
        held: &[usize],
        cancel: &AtomicBool,
    ) -> Result<(usize, Option<Self>), Error> {
        let chi2 = self.normal.chi2;
        let lower = |next: &Self| next.normal.chi2 < chi2;
        let keeps = |next: &Self, part: f64| chi2 - next.normal.chi2 > part * step.gain;
        let widths =
            || (0..problem.scales.len()).filter(|k| problem.scales[*k] == StepScale::Width);
        let mut straight = self.moved(problem, step);
        if straight.as_ref().is_some_and(|next| keeps(next, KEPT)) {
            return Ok((1, straight));
        }
        let (mut tried, mut bent) = (1, None);
        if widths().next().is_some() {
            tried += 1;
            if let Some(next) = self.gone(problem, step, |place| problem.scales[place]) {
                let held: Vec<usize> = held.iter().copied().chain(widths()).collect();
                let (more, next) = next.followed(problem, &held, FOLLOWED_GAIN * step.gain);
                tried += more;
                bent = Some(next).filter(lower);
            }
        }
        let fair = |next: &Self| keeps(next, FAIR);
        if let Some(next) = straight.as_mut().filter(|next| !fair(next))
            && !bent.as_ref().is_some_and(fair)
        {
            relax(problem, next, self, step, cancel)?;
            self.in_vain = next.in_vain;
        }
        let both = straight.filter(lower).into_iter().chain(bent);
        Ok((tried, both.min_by(|a, b| a.normal.chi2.total_cmp(&b.normal.chi2))))
    }

    /// The point to which all but `held` follows, and the number tried, while steps gain `enough`.
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

/// The criteria for the end of a descent.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// Predicted gain of the next step in the sum of squares at which the descent ends.
    pub gain: f64,
    /// Part of the sum of squares that a gain must exceed for the descent to go on.
    pub part: f64,
    /// Largest number of steps.
    pub steps: usize,
    /// The sum of squares to be reached: a descent that cannot come near it is given up; infinite where
    /// every descent is worth it.
    pub target: f64,
}

/// How a descent ended.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Number of points at which the equations were set up.
    pub steps: usize,
    /// Whether the limit was reached, or no step decreases the sum further.
    pub converged: bool,
    /// Whether it was given up, as it cannot come near [`Limit::target`].
    pub given_up: bool,
}

/// Descends from `point`, with the parameters `held` fixed.
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
    let (mut damping, mut steps, mut down, mut fell) = (0.0, 0, 0, 0.0);
    let ended = |steps, converged| Ok(Outcome { steps, converged, given_up: false });
    loop {
        unless_cancelled(cancel)?;
        let chi2 = point.normal.chi2;
        let step = point.normal.step_between(damping, held, &point.ends(problem));
        let promised = step.gain - point.in_vain;
        if damping == 0.0 && promised <= limit.gain + limit.part * chi2 {
            // One more step: the error after it is of second order.
            if let Some(next) = point.moved(problem, &step).filter(|next| next.normal.chi2 <= chi2)
            {
                *point = next;
            }
            return ended(steps + 1, true);
        }
        let settles = damping == 0.0 && down >= TRIED && promised < SHRINKS * fell;
        if settles && chi2 - HOPE * promised > limit.target {
            return Ok(Outcome { steps, converged: false, given_up: true });
        }
        if steps >= limit.steps {
            return ended(steps, false);
        }
        let (tried, next) = point.lower(problem, &step, held, cancel)?;
        steps += tried;
        if let Some(next) = next {
            fell = chi2 - next.normal.chi2;
            let fair = fell > FAIR * step.gain;
            *point = next;
            down += 1;
            if fair {
                damping = if damping > FIRST_DAMPING { damping / (GROWTH * GROWTH) } else { 0.0 };
            }
        } else {
            damping = (damping * GROWTH).max(FIRST_DAMPING);
            // At a kink, as where a half swing more or less is made before the last stop, the sum
            // of squares has a least value without being flat.
            if promised <= limit.gain + limit.part * chi2 || damping > MOST_DAMPING {
                return ended(steps, true);
            }
        }
    }
}
