//! Steps of parameters: on a linear or on a logarithmic scale.
//!
//! Records of a rough spot, a magnet or a warming determine mainly a product of powers of its size and
//! its width: the sum of squares has a valley along which one is halved while the other doubles. The
//! valley is straight in logarithms only; a step to `x + d` leads far up its side, a step to
//! `x exp(d / x)` leads along its bottom. To first order the two are equal, and so are derivatives,
//! errors and the end of the search. Where one size compensates another, for example a drag and damping,
//! the valley is straight on the linear scale: both scales are tried.

use super::problem::{Free, Slot};
use super::record::Record;
use crate::model::Parameter;

/// Largest change of a width in one step, as the logarithm of the ratio.
const FARTHEST: f64 = 2.0;
/// Relative change of a size above which its sign may change: the step is then linear.
const SIGN: f64 = 1.0;

/// The scale of the steps of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepScale {
    /// Linear.
    Linear,
    /// Logarithmic while the sign is certain: the size of an effect whose width is free too.
    Size,
    /// Logarithmic: a width, a time constant, any parameter that is always positive.
    Width,
}

impl StepScale {
    /// The scale of the parameter `free`, one of `all` of `records`.
    #[must_use]
    pub fn of(free: &Free, all: &[Free], records: &[Record]) -> Self {
        let Some((record, Slot::Parameter(Parameter::OfEffect { effect, place }))) =
            free.places.first().copied()
        else {
            return Self::Linear;
        };
        let parameters = records[record].pendulum.effects[effect].kind.definition().parameters;
        let positive = |index: usize| parameters.at(index).range[0] > 0.0;
        let is_free = |index: usize| {
            let other = Parameter::OfEffect { effect, place: index };
            let slot = (record, Slot::Parameter(other));
            all.iter().any(|free| free.places.contains(&slot))
        };
        match place {
            0 if (1..parameters.count()).any(|k| positive(k) && is_free(k)) => Self::Size,
            1.. if positive(place) => Self::Width,
            _ => Self::Linear,
        }
    }

    /// The largest allowed part of a step `by` from `value`.
    #[must_use]
    pub fn part(self, value: f64, by: f64) -> f64 {
        if self == Self::Width { (FARTHEST * value.abs() / by.abs()).min(1.0) } else { 1.0 }
    }

    /// The value after a step `by` from `value`.
    #[must_use]
    pub fn gone(self, value: f64, by: f64) -> f64 {
        let ratio = by / value;
        match self {
            Self::Width => value * ratio.exp(),
            Self::Size if ratio.abs() < SIGN => value * ratio.exp(),
            _ => value + by,
        }
    }
}
