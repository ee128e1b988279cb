//! Errors of a request, with the values that were given.

use std::sync::atomic::{AtomicBool, Ordering};

/// An error: the value that was given, and the values that are allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A quantity is not finite, or outside its range.
    #[error("{name} must be {allowed}, got {}", short(*value))]
    Range {
        /// The name of the quantity.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The values allowed.
        allowed: &'static str,
    },
    /// A parameter of an effect is not finite, or outside its range.
    #[error(
        "{effect}: {parameter} must be a finite number from {} to {}, got {}",
        allowed[0], allowed[1], short(*value)
    )]
    Parameter {
        /// The effect.
        effect: String,
        /// Its parameter.
        parameter: String,
        /// The value given.
        value: f64,
        /// The bounds.
        allowed: [f64; 2],
    },
    /// No effect of that name.
    #[error("effect must be one of the library, got '{name}'")]
    Effect {
        /// The name given.
        name: String,
    },
    /// No parameter of that name.
    #[error("parameter must be one of the model, got '{name}'")]
    NoParameter {
        /// The name given.
        name: String,
    },
    /// A formula that cannot be an effect.
    #[error("formula '{name}': {why}")]
    Formula {
        /// Its name.
        name: String,
        /// The error, its place and the text expected there.
        why: String,
    },
    /// One effect given twice.
    #[error("{name} and {other} are the same effect: one of them must be left out")]
    Twice {
        /// The name given.
        name: String,
        /// The effect or parameter that it repeats.
        other: String,
    },
    /// A map cannot have the effect.
    #[error("{effect} can be in one trajectory, not in maps: {why}")]
    NotMappable {
        /// The effect.
        effect: String,
        /// Why not.
        why: &'static str,
    },
    /// Hanging at rest is no solution whose stability the linear equation tells.
    #[error("hanging at rest has no critical curves here: {why}")]
    NoRest {
        /// Why not.
        why: &'static str,
    },
    /// Newton's method finds no orbit from a start.
    #[error("start must be near an orbit of period {n}, Newton's method finds none from {start:?}")]
    NoOrbit {
        /// The period.
        n: usize,
        /// The start.
        start: [f64; 2],
    },
    /// Arrays that belong together have different lengths.
    #[error(
        "{} and {} must be as many values, got {} and {}",
        names.0, names.1, given.0, given.1
    )]
    Lengths {
        /// The lengths given.
        given: (usize, usize),
        /// The names of the arrays.
        names: (&'static str, &'static str),
    },
    /// The wrong number of values for the parameters of an effect.
    #[error("{effect} must have as many values as parameters, {}, got {}", given[0], given[1])]
    Values {
        /// The effect.
        effect: String,
        /// How many it has, and how many were given.
        given: [usize; 2],
    },
    /// `PENDMAP_SIMD` names no instruction set of this processor.
    #[error(
        "PENDMAP_SIMD must be avx512, avx2, sse, neon or portable, as far as this processor has them, \
         got '{name}'"
    )]
    Simd {
        /// The name given.
        name: String,
    },
    /// No number of steps reaches the tolerance.
    #[error(
        "tol must be {reached:.1e} or more here, the smallest error that steps can reach, got {tol:e}"
    )]
    Tolerance {
        /// The tolerance requested.
        tol: f64,
        /// The smallest error reached.
        reached: f64,
    },
    /// No number of steps is enough for a search of orbits.
    #[error(
        "motions must be known to {needed:e} after five periods where orbits are searched, got {reached:.1e} by the \
         best number of steps: the drive is too strong or too slow"
    )]
    Unresolved {
        /// The error that is needed.
        needed: f64,
        /// The smallest error reached.
        reached: f64,
    },
    /// More memory than is free.
    #[error("{}", of_memory(what, *count, *needed, *free))]
    Memory {
        /// The items of which there are too many.
        what: String,
        /// How many.
        count: usize,
        /// Bytes that they need.
        needed: f64,
        /// Bytes that are free, where the system says it.
        free: Option<f64>,
    },
    /// Bytes from a store that are damaged, or from another version.
    #[error("{what} must be what this version has stored, got other bytes")]
    Stored {
        /// What they should be.
        what: &'static str,
    },
    /// Motions leave the range of numbers.
    #[error(
        "the motion leaves the range of numbers: it begins too fast, or a torque or effect of this model \
         feeds it energy"
    )]
    Diverges,
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// A thread could not be made.
    #[error("threads: {0}")]
    Threads(String),
}

/// Ends a computation that its caller has cancelled.
///
/// # Errors
/// [`Error::Interrupted`] if `cancel` was set.
pub fn unless_cancelled(cancel: &AtomicBool) -> Result<(), Error> {
    if cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}

/// A number without the zeros of its power of ten.
fn short(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-5..1e16).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

fn of_memory(what: &str, count: usize, needed: f64, free: Option<f64>) -> String {
    let free = free.map_or_else(
        || "more than is free".to_owned(),
        |free| format!("{:.3} GB are free", free / 1e9),
    );
    format!("{count} {what} need about {:.3} GB, {free}: they must be fewer", needed / 1e9)
}
