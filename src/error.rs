//! Errors of a request, with the values that were given.

use std::fmt;

/// An error: the value that was given, and the values that are allowed.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// A quantity is not finite, or outside its range.
    Range {
        /// The name of the quantity.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The values allowed.
        allowed: &'static str,
    },
    /// A parameter of an effect is not finite, or outside its range.
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
    Effect {
        /// The name given.
        name: String,
    },
    /// No parameter of that name.
    NoParameter {
        /// The name given.
        name: String,
    },
    /// A formula that cannot be an effect.
    Formula {
        /// Its name.
        name: String,
        /// The error, its place and the text expected there.
        why: String,
    },
    /// One effect given twice.
    Twice {
        /// The name given.
        name: String,
        /// The effect or parameter that it repeats.
        other: String,
    },
    /// A map cannot have the effect.
    NotMappable {
        /// The effect.
        effect: String,
        /// Why not.
        why: &'static str,
    },
    /// Hanging at rest is no solution whose stability the linear equation tells.
    NoRest {
        /// Why not.
        why: &'static str,
    },
    /// Arrays that belong together have different lengths.
    Lengths {
        /// The lengths given.
        given: (usize, usize),
        /// The names of the arrays.
        names: (&'static str, &'static str),
    },
    /// The wrong number of values for the parameters of an effect.
    Values {
        /// The effect.
        effect: String,
        /// How many it has, and how many were given.
        given: [usize; 2],
    },
    /// `PENDMAP_SIMD` names no instruction set of this processor.
    Simd {
        /// The name given.
        name: String,
    },
    /// No number of steps reaches the tolerance.
    Tolerance {
        /// The tolerance requested.
        tol: f64,
        /// The smallest error reached.
        reached: f64,
    },
    /// More memory than is free.
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
    Stored {
        /// What they should be.
        what: &'static str,
    },
    /// Motions leave the range of numbers.
    Diverges,
    /// The caller asked to stop.
    Interrupted,
    /// A thread could not be made.
    Threads(String),
}

/// A number without the zeros of its power of ten.
fn short(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-5..1e16).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { name, value, allowed } => {
                let value = short(*value);
                write!(f, "{name} must be {allowed}, got {value}")
            }
            Self::Parameter { effect, parameter, value, allowed: [low, high] } => {
                let value = short(*value);
                let range = format!("a finite number from {low} to {high}");
                write!(f, "{effect}: {parameter} must be {range}, got {value}")
            }
            Self::Effect { name } => {
                write!(f, "effect must be one that pendmap effects lists, got '{name}'")
            }
            Self::NoParameter { name } => write!(f, "parameter must be one of the model, got '{name}'"),
            Self::Formula { name, why } => write!(f, "formula '{name}': {why}"),
            Self::Twice { name, other } => {
                write!(f, "{name} and {other} are the same effect: one of them must be left out")
            }
            Self::NotMappable { effect, why } => {
                write!(f, "{effect} can be in one trajectory, not in maps: {why}")
            }
            Self::NoRest { why } => write!(f, "hanging at rest has no critical curves here: {why}"),
            Self::Lengths { given, names } => write!(
                f,
                "{} and {} must be as many values, got {} and {}",
                names.0, names.1, given.0, given.1
            ),
            Self::Values { effect, given: [own, given] } => write!(
                f,
                "{effect} must have as many values as parameters, {own}, got {given}"
            ),
            Self::Simd { name } => write!(
                f,
                "PENDMAP_SIMD must be avx512, avx2, sse, neon or portable, as far as this processor \
                 has them, got '{name}'"
            ),
            Self::Tolerance { tol, reached } => write!(
                f,
                "tol must be {reached:.1e} or more here, the smallest error that steps can reach, got {tol:e}"
            ),
            Self::Memory { what, count, needed, free } => {
                write!(f, "{count} {what} need about {:.3} GB, ", needed / 1e9)?;
                match free {
                    Some(free) => write!(f, "{:.3} GB are free: they must be fewer", free / 1e9),
                    None => f.write_str("more than is free: they must be fewer"),
                }
            }
            Self::Stored { what } => {
                write!(f, "{what} must be what this version has stored, got other bytes")
            }
            Self::Diverges => f.write_str(
                "the motion leaves the range of numbers: it begins too fast, or a torque or effect of \
                 this model feeds it energy",
            ),
            Self::Interrupted => f.write_str("interrupted"),
            Self::Threads(why) => write!(f, "threads: {why}"),
        }
    }
}

impl std::error::Error for Error {}
