//! Bindings of periodic orbits.

use pendmap::attractor;
use pendmap::attractor::catalogue::arrange;
use pendmap::maps::orbits::{Request, orbits as search};
use pyo3::prelude::*;

use super::convert::Attractor;
use super::long_calls::watched;
use super::maps::{AxisTuple, axes};
use super::model::Model;

/// A periodic orbit.
#[pyclass(frozen, get_all, extends = Attractor, module = "pendmap._core")]
pub struct Orbit {
    /// Its residual, the distance by which it fails to close.
    residual: f64,
    stable: bool,
}

/// The periodic orbits found by a search.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct OrbitSearch {
    orbits: Vec<Py<Orbit>>,
    /// States from which Newton's method began.
    begun: usize,
    /// Whether the pendulum has friction.
    friction: bool,
}

/// All periodic orbits of period `n` and winding `w` in a box, and the starting points of the
/// search.
#[pyfunction]
#[pyo3(signature = (model, winding, theta, velocity, threads, progress=None))]
pub fn orbits(
    py: Python<'_>,
    model: Model,
    winding: (usize, i64),
    theta: AxisTuple,
    velocity: AxisTuple,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<OrbitSearch> {
    let pendulum = model.pendulum()?;
    let [theta, velocity] = axes(theta, velocity)?;
    let request = Request { n: winding.0, w: winding.1, theta, velocity, threads };
    let found = watched(py, progress.as_ref(), |control| search(&pendulum, &request, control))?;
    let closed = found.closed.iter().map(|orbit| attractor::Attractor::periodic(&pendulum, orbit));
    let all: Vec<attractor::Attractor> =
        closed.chain(found.running.iter().map(attractor::Attractor::running)).collect();
    let (all, place) = arrange(&pendulum, all);
    let mut residuals = vec![0.0; all.len()];
    for (orbit, at) in found.closed.iter().zip(&place) {
        residuals[*at] = orbit.residual;
    }
    let listed = all.iter().zip(residuals).map(|(orbit, residual)| {
        let own = Orbit { residual, stable: orbit.is_stable(&pendulum) };
        Py::new(py, (own, Attractor::new(orbit, f64::NAN)))
    });
    Ok(OrbitSearch {
        orbits: listed.collect::<PyResult<_>>()?,
        begun: found.begun,
        friction: pendulum.has_friction(),
    })
}
