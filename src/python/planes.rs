//! Bindings of maps over parameters.

use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::model::{Model, range};
use super::watch::watched;
use crate::integrate::State;
use crate::maps::bifurcation as diagram;
use crate::maps::cell::{Cell, Found, HINTED};
use crate::maps::parameter_map::{Request, parameter_map as search};

/// `(name of a parameter, values)`.
type RangeTuple = (String, Vec<f64>);

/// The names of a model's parameters, in the order of their places.
#[pyfunction]
pub fn parameter_names(model: Model) -> PyResult<Vec<String>> {
    Ok(model.pendulum()?.parameters().into_iter().map(|(name, _)| name).collect())
}

/// The attractors over a plane of two parameters: columns over all attractors of all cells, and over cells.
#[pyfunction]
#[pyo3(signature = (model, axes, theta, velocity, each, tol, bound, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn parameter_map<'py>(
    py: Python<'py>,
    model: Model,
    axes: (RangeTuple, RangeTuple),
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    each: usize,
    tol: f64,
    bound: Option<u32>,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let pendulum = model.pendulum()?;
    let starts: Vec<State> =
        theta.as_slice()?.iter().zip(velocity.as_slice()?).map(|(a, b)| [*a, *b]).collect();
    let request = Request {
        axes: [range(&pendulum, axes.0)?, range(&pendulum, axes.1)?],
        starts,
        each,
        tol,
        bound,
        kept: HINTED,
        threads,
    };
    let map = watched(py, progress.as_ref(), |control| search(&pendulum, &request, control))?;
    let dict = attractors_of(py, &map.cells)?;
    dict.set_item("reached_error", map.resolution.reached_error)?;
    dict.set_item("searched_again", map.searched_again)?;
    dict.set_item("simd", crate::lanes::Path::choose()?.name())?;
    Ok(dict)
}

/// The attractors along one parameter, their points, and what is followed up and down.
#[pyfunction]
#[pyo3(signature = (model, axis, theta, velocity, each, first, tol, bound, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn bifurcation<'py>(
    py: Python<'py>,
    model: Model,
    axis: RangeTuple,
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    each: usize,
    first: Option<(f64, f64)>,
    tol: f64,
    bound: Option<u32>,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let pendulum = model.pendulum()?;
    let starts: Vec<State> =
        theta.as_slice()?.iter().zip(velocity.as_slice()?).map(|(a, b)| [*a, *b]).collect();
    let request = diagram::Request {
        axis: range(&pendulum, axis)?,
        starts,
        each,
        first: first.map(|(theta, velocity)| [theta, velocity]),
        tol,
        bound,
        threads,
    };
    let found = watched(py, progress.as_ref(), |control| {
        diagram::bifurcation(&pendulum, &request, control)
    })?;
    let dict = attractors_of(py, &found.map.cells)?;
    dict.set_item("reached_error", found.map.resolution.reached_error)?;
    dict.set_item("searched_again", found.map.searched_again)?;
    dict.set_item("simd", crate::lanes::Path::choose()?.name())?;
    let all = found.map.cells.iter().flat_map(|cell| &cell.found).enumerate();
    let points: Vec<(i32, State)> = all
        .flat_map(|(i, f)| f.attractor.points.iter().map(move |point| (i as i32, *point)))
        .collect();
    let column = |k: usize| -> Vec<f64> { points.iter().map(|(_, p)| p[k]).collect() };
    let owner: Vec<i32> = points.iter().map(|(i, _)| *i).collect();
    dict.set_item("point_entry", owner.into_pyarray(py))?;
    dict.set_item("point_theta", column(0).into_pyarray(py))?;
    dict.set_item("point_velocity", column(1).into_pyarray(py))?;
    for (name, followed) in [("up", &found.up), ("down", &found.down)] {
        let on: Vec<i32> = followed.iter().map(|f| f.on.map_or(-1, |k| k as i32)).collect();
        dict.set_item(name, on.into_pyarray(py))?;
        let loose: Vec<(i32, State)> = followed
            .iter()
            .enumerate()
            .flat_map(|(k, f)| f.loose.iter().map(move |point| (k as i32, *point)))
            .collect();
        let value: Vec<i32> = loose.iter().map(|(k, _)| *k).collect();
        let column = |k: usize| -> Vec<f64> { loose.iter().map(|(_, p)| p[k]).collect() };
        dict.set_item(format!("{name}_value"), value.into_pyarray(py))?;
        dict.set_item(format!("{name}_theta"), column(0).into_pyarray(py))?;
        dict.set_item(format!("{name}_velocity"), column(1).into_pyarray(py))?;
    }
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
    let watched: Vec<u32> = cells.iter().map(|cell| cell.watched).collect();
    dict.set_item("chaos_periods", watched.into_pyarray(py))?;
    Ok(dict)
}
