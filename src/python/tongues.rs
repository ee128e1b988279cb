//! Bindings of critical curves.

use pendmap::maps::tongues::tongues as search;
use pyo3::prelude::*;

use super::convert::{Array, array};
use super::curves::BifurcationSet;
use super::long_calls::interruptible;
use super::model::Model;

/// Critical amplitudes of the drive as columns, by frequency, of hanging rest before inverted rest, ascending.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Tongues {
    /// Number of the frequency, and whether it is inverted rest that changes.
    index: Array<i32>,
    inverted: Vec<bool>,
    /// The amplitude, the Floquet multiplier, 1 or -1, and whether rest is stable right above.
    p: Array<f64>,
    multiplier: Array<f64>,
    above: Vec<bool>,
    /// Whether hanging rest, and inverted rest, is stable below the first of them, at each frequency.
    first: Vec<(bool, bool)>,
    /// Whether upright is a rest.
    upright: bool,
    /// The curves over `p` and the frequency; none at one frequency, or of a rest without them.
    curves: Option<Py<BifurcationSet>>,
}

/// Critical amplitudes of the drive at each frequency, up to `p_max`, of hanging and inverted rest.
#[pyfunction]
#[pyo3(signature = (model, omegas, p_max, threads, progress=None))]
pub fn tongues(
    py: Python<'_>,
    model: Model,
    omegas: Vec<f64>,
    p_max: f64,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Tongues> {
    let pendulum = model.pendulum()?;
    let found = interruptible(py, progress.as_ref(), |control| {
        search(&pendulum, &omegas, p_max, threads, control)
    })?;
    let mut all = Vec::new();
    for (index, rows) in found.rows.iter().enumerate() {
        for (inverted, row) in [false, true].into_iter().zip(rows) {
            all.extend(row.critical.iter().map(|critical| (index as i32, inverted, *critical)));
        }
    }
    let set = found.plane.map(|plane| Py::new(py, BifurcationSet::new(py, &plane, &[], &[])?));
    Ok(Tongues {
        index: array(py, all.iter().map(|one| one.0).collect()),
        inverted: all.iter().map(|one| one.1).collect(),
        p: array(py, all.iter().map(|one| one.2.p).collect()),
        multiplier: array(py, all.iter().map(|one| one.2.multiplier).collect()),
        above: all.iter().map(|one| one.2.stable[1]).collect(),
        first: found.rows.iter().map(|[a, b]| (a.stable_at_first, b.stable_at_first)).collect(),
        upright: found.inverted,
        curves: set.transpose()?,
    })
}
