//! One trajectory, sampled at equal times.

use std::sync::atomic::{AtomicBool, Ordering};

use super::accuracy::{PERIODS, TOLERANCES};
use super::schedule::Schedule;
use super::step::Moving;
use super::stroboscopic::State;
use super::tangent::Tangent;
use crate::error::Error;
use crate::lanes::sine::Fine;
use crate::model::Pendulum;

/// Longest step, in units of 1/sqrt(1 + |p|).
const LONGEST_STEP: f64 = 0.25;
/// Steps between two samples at the most.
const MOST_SUBSTEPS: usize = 4096;
/// Errors below this may be those of rounding, amplified by the motion.
const ROUNDING: f64 = 1e-7;
/// Batches whose spread gives the standard error of an exponent.
const BATCHES: usize = 20;
/// The part of a trajectory that turns the tangent into the direction of growth.
const ALIGNMENT: f64 = 0.1;

/// A sampled trajectory.
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    /// Times of the samples.
    pub time: Vec<f64>,
    /// Angles, not wrapped, rad.
    pub theta: Vec<f64>,
    /// Velocities.
    pub velocity: Vec<f64>,
    /// Distance that halving the step makes after five periods, or at the end if that is sooner.
    pub reached_error: f64,
    /// The same at the end.
    pub end_error: f64,
    /// Steps a period.
    pub steps: usize,
    /// Largest Lyapunov exponent per unit of tau and its standard error, where asked for.
    pub exponent: Option<(f64, f64)>,
}

/// What to compute.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Angle and velocity at `tau = 0`.
    pub start: State,
    /// The last time.
    pub until: f64,
    /// The error after five periods.
    pub tol: f64,
    /// Samples a period.
    pub samples: usize,
    /// Whether the exponent is wanted.
    pub lyapunov: bool,
}

/// Integrates with a step that is halved until `tol` is met or rounding forbids more; the result
/// says what was reached.
///
/// # Errors
/// [`Error::Range`] for a value that is not finite or outside its range, [`Error::Interrupted`] if
/// `cancel` was set.
pub fn simulate(
    pendulum: &Pendulum,
    request: &Request,
    cancel: &AtomicBool,
) -> Result<Trajectory, Error> {
    let finite = "any finite number";
    for (name, value) in [("theta", request.start[0]), ("velocity", request.start[1])] {
        if !value.is_finite() {
            return Err(Error::Range { name, value, allowed: finite });
        }
    }
    if !(request.until.is_finite() && request.until > 0.0) {
        return Err(Error::Range {
            name: "until",
            value: request.until,
            allowed: "a time above 0",
        });
    }
    if !(TOLERANCES[0]..=TOLERANCES[1]).contains(&request.tol) {
        return Err(Error::Range { name: "tol", value: request.tol, allowed: "1e-13 to 1e-2" });
    }
    if request.samples == 0 {
        return Err(Error::Range { name: "samples", value: 0.0, allowed: "1 or more" });
    }
    let interval = pendulum.period() / request.samples as f64;
    let longest = LONGEST_STEP / pendulum.greatest_pull().sqrt();
    let mut substeps = (interval / longest).ceil().max(1.0) as usize;
    let mut coarse = Run::of(pendulum, request, substeps, cancel)?;
    let mut before = f64::INFINITY;
    loop {
        let fine = Run::of(pendulum, request, 2 * substeps, cancel)?;
        let last = fine.theta.len() - 1;
        let distance = |i: usize| {
            (fine.theta[i] - coarse.theta[i]).hypot(fine.velocity[i] - coarse.velocity[i])
        };
        let error = distance((PERIODS * request.samples).min(last));
        let end_error = distance(last);
        // Where halving no longer helps, rounding is all that is left, and more steps make more.
        let rounding = error < ROUNDING && error > 0.25 * before;
        if rounding || !error.is_finite() {
            return Ok(coarse.finish(pendulum, request, substeps, error, end_error));
        }
        substeps *= 2;
        if error <= request.tol || substeps >= MOST_SUBSTEPS {
            return Ok(fine.finish(pendulum, request, substeps, error, end_error));
        }
        (coarse, before) = (fine, error);
    }
}

#[derive(Default)]
struct Run {
    time: Vec<f64>,
    theta: Vec<f64>,
    velocity: Vec<f64>,
    /// Logarithms of the tangent's growth, one a sample.
    growth: Vec<f64>,
}

impl Run {
    fn of(
        pendulum: &Pendulum,
        request: &Request,
        substeps: usize,
        cancel: &AtomicBool,
    ) -> Result<Self, Error> {
        let period = pendulum.period();
        let interval = period / request.samples as f64;
        let whole = (request.until / interval * (1.0 + 1e-14)).floor() as usize;
        let schedules: Vec<Schedule> = (0..request.samples.min(whole.max(1)))
            .map(|k| Schedule::new(pendulum, k as f64 * interval, interval, substeps))
            .collect();
        let mut run = Self::default();
        let mut state = request.start;
        let mut tangent = [std::f64::consts::FRAC_1_SQRT_2; 2];
        run.push(0.0, state, 0.0);
        for k in 0..whole {
            if cancel.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let schedule = &schedules[k % schedules.len()];
            let growth = advance(schedule, &mut state, &mut tangent, request.lyapunov);
            run.push((k + 1) as f64 * interval, state, growth);
        }
        let done = whole as f64 * interval;
        let rest = request.until - done;
        if rest > 1e-12 * request.until.max(interval) {
            let phase = (whole % request.samples) as f64 * interval;
            let steps = (substeps as f64 * rest / interval).ceil().max(1.0) as usize;
            let schedule = Schedule::new(pendulum, phase, rest, steps);
            let growth = advance(&schedule, &mut state, &mut tangent, request.lyapunov);
            run.push(request.until, state, growth);
        }
        Ok(run)
    }

    fn push(&mut self, time: f64, state: State, growth: f64) {
        self.time.push(time);
        self.theta.push(state[0]);
        self.velocity.push(state[1]);
        self.growth.push(growth);
    }

    fn finish(
        self,
        pendulum: &Pendulum,
        request: &Request,
        substeps: usize,
        reached_error: f64,
        end_error: f64,
    ) -> Trajectory {
        let interval = pendulum.period() / request.samples as f64;
        let exponent = request.lyapunov.then(|| batch_means(&self.growth, interval));
        Trajectory {
            time: self.time,
            theta: self.theta,
            velocity: self.velocity,
            reached_error,
            end_error,
            steps: substeps * request.samples,
            exponent,
        }
    }
}

/// One schedule on; the logarithm of the tangent's growth, 0 where it is not wanted.
fn advance(schedule: &Schedule, state: &mut State, tangent: &mut [f64; 2], grow: bool) -> f64 {
    if !grow {
        let mut moving = Moving::new(schedule, state[0], state[1]);
        moving.run::<Fine>(schedule);
        *state = [moving.theta(), moving.velocity(schedule)];
        return 0.0;
    }
    let theta = Tangent { value: state[0], slope: [tangent[0]] };
    let velocity = Tangent { value: state[1], slope: [tangent[1]] };
    let mut moving = Moving::new(schedule, theta, velocity);
    moving.run::<Fine>(schedule);
    let velocity = moving.velocity(schedule);
    let theta = moving.theta();
    *state = [theta.value, velocity.value];
    let grown = [theta.slope[0], velocity.slope[0]];
    let length = grown[0].hypot(grown[1]);
    *tangent = [grown[0] / length, grown[1] / length];
    length.ln()
}

/// Mean growth rate after the alignment, and its standard error from the spread of batches.
fn batch_means(growth: &[f64], interval: f64) -> (f64, f64) {
    let used = &growth[(ALIGNMENT * growth.len() as f64) as usize..];
    let size = (used.len() / BATCHES).max(1);
    let means: Vec<f64> = used
        .chunks_exact(size)
        .map(|batch| batch.iter().sum::<f64>() / (size as f64 * interval))
        .collect();
    let count = means.len() as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean, (variance / count).sqrt())
}
