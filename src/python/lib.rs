//! The Python module `pendmap._core`. Each function extracts, detaches, calls and converts.

// PyO3 hands arguments over by value, and its signatures read best with the lifetime spelled out.
#![allow(clippy::needless_pass_by_value, clippy::elidable_lifetime_names)]

mod continuation;
mod convert;
mod exponents;
mod fit;
mod library;
mod long_calls;
mod maps;
mod model;
mod motion;
mod orbits;
mod parameter_maps;
mod surveys;
mod tongues;

use pendmap::attractor::Kind;
use pendmap::error::Error;
use pendmap::lanes::InstructionSet;
use pendmap::maps::bounds::{LEAST, cell_periods, max_periods};
use pendmap::memory;
use pendmap::model::Angle;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use model::Model;

pyo3::create_exception!(_core, Diverged, PyValueError, "A motion left the range of numbers.");

/// The Python exception of an error of the core: invalid input is a `ValueError`, what the system refuses a
/// `MemoryError` or an `OSError`.
fn raise(error: Error) -> PyErr {
    use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyOSError};
    match error {
        Error::Diverges => Diverged::new_err(error.to_string()),
        Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        Error::Memory { .. } => PyMemoryError::new_err(error.to_string()),
        Error::Threads(_) => PyOSError::new_err(error.to_string()),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// The unit of "periods" of a model, whose parameters and effects are checked.
#[pyfunction]
fn period(model: Model) -> PyResult<f64> {
    Ok(model.pendulum()?.period())
}

/// Whether an effect counts turns, so that angles are not wrapped.
#[pyfunction]
fn counts_turns(model: Model) -> PyResult<bool> {
    Ok(model.pendulum()?.angle() == Angle::Line)
}

/// Periods after which a start of a basin map, and a cell of a map over parameters, is undecided where
/// none are given; and the first of the two where damping is not small.
#[pyfunction]
fn bounds(model: Model) -> PyResult<(u32, u32, u32)> {
    let pendulum = model.pendulum()?;
    Ok((max_periods(&pendulum), cell_periods(&pendulum), LEAST))
}

/// The instruction set that a call would use now.
#[pyfunction]
fn simd() -> PyResult<&'static str> {
    Ok(InstructionSet::choose().map_err(raise)?.name())
}

/// The instruction sets of this processor, fastest first.
#[pyfunction]
fn simd_available() -> Vec<&'static str> {
    InstructionSet::ALL
        .into_iter()
        .filter(|simd| simd.available())
        .map(InstructionSet::name)
        .collect()
}

/// The kinds of attractor in order: rest first, chaos last.
#[pyfunction]
fn kinds() -> Vec<&'static str> {
    Kind::ALL.iter().map(|kind| kind.word()).collect()
}

/// Refuses `count` of `what`, with `each` bytes each, if that exceeds the free memory.
#[pyfunction]
fn reckon(what: &str, count: usize, each: usize) -> PyResult<()> {
    memory::reckon(what, count, each).map_err(raise)
}

/// Number of threads that a call uses if none is given.
#[pyfunction]
fn default_threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

#[pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::{
        Diverged, bounds,
        continuation::{Continuation, continuation},
        convert::Attractor,
        counts_turns, default_threads,
        exponents::{Ensemble, Lyapunov, growth, lyapunov},
        fit::{Fit, FitPoint, FittedRun, WindowRows, fit_rows, fit_runs, replay},
        kinds,
        library::{effects, formula, roles},
        maps::{BasinPlan, LabelledStarts, Reliability, Texture, TextureSum, Uncertainty, thinned},
        motion::{Trajectory, acceleration, advance, choose_steps, rates, simulate},
        orbits::{Orbit, OrbitSearch, orbits, orbits_near},
        parameter_maps::{Bifurcation, Followed, ParameterMap, parameter_names},
        period, reckon, simd, simd_available,
        surveys::Survey,
        tongues::{CriticalAmplitudes, tongues},
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Loads numpy's functions now, since an interrupt could occur during a later import.
        numpy::PyArray1::<f64>::zeros(module.py(), 0, false);
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
