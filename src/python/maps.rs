//! Bindings of `maps`.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::convert;
use super::model::Model;
use super::watch::watched;
use crate::error::Error;
use crate::maps::basins::{Options, basins};
use crate::maps::control::pool;
use crate::maps::starts::{Axis, Starts};
use crate::maps::texture::of_cells;
use crate::memory;

/// `(low, high, count)` as Python hands it over.
pub type AxisTuple = (f64, f64, usize);

/// Numerical choices as Python hands them over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Choices {
    tol: f64,
    max_periods: Option<u32>,
    layer_periods: Option<u32>,
    threads: usize,
    seed: u64,
    check: bool,
}

impl From<Choices> for Options {
    fn from(choices: Choices) -> Self {
        let Choices { tol, max_periods, layer_periods, threads, seed, check } = choices;
        Self { tol, max_periods, layer_periods, threads, seed, check }
    }
}

/// Basins over a grid.
#[pyfunction]
#[pyo3(signature = (model, theta, velocity, choices, progress=None))]
pub fn basins_grid<'py>(
    py: Python<'py>,
    model: Model,
    theta: AxisTuple,
    velocity: AxisTuple,
    choices: Choices,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let theta = Axis::new("theta", theta.0, theta.1, theta.2)?;
    let velocity = Axis::new("velocity", velocity.0, velocity.1, velocity.2)?;
    run(py, model, Starts::Grid { theta, velocity }, choices, progress)
}

/// Basins of a list of starts.
#[pyfunction]
#[pyo3(signature = (model, theta, velocity, choices, progress=None))]
pub fn basins_list<'py>(
    py: Python<'py>,
    model: Model,
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    choices: Choices,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (theta, velocity) = (theta.as_slice()?, velocity.as_slice()?);
    if theta.len() != velocity.len() {
        let given = (theta.len(), velocity.len());
        return Err(Error::Lengths { given, names: ("theta", "velocity") }.into());
    }
    if let Some(value) = theta.iter().chain(velocity).find(|x| !x.is_finite()) {
        let allowed = "a finite number";
        return Err(Error::Range { name: "start", value: *value, allowed }.into());
    }
    // Angle and velocity, and all that a map and its dataset have of a start.
    memory::reckon("starts", theta.len(), 100)?;
    let states = theta.iter().zip(velocity).map(|(a, b)| [*a, *b]).collect();
    run(py, model, Starts::List(states), choices, progress)
}

/// Texture of labels in rows of so many columns.
#[pyfunction]
pub fn texture<'py>(
    py: Python<'py>,
    labels: PyReadonlyArray1<'py, i16>,
    columns: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let cells = labels.as_slice()?.to_vec();
    let found = watched(py, None, |_| Ok(of_cells(&cells, columns, &pool(0)?)))?;
    let dict = PyDict::new(py);
    convert::texture(&dict, &found)?;
    Ok(dict)
}

fn run<'py>(
    py: Python<'py>,
    model: Model,
    starts: Starts,
    choices: Choices,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let pendulum = model.pendulum()?;
    let options = Options::from(choices);
    let map =
        watched(py, progress.as_ref(), |control| basins(&pendulum, &starts, &options, control))?;
    convert::basin_map(py, map)
}
