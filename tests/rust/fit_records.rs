//! Records without noise, for the tests of fits.

use std::sync::Arc;

use pendmap::fit::linear::{Linear, linearise};
use pendmap::fit::window::Window;
use pendmap::fit::{Free, Problem, Record, Slot};
use pendmap::integrate::State;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::integrate::reference::sample::sample;
use pendmap::model::{Effect, Kind, Observation, Pendulum, Recorded};

/// Error tolerance of a step.
pub const TOLERANCE: f64 = 1e-13;

/// Times starting at 0.
pub fn every(interval: f64, until: f64) -> Vec<f64> {
    (0..=(until / interval) as usize).map(|k| k as f64 * interval).collect()
}

/// A pendulum with effects.
pub fn with(pendulum: Pendulum, effects: &[(Kind, &[f64])]) -> Pendulum {
    effects.iter().fold(pendulum, |pendulum, (kind, values)| {
        pendulum.with_effect(Effect::new(kind.clone(), values).expect("in range")).expect("once")
    })
}

/// A record of `pendulum` without noise.
pub fn record(
    pendulum: Pendulum,
    recorded: Option<Arc<Recorded>>,
    start: State,
    until: f64,
) -> Record {
    let times = every(0.06, until);
    let mut ode = OdeProblem::new(&pendulum, true, 1e-14, |_, value| value);
    if let Some(recorded) = &recorded {
        ode = ode.driven_by(Arc::clone(recorded));
    }
    let run = sample(&ode, 0.0, start, &times, |_, _| true);
    let sensor = Observation::lift(&pendulum, |_, value| value);
    let read = |(k, tau): (usize, &f64)| {
        sensor.read(run.given(&ode, k), run.states[k][1], pendulum.lab_time + tau)
    };
    let readings = times.iter().enumerate().map(read).collect();
    let weights = vec![1.0; times.len()];
    Record {
        pendulum,
        recorded,
        times,
        readings,
        rod_sensor: None,
        angles: None,
        weights,
        counts: None,
        longest: f64::INFINITY,
    }
}

/// Free parameters with one value for all records.
pub fn free(slots: &[Slot], records: usize, start: &[f64]) -> Vec<Free> {
    let all = |slot: &Slot| (0..records).map(|record| (record, *slot)).collect();
    slots.iter().zip(start).map(|(slot, start)| Free { places: all(slot), start: *start }).collect()
}

/// Gravity, then all parameters of the pendulum, and their values.
pub fn everything(pendulum: &Pendulum) -> (Vec<Slot>, Vec<f64>) {
    let parameters = pendulum.parameters();
    let slots = parameters.iter().copied().map(Slot::Parameter);
    let values = parameters.iter().map(|parameter| pendulum.value(*parameter));
    (
        std::iter::once(Slot::Gravity).chain(slots).collect(),
        std::iter::once(1.0).chain(values).collect(),
    )
}

/// A window with these values.
pub fn line(problem: &Problem, values: &[f64], window: &Window) -> Linear {
    let shaped = problem.shaped(window.record, values).expect("in range");
    linearise(problem, &shaped, &problem.columns(window.record), window)
}
