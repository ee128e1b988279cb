//! Bindings of maps over parameters.

use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::watch::watched;
use super::{Parameters, pendulum};
use crate::integrate::State;
use crate::maps::cell::{Cell, Found};
use crate::maps::parameter_map::{Range, Request, parameter_map as search};

/// `(place in the list of parameters, values)`.
type RangeTuple = (usize, Vec<f64>);

/// The names of a model's parameters, in the order of their places.
#[pyfunction]
pub fn parameter_names(parameters: Parameters) -> PyResult<Vec<String>> {
    Ok(pendulum(parameters)?.parameters().into_iter().map(|(name, _)| name).collect())
}

/// The attractors over a plane of two parameters: columns over all attractors of all cells, and over cells.
#[pyfunction]
#[pyo3(signature = (parameters, axes, theta, velocity, tol, bound, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn parameter_map<'py>(
    py: Python<'py>,
    parameters: Parameters,
    axes: (RangeTuple, RangeTuple),
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    tol: f64,
    bound: Option<u32>,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let pendulum = pendulum(parameters)?;
    let range = |(index, values): RangeTuple| Range { index, values };
    let starts: Vec<State> =
        theta.as_slice()?.iter().zip(velocity.as_slice()?).map(|(a, b)| [*a, *b]).collect();
    let request = Request { axes: [range(axes.0), range(axes.1)], starts, tol, bound, threads };
    let map = watched(py, progress.as_ref(), |control| search(&pendulum, &request, control))?;
    let dict = attractors_of(py, &map.cells)?;
    dict.set_item("reached_error", map.reached_error)?;
    dict.set_item("searched_again", map.searched_again)?;
    dict.set_item("simd", map.path.name())?;
    Ok(dict)
}

/// The attractors of all cells one after the other, with the cell of each.
fn attractors_of<'py>(py: Python<'py>, cells: &[Cell]) -> PyResult<Bound<'py, PyDict>> {
    let all: Vec<(usize, &Found)> = cells
        .iter()
        .enumerate()
        .flat_map(|(i, cell)| cell.found.iter().map(move |found| (i, found)))
        .collect();
    let number =
        |of: &dyn Fn(&Found) -> f64| -> Vec<f64> { all.iter().map(|(_, f)| of(f)).collect() };
    let point = |f: &Found, k: usize| f.attractor.points.first().map_or(f64::NAN, |p| p[k]);
    let dict = PyDict::new(py);
    let cell: Vec<i32> = all.iter().map(|(cell, _)| *cell as i32).collect();
    dict.set_item("cell", cell.into_pyarray(py))?;
    dict.set_item("kind", all.iter().map(|(_, f)| f.attractor.kind.word()).collect::<Vec<_>>())?;
    let n: Vec<i32> = all.iter().map(|(_, f)| f.attractor.n.unwrap_or(0) as i32).collect();
    let w = |f: &Found| f.attractor.w.unwrap_or(f.attractor.sense) as i32;
    let w: Vec<i32> = all.iter().map(|(_, f)| w(f)).collect();
    dict.set_item("n", n.into_pyarray(py))?;
    dict.set_item("w", w.into_pyarray(py))?;
    dict.set_item("theta", number(&|f| point(f, 0)).into_pyarray(py))?;
    dict.set_item("velocity", number(&|f| point(f, 1)).into_pyarray(py))?;
    dict.set_item("exponent", number(&|f| f.attractor.exponent).into_pyarray(py))?;
    dict.set_item("exponent_stderr", number(&|f| f.attractor.exponent_stderr).into_pyarray(py))?;
    dict.set_item("share", number(&|f| f.share).into_pyarray(py))?;
    let undecided: Vec<f64> = cells.iter().map(|cell| cell.open).collect();
    let failed: Vec<f64> = cells.iter().map(|cell| cell.failed).collect();
    dict.set_item("undecided", undecided.into_pyarray(py))?;
    dict.set_item("failed", failed.into_pyarray(py))?;
    Ok(dict)
}
