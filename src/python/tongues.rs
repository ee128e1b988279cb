//! Bindings of critical curves.

use pendmap::error::Error;
use pendmap::maps::tongues::{Balance, Critical, tongues as search};
use pyo3::prelude::*;

use super::long_calls::interruptible;
use super::model::Model;

/// Critical amplitudes of the drive at one frequency, ascending.
#[pyclass(frozen, get_all, module = "pendmap._core")]
#[derive(Default)]
pub struct CriticalAmplitudes {
    /// Whether rest is a solution.
    rest: bool,
    p: Vec<f64>,
    /// The Floquet multiplier, 1 or -1, at each of them.
    multiplier: Vec<f64>,
    /// Whether rest is stable below the first of them, and above each.
    stable: Vec<bool>,
    /// Whether a torque moves the angle of rest.
    moved: bool,
    /// Amplitude, angle and velocity of the fold of the oscillation that is born at the first loss.
    fold: Option<(f64, f64, f64)>,
}

#[pymethods]
impl CriticalAmplitudes {
    /// The result for a pendulum without such a rest: empty.
    #[staticmethod]
    fn no_rest() -> Self {
        Self { stable: vec![false], ..Self::default() }
    }
}

/// Critical amplitudes of the drive at each frequency, up to `p_max`, of hanging or `inverted` rest.
#[pyfunction]
#[pyo3(signature = (model, inverted, omegas, p_max, folds, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn tongues(
    py: Python<'_>,
    model: Model,
    inverted: bool,
    omegas: Vec<f64>,
    p_max: f64,
    folds: bool,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<CriticalAmplitudes>> {
    let pendulum = model.pendulum()?;
    let balance = if inverted { Balance::Inverted } else { Balance::Hanging };
    let found = interruptible(py, progress.as_ref(), |control| {
        match search(&pendulum, balance, &omegas, p_max, folds, threads, control) {
            Err(Error::NoRest { .. }) if inverted => Ok(None),
            found => found.map(Some),
        }
    })?;
    let Some(curves) = found else {
        return Ok(omegas.iter().map(|_| CriticalAmplitudes::no_rest()).collect());
    };
    let moved = pendulum.torque != 0.0;
    let amplitudes = curves.into_iter().map(|curve| {
        let column =
            |value: fn(&Critical) -> f64| curve.critical.iter().map(value).collect::<Vec<f64>>();
        let above = curve.critical.iter().map(|c| c.stable[1]);
        CriticalAmplitudes {
            rest: true,
            p: column(|c| c.p),
            multiplier: column(|c| c.multiplier),
            stable: std::iter::once(curve.stable_at_first).chain(above).collect(),
            moved,
            fold: curve.fold.map(|f| (f.p, f.point[0], f.point[1])),
        }
    });
    Ok(amplitudes.collect())
}
