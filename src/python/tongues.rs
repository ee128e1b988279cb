//! Bindings of critical curves.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::model::Model;
use super::watch::watched;
use crate::error::Error;
use crate::maps::tongues::{Balance, tongues as search};

/// Critical amplitudes of the drive at each frequency, up to `p_max`, of hanging or `inverted` rest;
/// `None` where inverted rest is no solution.
#[pyfunction]
#[pyo3(signature = (model, inverted, omegas, p_max, folds, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn tongues<'py>(
    py: Python<'py>,
    model: Model,
    inverted: bool,
    omegas: Vec<f64>,
    p_max: f64,
    folds: bool,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Option<Bound<'py, PyList>>> {
    let pendulum = model.pendulum()?;
    let balance = if inverted { Balance::Inverted } else { Balance::Hanging };
    let found = watched(py, progress.as_ref(), |control| {
        match search(&pendulum, balance, &omegas, p_max, folds, threads, control) {
            Err(Error::NoRest { .. }) if inverted => Ok(None),
            found => found.map(Some),
        }
    })?;
    let Some(curves) = found else { return Ok(None) };
    let listed = PyList::empty(py);
    for curve in curves {
        let dict = PyDict::new(py);
        let column = |value: fn(&crate::maps::tongues::Critical) -> f64| {
            curve.critical.iter().map(value).collect::<Vec<f64>>()
        };
        dict.set_item("omega", curve.omega)?;
        dict.set_item("p", column(|c| c.p))?;
        dict.set_item("multiplier", column(|c| c.multiplier))?;
        let above = curve.critical.iter().map(|c| c.stable[1]);
        let stable: Vec<bool> = std::iter::once(curve.stable_at_first).chain(above).collect();
        dict.set_item("stable", stable)?;
        dict.set_item("moved", pendulum.torque != 0.0)?;
        dict.set_item("fold", curve.fold.map(|f| (f.p, f.point[0], f.point[1])))?;
        listed.append(dict)?;
    }
    Ok(Some(listed))
}
