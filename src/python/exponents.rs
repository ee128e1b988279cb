//! Bindings of Lyapunov exponents.

use numpy::{IntoPyArray, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::convert::attractor_dict;
use super::model::Model;
use super::watch::watched;
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::lanes::Path;
use crate::maps::control::pool;
use crate::maps::ensemble::WINDOW;
use crate::maps::growth::Bundle;
use crate::maps::lyapunov::{End, Request, lyapunov as exponent_of};
use crate::memory;

/// Numerical choices as Python hands them over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ExponentChoices {
    precision: f64,
    tol: f64,
    max_periods: Option<u32>,
    threads: usize,
    seed: u64,
}

/// The largest exponent of the attractor that a start reaches.
#[pyfunction]
#[pyo3(signature = (model, start, choices, progress=None))]
pub fn lyapunov<'py>(
    py: Python<'py>,
    model: Model,
    start: (f64, f64),
    choices: ExponentChoices,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let pendulum = model.pendulum()?;
    let ExponentChoices { precision, tol, max_periods, threads, seed } = choices;
    let start = [start.0, start.1];
    let request = Request { start, precision, tol, max_periods, threads, seed };
    let found =
        watched(py, progress.as_ref(), |control| exponent_of(&pendulum, &request, control))?;
    let dict = PyDict::new(py);
    let end = match found.end {
        End::Captured => "captured",
        End::Chaotic => "chaotic",
        End::Undamped => "undamped",
        End::Undecided => "undecided",
        End::Failed => "failed",
    };
    dict.set_item("end", end)?;
    let attractor = found.attractor.map(|a| attractor_dict(py, &a, f64::NAN)).transpose()?;
    dict.set_item("attractor", attractor)?;
    dict.set_item("transient", found.transient)?;
    dict.set_item("lost", found.lost)?;
    dict.set_item("course", found.course.into_pyarray(py))?;
    dict.set_item("bound", found.bound)?;
    dict.set_item("chaos_bound", found.chaos_bound)?;
    dict.set_item("steps_per_period", found.steps)?;
    dict.set_item("reached_error", found.reached_error)?;
    dict.set_item("simd", found.path.name())?;
    dict.set_item("window", WINDOW)?;
    let ensemble = found.ensemble.as_ref();
    dict.set_item("growth", ensemble.map(|e| PyArray2::from_vec2(py, &e.growth)).transpose()?)?;
    dict.set_item("dropped", ensemble.map(|e| e.dropped))?;
    dict.set_item("exponent", ensemble.map(|e| (e.exponent, e.stderr)))?;
    dict.set_item("sum", ensemble.map(|e| e.sum))?;
    Ok(dict)
}

/// Logarithms of the growth of a tangent along each start, `windows` times over `window` periods.
#[pyfunction]
#[pyo3(signature = (model, theta, velocity, windows, window, steps_per_period, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn growth<'py>(
    py: Python<'py>,
    model: Model,
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    windows: usize,
    window: usize,
    steps_per_period: usize,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let pendulum = model.pendulum()?;
    pendulum.check_mappable()?;
    if steps_per_period == 0 {
        let allowed = "1 or more";
        return Err(Error::Range { name: "steps_per_period", value: 0.0, allowed }.into());
    }
    let (theta, velocity) = (theta.as_slice()?, velocity.as_slice()?);
    if theta.len() != velocity.len() {
        let given = (theta.len(), velocity.len());
        return Err(Error::Lengths { given, names: ("theta", "velocity") }.into());
    }
    // A row of windows for each start, and the array of all.
    memory::reckon("starts", theta.len(), 16 * windows.saturating_add(8))?;
    let states: Vec<State> = theta.iter().zip(velocity).map(|(a, b)| [*a, *b]).collect();
    let strobe = Strobe::new(&pendulum, steps_per_period, Path::choose()?);
    let pool = pool(threads)?;
    let rows = watched(py, progress.as_ref(), |control| {
        control.begin(states.len());
        Bundle::new(&states).grow(&strobe, windows, window, &pool, control)
    })?;
    Ok(PyArray2::from_vec2(py, &rows)?)
}
