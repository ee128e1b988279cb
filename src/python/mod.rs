//! The Python module `pendmap._core`. Each function extracts, detaches, calls and converts.

// PyO3 hands arguments over by value, and its signatures read best with the lifetime spelled out.
#![allow(clippy::needless_pass_by_value, clippy::elidable_lifetime_names)]

mod convert;
mod exponents;
mod fit;
mod library;
mod maps;
mod motion;
mod orbits;
mod planes;
mod tongues;
mod watch;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error::Error;
use crate::lanes::Path;
use crate::maps::bounds::{LEAST, cell_periods, max_periods};
use crate::memory;
use crate::model::Angle;
use crate::model::effects::Role;
use crate::model::formula::{ParameterSpec, Spec};
use crate::model::{Effect, Formula, Kind, Pendulum};

pyo3::create_exception!(_core, Diverged, PyValueError, "A motion left the range of numbers.");

/// One mapping of errors for all functions: what the caller gave is a `ValueError`, what the system
/// refuses a `MemoryError` or an `OSError`.
impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyOSError};
        match error {
            Error::Diverges => Diverged::new_err(error.to_string()),
            Error::Interrupted => PyKeyboardInterrupt::new_err(()),
            Error::Memory { .. } => PyMemoryError::new_err(error.to_string()),
            Error::Threads(_) => PyOSError::new_err(error.to_string()),
            _ => PyValueError::new_err(error.to_string()),
        }
    }
}

/// `(gamma, p, omega, phase, torque, theta_r, lab_time, effects)` as Python hands it over; each
/// effect is its name, or a formula, and its parameters in order.
type Parameters = (f64, f64, f64, f64, f64, f64, f64, Vec<(Which, Vec<f64>)>);

/// An effect as Python names it.
#[derive(FromPyObject)]
enum Which {
    /// One of the library.
    Library(String),
    /// A user's own.
    Formula(FormulaTuple),
}

/// `(name, term, revealed by, parameters)`.
type FormulaTuple = (String, String, String, Vec<ParameterTuple>);

/// `(name, power of w0, place of the parameter to be taken off it, unit, range, typical, meaning,
/// role)`.
type ParameterTuple =
    (String, f64, Option<usize>, String, [f64; 2], [f64; 2], String, Option<String>);

impl Which {
    fn kind(self) -> Result<Kind, Error> {
        match self {
            Self::Library(name) => Kind::named(&name),
            Self::Formula(given) => Ok(Kind::Formula(formula_of(given)?)),
        }
    }
}

fn formula_of(given: FormulaTuple) -> Result<&'static Formula, Error> {
    let (name, term, revealed_by, parameters) = given;
    let parameter = |(name, power, less, unit, range, typical, meaning, role): ParameterTuple| {
        let role = Role::ALL.into_iter().find(|known| Some(known.words()) == role.as_deref());
        ParameterSpec { name, power, less, unit, range, typical, meaning, role }
    };
    let parameters = parameters.into_iter().map(parameter).collect();
    Formula::new(&Spec { name, term, revealed_by, parameters })
}

fn pendulum(parameters: Parameters) -> Result<Pendulum, Error> {
    let (gamma, p, omega, phase, torque, theta_r, lab_time, effects) = parameters;
    let mut pendulum = Pendulum::new(gamma, p, omega, phase, torque)?.with_friction(theta_r)?;
    pendulum.lab_time = lab_time;
    for (which, values) in effects {
        pendulum = pendulum.with_effect(Effect::new(which.kind()?, &values)?)?;
    }
    Ok(pendulum)
}

/// The unit of "periods" of a model, whose parameters and effects are checked.
#[pyfunction]
fn period(parameters: Parameters) -> PyResult<f64> {
    Ok(pendulum(parameters)?.period())
}

/// Whether an effect counts turns, so that angles are not wrapped.
#[pyfunction]
fn counts_turns(parameters: Parameters) -> PyResult<bool> {
    Ok(pendulum(parameters)?.angle() == Angle::Line)
}

/// Periods after which a start of a basin map, and a cell of a map over parameters, is undecided where
/// none are given; and the first of the two where damping is not small.
#[pyfunction]
fn bounds(parameters: Parameters) -> PyResult<(u32, u32, u32)> {
    let pendulum = pendulum(parameters)?;
    Ok((max_periods(&pendulum), cell_periods(&pendulum), LEAST))
}

/// The instruction set that a call would use now.
#[pyfunction]
fn simd() -> PyResult<&'static str> {
    Ok(Path::choose()?.name())
}

/// The instruction sets that this processor has, quickest first.
#[pyfunction]
fn simd_available() -> Vec<&'static str> {
    Path::ALL.into_iter().filter(|path| path.available()).map(Path::name).collect()
}

/// Refuses `count` of `what`, with `each` bytes each, where that is more memory than is free.
#[pyfunction]
fn reckon(what: &str, count: usize, each: usize) -> PyResult<()> {
    Ok(memory::reckon(what, count, each)?)
}

/// Number of threads that a call uses if none is given.
#[pyfunction]
fn default_threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // Loads numpy's functions now: later an interrupt could come in between.
    numpy::PyArray1::<f64>::zeros(module.py(), 0, false);
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("Diverged", module.py().get_type::<Diverged>())?;
    module.add_function(wrap_pyfunction!(simd, module)?)?;
    module.add_function(wrap_pyfunction!(simd_available, module)?)?;
    module.add_function(wrap_pyfunction!(reckon, module)?)?;
    module.add_function(wrap_pyfunction!(default_threads, module)?)?;
    module.add_function(wrap_pyfunction!(library::effects, module)?)?;
    module.add_function(wrap_pyfunction!(library::roles, module)?)?;
    module.add_function(wrap_pyfunction!(library::formula, module)?)?;
    module.add_function(wrap_pyfunction!(period, module)?)?;
    module.add_function(wrap_pyfunction!(counts_turns, module)?)?;
    module.add_function(wrap_pyfunction!(bounds, module)?)?;
    module.add_function(wrap_pyfunction!(motion::advance, module)?)?;
    module.add_function(wrap_pyfunction!(motion::choose_steps, module)?)?;
    module.add_function(wrap_pyfunction!(motion::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(maps::basins_grid, module)?)?;
    module.add_function(wrap_pyfunction!(maps::basins_list, module)?)?;
    module.add_function(wrap_pyfunction!(maps::texture, module)?)?;
    module.add_function(wrap_pyfunction!(orbits::orbits, module)?)?;
    module.add_function(wrap_pyfunction!(planes::parameter_names, module)?)?;
    module.add_function(wrap_pyfunction!(planes::parameter_map, module)?)?;
    module.add_function(wrap_pyfunction!(planes::bifurcation, module)?)?;
    module.add_function(wrap_pyfunction!(exponents::lyapunov, module)?)?;
    module.add_function(wrap_pyfunction!(exponents::growth, module)?)?;
    module.add_function(wrap_pyfunction!(tongues::tongues, module)?)?;
    module.add_function(wrap_pyfunction!(motion::acceleration, module)?)?;
    module.add_function(wrap_pyfunction!(fit::fit_runs, module)?)?;
    module.add_function(wrap_pyfunction!(fit::fit_equations, module)?)?;
    module.add_function(wrap_pyfunction!(fit::fit_rows, module)?)?;
    module.add_function(wrap_pyfunction!(fit::replay, module)?)?;
    Ok(())
}
