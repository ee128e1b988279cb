//! Simulated readings of a record's pendulum from many starts at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::record::Record;
use crate::error::Error;
use crate::integrate::State;
use crate::integrate::reference::problem::{OdeProblem, greatest_rate};
use crate::integrate::reference::sample::sample;
use crate::model::Observation;

/// Readings of the sensor of the angle at `times`, rad and not wrapped, of the pendulum of `record` under
/// its drive and its pivot's motion, from each of `starts` at the first of these times; with an error
/// of `tolerance` a step; `done` is called after each. Not numbers after a motion left their range.
///
/// # Errors
/// [`Error::Range`] for times that fall, [`Error::Interrupted`] if `cancel` was set.
pub fn replay(
    record: &Record,
    starts: &[State],
    times: &[f64],
    tolerance: f64,
    cancel: &AtomicBool,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Vec<f64>>, Error> {
    let falls = times.windows(2).find(|pair| pair[1].is_nan() || pair[1] < pair[0]);
    if let Some(pair) = falls {
        let allowed = "a time not before the last one";
        return Err(Error::Range { name: "time", value: pair[1], allowed });
    }
    let pendulum = &record.pendulum;
    let rate = greatest_rate(pendulum);
    let observation = Observation::lift(pendulum, |_, value| value);
    let begin = times.first().copied().unwrap_or(0.0);
    let goes_on = || !cancel.load(Ordering::Relaxed);
    let one = |start: &State| {
        let mut ode = OdeProblem::with_rate(pendulum, rate, true, tolerance, |_, value| value);
        if let Some(recorded) = &record.recorded {
            ode = ode.driven_by(Arc::clone(recorded));
        }
        let run = sample(&ode, begin, *start, times, |_, _| goes_on());
        if !goes_on() {
            return Err(Error::Interrupted);
        }
        done();
        let reading = |(k, tau): (usize, &f64)| {
            observation.read(run.given(&ode, k), run.states[k][1], pendulum.lab_time + tau)
        };
        Ok(times.iter().enumerate().map(reading).collect())
    };
    starts.par_iter().map(one).collect()
}
