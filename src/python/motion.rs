//! Bindings of `integrate`.

use std::mem::take;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pendmap::error::Error;
use pendmap::integrate::tangent::Tangent;
use pendmap::integrate::trajectory::{self, Request};
use pendmap::integrate::{State, Strobe, accuracy};
use pendmap::lanes::InstructionSet;
use pendmap::maps::advance::advance as advance_all;
use pendmap::model::{Equation, Pendulum};
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::convert::{Array, array, states};
use super::long_calls::{interruptible, stopped};
use super::model::Model;
use super::raise;

/// Angle in [-pi, pi], velocity and net turns.
type Advanced<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<i64>>);

/// The acceleration at many times, angles and velocities, moving in the sense of each velocity.
#[pyfunction]
pub fn acceleration<'py>(
    py: Python<'py>,
    model: Model,
    tau: PyReadonlyArray1<'py, f64>,
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let equation = model.pendulum()?.equation();
    let (tau, theta, velocity) = (tau.as_slice()?, theta.as_slice()?, velocity.as_slice()?);
    let states = tau.iter().zip(theta).zip(velocity);
    let all: Vec<f64> = states.map(|((t, x), v)| equation.acceleration_at(*t, *x, *v)).collect();
    Ok(all.into_pyarray(py))
}

/// The acceleration with time in the laboratory going on, as in a trajectory, and its derivatives by angle and
/// velocity; at a velocity 0 all are 0 where friction holds the pendulum, else those of the motion that begins.
#[pyfunction]
pub fn rates<'py>(
    py: Python<'py>,
    model: Model,
    tau: PyReadonlyArray1<'py, f64>,
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 3]> {
    type Number = Tangent<f64, 2>;
    let pendulum = model.pendulum()?;
    let mut equation = Equation::lift(&pendulum, |_, value| Number::constant(value));
    equation.ages = true;
    let mut plain = pendulum.equation();
    plain.ages = true;
    let rubs = pendulum.has_friction();
    if equation.keeps()[0] || equation.sways() {
        return Err(PyValueError::new_err(
            "effects must act by time, angle and velocity alone, one depends on the last turn or on a \
             mode of the rig",
        ));
    }
    let (tau, theta, velocity) = (tau.as_slice()?, theta.as_slice()?, velocity.as_slice()?);
    let mut columns = [(); 3].map(|()| Vec::with_capacity(tau.len()));
    for ((t, x), v) in tau.iter().zip(theta).zip(velocity) {
        let forcing = equation.forcing(Number::constant(*t));
        let (angle, speed) = (Number::seeded(*x, 0), Number::seeded(*v, 1));
        let sense = if *v == 0.0 { plain.moves_at_once(*t, *x) } else { Some(v.signum()) };
        let sense = if rubs { sense } else { sense.or(Some(1.0)) };
        let rates = sense.map_or([0.0; 3], |sense| {
            let at = equation.point(&forcing, angle, speed, Number::constant(sense));
            let Number { value, slope: [by_theta, by_velocity] } =
                equation.acceleration(&forcing, &at);
            [value, by_theta, by_velocity]
        });
        for (column, number) in columns.iter_mut().zip(rates) {
            column.push(number);
        }
    }
    Ok(columns.map(|column: Vec<f64>| column.into_pyarray(py)))
}

/// The stroboscopic map with `steps` a period.
pub fn strobe(pendulum: &Pendulum, steps: usize) -> PyResult<Strobe> {
    if steps == 0 {
        let allowed = "1 or more";
        return Err(raise(Error::Range { name: "steps_per_period", value: 0.0, allowed }));
    }
    Ok(Strobe::new(pendulum, steps, InstructionSet::choose().map_err(raise)?))
}

/// Advances many starts by the same number of forcing periods.
#[pyfunction]
#[pyo3(signature = (model, theta, velocity, periods, steps_per_period, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn advance<'py>(
    py: Python<'py>,
    model: Model,
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    periods: usize,
    steps_per_period: usize,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Advanced<'py>> {
    let pendulum = model.pendulum()?;
    let strobe = strobe(&pendulum, steps_per_period)?;
    let starts = states(&theta, &velocity)?;
    let (ends, turns) = interruptible(py, progress.as_ref(), |control| {
        advance_all(&strobe, &starts, periods, threads, control)
    })?;
    let [theta, velocity] = [ends.theta(), ends.velocity()].map(<[f64]>::to_vec);
    Ok((theta.into_pyarray(py), velocity.into_pyarray(py), turns.into_pyarray(py)))
}

/// The fewest steps a period that reach `tol` on these starts, and the error reached.
#[pyfunction]
pub fn choose_steps(
    model: Model,
    theta: PyReadonlyArray1<'_, f64>,
    velocity: PyReadonlyArray1<'_, f64>,
    tol: f64,
) -> PyResult<(usize, f64)> {
    let pendulum = model.pendulum()?;
    pendulum.check_mappable().map_err(raise)?;
    let states = states(&theta, &velocity)?;
    let simd = InstructionSet::choose().map_err(raise)?;
    let (strobe, error) = accuracy::choose(&pendulum, &states, tol, simd).map_err(raise)?;
    Ok((strobe.steps(), error))
}

/// A trajectory; arrays have one entry for each sample, or for each event.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Trajectory {
    time: Array<f64>,
    theta: Array<f64>,
    velocity: Array<f64>,
    reached_error: f64,
    end_error: f64,
    steps_per_period: usize,
    /// The exponent and its standard error.
    exponent: Option<(f64, f64)>,
    stuck: bool,
    interrupted: bool,
    event_time: Array<f64>,
    event_theta: Array<f64>,
    event_kind: Vec<&'static str>,
}

impl Trajectory {
    fn new(py: Python<'_>, run: trajectory::Trajectory) -> Self {
        let events = &run.events;
        Self {
            event_time: array(py, events.iter().map(|event| event.tau).collect()),
            event_theta: array(py, events.iter().map(|event| event.theta).collect()),
            event_kind: events.iter().map(|event| event.kind.words()).collect(),
            time: array(py, run.time),
            theta: array(py, run.theta),
            velocity: array(py, run.velocity),
            reached_error: run.reached_error,
            end_error: run.end_error,
            steps_per_period: run.steps,
            exponent: run.exponent,
            stuck: run.stuck,
            interrupted: run.interrupted,
        }
    }
}

/// One trajectory, sampled at `times` where they are given, from 0 to `until`. With `live` its samples
/// are passed on as they are computed, `live(times, angles, velocities)`, and an interrupt ends it with
/// the last one.
#[pyfunction]
#[pyo3(signature = (model, start, until, tol, samples, lyapunov, live=None, times=Vec::new()))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn simulate(
    py: Python<'_>,
    model: Model,
    start: (f64, f64),
    until: f64,
    tol: f64,
    samples: usize,
    lyapunov: bool,
    live: Option<Py<PyAny>>,
    times: Vec<f64>,
) -> PyResult<Trajectory> {
    let pendulum = model.pendulum()?;
    let request = Request { start: [start.0, start.1], until, tol, samples, lyapunov };
    let Some(live) = live else {
        let run = interruptible(py, None, |control| {
            let run = trajectory::simulate_live(
                &pendulum,
                &request,
                &times,
                control.flag(),
                &mut |_, _| (),
            )?;
            if control.flag().load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(run) }
        })?;
        return Ok(Trajectory::new(py, run));
    };
    let seen = Mutex::new([Vec::new(), Vec::new(), Vec::new()]);
    let deliver = |py: Python<'_>| {
        let [times, angles, velocities] =
            take(&mut *seen.lock().expect("no panic while it is held"));
        if times.is_empty() {
            return Ok(());
        }
        let arrays = [times, angles, velocities].map(|column: Vec<f64>| column.into_pyarray(py));
        live.call1(py, PyTuple::new(py, arrays)?).map(|_| ())
    };
    let mut see = |time: f64, [theta, velocity]: State| {
        let mut columns = seen.lock().expect("no panic while it is held");
        for (column, value) in columns.iter_mut().zip([time, theta, velocity]) {
            column.push(value);
        }
    };
    let (result, stop) = stopped(
        py,
        |py, _| deliver(py),
        |control| trajectory::simulate_live(&pendulum, &request, &times, control.flag(), &mut see),
    )?;
    if let Some(error) = stop.filter(|e| !e.is_instance_of::<PyKeyboardInterrupt>(py)) {
        return Err(error);
    }
    let run = result.map_err(raise)?;
    deliver(py)?;
    Ok(Trajectory::new(py, run))
}
