//! Bindings of closed orbits.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::convert::attractor_dict;
use super::maps::AxisTuple;
use super::model::Model;
use super::watch::watched;
use crate::attractor::Attractor;
use crate::attractor::catalogue::arrange;
use crate::maps::orbits::{Request, orbits as search};
use crate::maps::starts::Axis;

/// All closed orbits of period `n` and winding `w` in a box, with where the search began.
#[pyfunction]
#[pyo3(signature = (model, winding, theta, velocity, threads, progress=None))]
pub fn orbits<'py>(
    py: Python<'py>,
    model: Model,
    winding: (usize, i64),
    theta: AxisTuple,
    velocity: AxisTuple,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let pendulum = model.pendulum()?;
    let request = Request {
        n: winding.0,
        w: winding.1,
        theta: Axis::new("theta", theta.0, theta.1, theta.2)?,
        velocity: Axis::new("velocity", velocity.0, velocity.1, velocity.2)?,
        threads,
    };
    let found = watched(py, progress.as_ref(), |control| search(&pendulum, &request, control))?;
    let closed = found.closed.iter().map(|orbit| Attractor::periodic(&pendulum, orbit));
    let all: Vec<Attractor> = closed.chain(found.running.iter().map(Attractor::running)).collect();
    let (all, place) = arrange(&pendulum, all);
    let mut residuals = vec![0.0; all.len()];
    for (orbit, at) in found.closed.iter().zip(&place) {
        residuals[*at] = orbit.residual;
    }
    let listed = PyList::empty(py);
    for (orbit, residual) in all.iter().zip(residuals) {
        let dict = attractor_dict(py, orbit, f64::NAN)?;
        dict.set_item("residual", residual)?;
        dict.set_item("stable", orbit.is_stable(&pendulum))?;
        listed.append(dict)?;
    }
    let dict = PyDict::new(py);
    dict.set_item("orbits", listed)?;
    dict.set_item("begun", found.begun)?;
    dict.set_item("friction", pendulum.has_friction())?;
    Ok(dict)
}
