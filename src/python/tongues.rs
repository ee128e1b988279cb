//! Bindings of critical curves.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::watch::watched;
use super::{Parameters, pendulum};
use crate::maps::tongues::tongues as search;

/// Critical amplitudes of the drive at each frequency, up to `p_max`.
#[pyfunction]
#[pyo3(signature = (parameters, omegas, p_max, folds, threads, progress=None))]
pub fn tongues<'py>(
    py: Python<'py>,
    parameters: Parameters,
    omegas: Vec<f64>,
    p_max: f64,
    folds: bool,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let pendulum = pendulum(parameters)?;
    let curves = watched(py, progress.as_ref(), |control| {
        search(&pendulum, &omegas, p_max, folds, threads, control)
    })?;
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
        dict.set_item("fold", curve.fold.map(|f| (f.p, f.point[0], f.point[1])))?;
        listed.append(dict)?;
    }
    Ok(listed)
}
