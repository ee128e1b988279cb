//! One trajectory, sampled at equal times.

use std::f64::consts::FRAC_1_SQRT_2;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};

use super::accuracy::{PERIODS, TOLERANCES};
use super::reference::event::{Event, EventKind};
use super::reference::problem::{FINEST, OdeProblem};
use super::reference::sample::{Sampled, sample};
use super::states::State;
use super::tangent::{Number, Tangent};
use crate::error::Error;
use crate::memory;
use crate::model::Pendulum;

/// The error of a step in the first attempt, over the tolerance.
const FIRST_TRY: f64 = 0.1;
/// Factor by which the error of a step is tightened to measure the effect on the result.
const TIGHTENING: f64 = 16.0;
/// Errors below this may be those of rounding, amplified by the motion.
const ROUNDING: f64 = 1e-7;
/// Larger angles are shifted by a number of whole turns.
const FAR: f64 = 100.0;
/// Memory of a sample, bytes: time, state, the tangent's quantities, and their copies.
const EACH: usize = 120;
/// Upper estimate of the events in a period, each as large as a sample.
const EVENTS: usize = 4;
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
    /// Distance that a 16 times smaller error of each step makes after five periods, or at the end
    /// if that is sooner.
    pub reached_error: f64,
    /// The error at the end.
    pub end_error: f64,
    /// Steps a period, on average.
    pub steps: usize,
    /// Largest Lyapunov exponent per unit of tau and its standard error, if requested; none if the
    /// tangent vanishes, as it may when the pendulum sticks.
    pub exponent: Option<(f64, f64)>,
    /// Whether friction holds the pendulum at the end.
    pub stuck: bool,
    /// Turns, sticks and releases.
    pub events: Vec<Event>,
    /// Whether it was stopped before its last time; the error at its end is unknown then.
    pub interrupted: bool,
}

/// A request for a trajectory.
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
    /// Whether the exponent is requested.
    pub lyapunov: bool,
}

/// Integrates with steps that are tightened until `tol` is met or rounding forbids more; the result
/// says what was reached. Time in the laboratory goes on.
///
/// # Errors
/// [`Error::Range`] for a value that is not finite or outside its range, [`Error::Memory`] for too many
/// samples, [`Error::Interrupted`] if `cancel` was set.
pub fn simulate(
    pendulum: &Pendulum,
    request: &Request,
    cancel: &AtomicBool,
) -> Result<Trajectory, Error> {
    let run = simulate_live(pendulum, request, &[], cancel, &mut |_, _| ())?;
    if cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(run) }
}

/// Computes a trajectory and shows each sample, with its time, to `seen` as soon as it is known. If
/// `cancel` is set after the first sample, the trajectory ends with the last one.
///
/// `times`, if there are any, are those of the samples: they rise from 0 to the request's last time.
///
/// # Errors
/// Those of [`simulate`]; [`Error::Interrupted`] only before there is a sample.
pub fn simulate_live(
    pendulum: &Pendulum,
    request: &Request,
    times: &[f64],
    cancel: &AtomicBool,
    seen: &mut dyn FnMut(f64, State),
) -> Result<Trajectory, Error> {
    check(request)?;
    // Far from 0 the steps would be below the resolution of the angle: whole turns are stored
    // separately.
    let far = request.start[0].abs() > FAR && pendulum.repeats_every_turn();
    let turns = if far { TAU * (request.start[0] / TAU).round() } else { 0.0 };
    let start = [request.start[0] - turns, request.start[1]];
    let nearer = Request { start, ..*request };
    let mut shown = |time: f64, [theta, velocity]: State| seen(time, [theta + turns, velocity]);
    let mut trajectory = from(pendulum, &nearer, times, cancel, &mut shown)?;
    if far {
        for theta in &mut trajectory.theta {
            *theta += turns;
        }
        for event in &mut trajectory.events {
            event.theta += turns;
        }
    }
    Ok(trajectory)
}

fn from(
    pendulum: &Pendulum,
    request: &Request,
    chosen: &[f64],
    cancel: &AtomicBool,
    seen: &mut dyn FnMut(f64, State),
) -> Result<Trajectory, Error> {
    let (tolerance, reached_error) = choose(pendulum, request, cancel)?;
    let interval = pendulum.period() / request.samples as f64;
    let count = (request.until / interval) as usize;
    let events = EVENTS.saturating_mul((request.until / pendulum.period()) as usize);
    memory::reckon("samples", count.saturating_add(events), EACH)?;
    let mut time = if chosen.is_empty() { times(request.until, interval) } else { chosen.to_vec() };
    seen(time[0], request.start);
    let mut known = 1;
    let mut show = |new: &mut dyn Iterator<Item = State>| {
        for state in new {
            seen(time[known], state);
            known += 1;
        }
    };
    let (mut run, mut growth) = if request.lyapunov {
        Run::stretched(pendulum, request, &time, tolerance, cancel, &mut show)
    } else {
        (Run::to(pendulum, request, &time, tolerance, cancel, &mut show), Vec::new())
    };
    let interrupted = known < time.len() && cancel.load(Ordering::Relaxed);
    if interrupted {
        time.truncate(known);
        run.states.truncate(known);
        growth.truncate(known - 1);
    }
    let end = run.states[run.states.len() - 1];
    if !(end[0].is_finite() && end[1].is_finite()) {
        return Err(Error::Diverges);
    }
    let last = time[time.len() - 1];
    // Events of the last, unfinished step lie beyond the last sample.
    run.events.retain(|event| !interrupted || event.tau <= last);
    let coarse = Run::to(pendulum, request, &[last], TIGHTENING * tolerance, cancel, &mut |_| ());
    let unknown = cancel.load(Ordering::Relaxed);
    let periods = last / pendulum.period();
    // States that are held for ever neither diverge nor converge.
    let held = run.events.last().is_some_and(|e| e.kind == EventKind::StuckForEver);
    Ok(Trajectory {
        theta: run.states.iter().map(|state| state[0]).collect(),
        velocity: run.states.iter().map(|state| state[1]).collect(),
        reached_error,
        end_error: if unknown { f64::NAN } else { distance(end, coarse.states[0]) },
        steps: if periods > 0.0 { (run.steps as f64 / periods).ceil() as usize } else { 0 },
        exponent: if held { None } else { batch_means(&growth, interval) },
        stuck: run.stuck,
        events: run.events,
        interrupted,
        time,
    })
}

fn check(request: &Request) -> Result<(), Error> {
    let Request { start, until, tol, samples, .. } = *request;
    for (name, value) in [("theta", start[0]), ("velocity", start[1])] {
        if !value.is_finite() {
            return Err(Error::Range { name, value, allowed: "a finite number" });
        }
    }
    if !(until.is_finite() && until > 0.0) {
        return Err(Error::Range { name: "until", value: until, allowed: "a time above 0" });
    }
    if !(TOLERANCES[0]..=TOLERANCES[1]).contains(&tol) {
        return Err(Error::Range {
            name: "tol",
            value: tol,
            allowed: "a number from 1e-13 to 1e-2",
        });
    }
    if samples == 0 {
        return Err(Error::Range { name: "samples", value: 0.0, allowed: "1 or more" });
    }
    Ok(())
}

/// The error of a step that meets the request's tolerance after five periods, and the change of the
/// result by it.
fn choose(
    pendulum: &Pendulum,
    request: &Request,
    cancel: &AtomicBool,
) -> Result<(f64, f64), Error> {
    let until = request.until.min(PERIODS as f64 * pendulum.period());
    let end = |tolerance: f64| {
        let run = Run::to(pendulum, request, &[until], tolerance, cancel, &mut |_| ());
        if cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(run.states[0]) }
    };
    let mut tolerance = FIRST_TRY * request.tol;
    let (mut coarse, mut before) = (end(tolerance)?, f64::INFINITY);
    loop {
        tolerance /= TIGHTENING;
        let fine = end(tolerance)?;
        let error = distance(fine, coarse);
        // If tightening no longer helps, the remaining error is rounding.
        let rounding = error < ROUNDING && error > 0.25 * before;
        if error <= request.tol || rounding || !error.is_finite() || tolerance <= FINEST {
            return Ok((tolerance, error));
        }
        (coarse, before) = (fine, error);
    }
}

/// The multiples of the interval up to `until`, and `until`.
fn times(until: f64, interval: f64) -> Vec<f64> {
    let whole = (until / interval * (1.0 + 1e-14)).floor() as usize;
    let mut times: Vec<f64> = (0..=whole).map(|k| (k as f64 * interval).min(until)).collect();
    if until - whole as f64 * interval > 1e-12 * until.max(interval) {
        times.push(until);
    }
    times
}

fn distance(a: State, b: State) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

type Run = Sampled<f64>;

/// Adds the states of new samples.
type Show<'a> = &'a mut dyn FnMut(&mut dyn Iterator<Item = State>);

impl Run {
    fn to(
        pendulum: &Pendulum,
        request: &Request,
        times: &[f64],
        tolerance: f64,
        cancel: &AtomicBool,
        show: Show<'_>,
    ) -> Self {
        let ode = OdeProblem::new(pendulum, true, tolerance, |_, value| value).finding_turns();
        sample(&ode, 0.0, request.start, times, |_, new| {
            show(&mut new.iter().copied());
            !cancel.load(Ordering::Relaxed)
        })
    }

    /// The samples, and the growth of a tangent from sample to sample, as logarithms.
    fn stretched(
        pendulum: &Pendulum,
        request: &Request,
        times: &[f64],
        tolerance: f64,
        cancel: &AtomicBool,
        show: Show<'_>,
    ) -> (Self, Vec<f64>) {
        let constant = |_, value| Tangent::<f64, 1>::constant(value);
        let ode = OdeProblem::new(pendulum, true, tolerance, constant).finding_turns();
        let start = request.start.map(|value| Tangent { value, slope: [FRAC_1_SQRT_2] });
        let (mut lengths, mut scale) = (vec![0.0], 0.0);
        let run = sample(&ode, 0.0, start, times, |driver, new| {
            show(&mut new.iter().map(|state| state.map(Number::value)));
            lengths.extend(new.iter().map(|state| scale + length(state).ln()));
            // Held near 1, so that it neither overflows nor vanishes.
            let now = length(&driver.state);
            if now > 0.0 && now.is_finite() {
                scale += now.ln();
                driver.scale_derivatives(1.0 / now);
            }
            !cancel.load(Ordering::Relaxed)
        });
        let growth = lengths.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let states = run.states.iter().map(|state| state.map(Number::value)).collect();
        let pasts = run.pasts.iter().map(|past| past.map(Number::value)).collect();
        let Sampled { signs, events, stuck, steps, .. } = run;
        (Self { states, signs, pasts, events, stuck, steps }, growth)
    }
}

fn length([theta, velocity]: &[Tangent<f64, 1>; 2]) -> f64 {
    theta.slope[0].hypot(velocity.slope[0])
}

/// Mean growth rate after the alignment, and its standard error from the spread of batches; none
/// where the tangent was lost.
fn batch_means(growth: &[f64], interval: f64) -> Option<(f64, f64)> {
    let used = &growth[(ALIGNMENT * growth.len() as f64) as usize..];
    let size = (used.len() / BATCHES).max(1);
    let means: Vec<f64> = used
        .chunks_exact(size)
        .map(|batch| batch.iter().sum::<f64>() / (size as f64 * interval))
        .collect();
    let count = means.len() as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    mean.is_finite().then(|| (mean, (variance / count).sqrt()))
}
