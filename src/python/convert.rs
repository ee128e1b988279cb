//! Shared conversions: arrays, states and attractors.

use numpy::{Element, IntoPyArray, PyArray1, PyReadonlyArray1};
use pendmap::attractor::{self, Kind};
use pendmap::error::Error;
use pendmap::integrate::State;
use pendmap::model::Angle;
use pyo3::exceptions::PyValueError;
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
    /// A name that no other of the same result has.
    name: String,
    /// The name of all of the same kind, period, turns, side and turn.
    plain: String,
    /// The name that it shares with its mirror image.
    pair: String,
    kind: &'static str,
    /// Its place in an order by kind, period and turns: rest first, chaos last.
    rank: (usize, usize, i64),
    chaotic: bool,
    /// Period in forcing periods; none if meaningless.
    n: Option<usize>,
    /// Net turns over that period; without one the sense of its turns.
    w: i64,
    /// Side to which one of two asymmetric twins leans; 0 for others.
    lean: i64,
    /// Multiple of a turn around which it moves.
    turn: i64,
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
        let attractor::Attractor { kind, n, w, .. } = *attractor;
        Self {
            name: attractor.name.clone(),
            plain: attractor.plain_name(),
            pair: attractor.pair_name(),
            kind: kind.word(),
            rank: (kind as usize, n.unwrap_or(0), w.abs()),
            chaotic: kind.is_chaotic(),
            n,
            w,
            lean: attractor.lean,
            turn: attractor.turn,
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

#[pymethods]
impl Attractor {
    /// One of this description alone; `n` is 0 where it has no meaning.
    #[new]
    #[pyo3(signature = (kind, n=0, w=0, lean=0, turn=0))]
    fn described(kind: &str, n: usize, w: i64, lean: i64, turn: i64) -> PyResult<Self> {
        let known = Kind::ALL.into_iter().find(|known| known.word() == kind);
        let kind = known.ok_or_else(|| PyValueError::new_err(format!("no kind {kind:?}")))?;
        let plain = attractor::Attractor {
            lean,
            turn,
            ..attractor::Attractor::described(kind, (n > 0).then_some(n), w, Angle::Circle)
        };
        let name = plain.plain_name();
        Ok(Self::new(&attractor::Attractor { name, ..plain }, f64::NAN))
    }
}
