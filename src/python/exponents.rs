//! Bindings of Lyapunov exponents.

use numpy::{PyArray2, PyReadonlyArray1};
use pendmap::attractor::Attractor as Found;
use pendmap::maps::control::pool;
use pendmap::maps::ensemble::{self, WINDOW};
use pendmap::maps::lyapunov::{End, Request, lyapunov as exponent_of};
use pendmap::maps::tangent_growth::Bundle;
use pyo3::prelude::*;

use super::convert::{Array, Attractor, array, states};
use super::long_calls::interruptible;
use super::model::Model;
use super::motion::strobe;
use super::{raise, reckon};

/// Numerical choices as Python passes them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ExponentChoices {
    precision: f64,
    tol: f64,
    max_periods: Option<u32>,
    threads: usize,
    seed: u64,
}

/// The largest Lyapunov exponent of a start.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Lyapunov {
    /// `captured`, `chaotic`, `undamped`, `undecided` or `failed`.
    end: &'static str,
    attractor: Option<Py<Attractor>>,
    /// Periods until the attractor captured the start.
    transient: Option<u32>,
    /// Trajectories of the ensemble that an attractor captured.
    lost: usize,
    /// Logarithm of the growth of the start's own tangent in each period.
    course: Array<f64>,
    bound: u32,
    chaos_bound: u32,
    steps_per_period: usize,
    reached_error: f64,
    simd: &'static str,
    /// Periods of a window.
    window: usize,
    ensemble: Option<Py<Ensemble>>,
}

/// Many trajectories of a chaotic attractor, or of undamped motion.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Ensemble {
    /// Logarithms of the growth of tangents, by trajectory and window.
    growth: Py<PyArray2<f64>>,
    /// Periods before the first window.
    dropped: u32,
    /// The exponent and its standard error.
    exponent: (f64, f64),
    /// The sum of both exponents and its standard error.
    sum: (f64, f64),
}

impl Ensemble {
    fn new(py: Python<'_>, found: &ensemble::Ensemble) -> PyResult<Self> {
        Ok(Self {
            growth: PyArray2::from_vec2(py, &found.growth)?.unbind(),
            dropped: found.dropped,
            exponent: (found.exponent, found.stderr),
            sum: found.sum,
        })
    }
}

/// The largest exponent of the attractor that a start reaches.
#[pyfunction]
#[pyo3(signature = (model, start, choices, progress=None))]
pub fn lyapunov(
    py: Python<'_>,
    model: Model,
    start: (f64, f64),
    choices: ExponentChoices,
    progress: Option<Py<PyAny>>,
) -> PyResult<Lyapunov> {
    let pendulum = model.pendulum()?;
    let ExponentChoices { precision, tol, max_periods, threads, seed } = choices;
    let start = [start.0, start.1];
    let request = Request { start, precision, tol, max_periods, threads, seed };
    let found =
        interruptible(py, progress.as_ref(), |control| exponent_of(&pendulum, &request, control))?;
    let ensemble = found.ensemble;
    let mut attractor = found.attractor;
    if let (Some(attractor), Some(ensemble), End::Chaotic) = (&mut attractor, &ensemble, found.end)
    {
        (attractor.exponent, attractor.exponent_stderr) = (ensemble.exponent, ensemble.stderr);
    }
    let attractor = attractor.map(|a| Attractor::new(&Found { twin: None, ..a }, f64::NAN));
    let ensemble = ensemble.map(|e| Py::new(py, Ensemble::new(py, &e)?)).transpose()?;
    Ok(Lyapunov {
        end: match found.end {
            End::Captured => "captured",
            End::Chaotic => "chaotic",
            End::Undamped => "undamped",
            End::Undecided => "undecided",
            End::Failed => "failed",
        },
        attractor: attractor.map(|a| Py::new(py, a)).transpose()?,
        transient: found.transient,
        lost: found.lost,
        course: array(py, found.growth),
        bound: found.bound,
        chaos_bound: found.chaos_bound,
        steps_per_period: found.steps,
        reached_error: found.reached_error,
        simd: found.simd.name(),
        window: WINDOW,
        ensemble,
    })
}

/// Logarithms of the growth of a tangent along each start, `windows` times over `window` periods.
#[pyfunction]
#[pyo3(signature = (model, theta, velocity, windows, window, steps_per_period, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn growth<'py>(
    py: Python<'py>,
    model: Model,
    theta: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    windows: usize,
    window: usize,
    steps_per_period: usize,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let pendulum = model.pendulum()?;
    pendulum.check_mappable().map_err(raise)?;
    let strobe = strobe(&pendulum, steps_per_period)?;
    let states = states(&theta, &velocity)?;
    // A row of windows for each start, and the array of all.
    reckon("starts", states.len(), 16 * windows.saturating_add(8))?;
    let pool = pool(threads).map_err(raise)?;
    let rows = interruptible(py, progress.as_ref(), |control| {
        control.begin(states.len());
        Bundle::new(&states).grow(&strobe, windows, window, &pool, control)
    })?;
    Ok(PyArray2::from_vec2(py, &rows)?)
}
