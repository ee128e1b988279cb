//! Shared conversions: arrays, states and attractors.

use numpy::{Element, IntoPyArray, PyArray1, PyReadonlyArray1};
use pendmap::attractor;
use pendmap::error::Error;
use pendmap::integrate::State;
use pyo3::prelude::*;

use super::raise;

/// An array of one dimension.
pub type Array<T> = Py<PyArray1<T>>;

/// The array that takes ownership of `values`.
pub fn array<T: Element>(py: Python<'_>, values: Vec<T>) -> Array<T> {
    values.into_pyarray(py).unbind()
}

/// The states of which `theta` and `velocity` are the components.
pub fn states(
    theta: &PyReadonlyArray1<'_, f64>,
    velocity: &PyReadonlyArray1<'_, f64>,
) -> PyResult<Vec<State>> {
    let (theta, velocity) = (theta.as_slice()?, velocity.as_slice()?);
    if theta.len() != velocity.len() {
        let given = (theta.len(), velocity.len());
        return Err(raise(Error::Lengths { given, names: ("theta", "velocity") }));
    }
    Ok(theta.iter().zip(velocity).map(|(a, b)| [*a, *b]).collect())
}

/// An attractor, or a periodic orbit.
#[pyclass(frozen, get_all, subclass, module = "pendmap._core")]
pub struct Attractor {
    name: String,
    kind: &'static str,
    /// Period in forcing periods; none if meaningless.
    n: Option<usize>,
    /// Net turns over that period.
    w: Option<i64>,
    /// Stroboscopic points `(theta, velocity)`.
    points: Vec<(f64, f64)>,
    /// Floquet multipliers `(re, im)`.
    multipliers: Vec<(f64, f64)>,
    exponent: f64,
    exponent_stderr: f64,
    period: Option<f64>,
    /// Number of the mirror image, from 1.
    twin: Option<usize>,
    /// Share of the starts that end on it; no number of an orbit.
    fraction: f64,
}

impl Attractor {
    pub fn new(attractor: &attractor::Attractor, fraction: f64) -> Self {
        Self {
            name: attractor.name.clone(),
            kind: attractor.kind.word(),
            n: attractor.n,
            w: attractor.w,
            points: attractor.points.iter().map(|p| (p[0], p[1])).collect(),
            multipliers: attractor.multipliers.iter().map(|m| (m.re, m.im)).collect(),
            exponent: attractor.exponent,
            exponent_stderr: attractor.exponent_stderr,
            period: attractor.period,
            twin: attractor.twin.map(|t| t + 1),
            fraction,
        }
    }
}
