//! How parameters go along a step: straight, or in ratios.
//!
//! What records say of a rough spot, a magnet or a warming is nearly a product of powers of its size
//! and its width: the sum of squares has a valley along which one is halved while the other doubles.
//! That valley is straight in the logarithms alone; a step to the values `x + d`, which leads far up
//! its side, leads along its bottom as `x exp(d / x)`. To first order the two are the same, so that
//! derivatives, errors and the end of the search are. Where a size makes up for another one, as that
//! of a drag for damping, the valley is straight as it is: both ways are tried.

use super::problem::{Free, Slot};
use super::record::Record;

/// The most that a width changes in one step, as the logarithm of its ratio.
const FARTHEST: f64 = 2.0;
/// A size that changes by more than this part of itself may change its sign.
const SIGN: f64 = 1.0;

/// How a parameter goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepScale {
    /// By the step.
    Linear,
    /// In ratios, as long as its sign is sure: the size of an effect whose width is free too.
    Size,
    /// In ratios: a width, a time constant, what is always positive.
    Width,
}

impl StepScale {
    /// How the parameter `free` goes, one of `all` of `records`.
    #[must_use]
    pub fn of(free: &Free, all: &[Free], records: &[Record]) -> Self {
        let Some((record, Slot::Parameter(place))) = free.places.first().copied() else {
            return Self::Linear;
        };
        let pendulum = &records[record].pendulum;
        let Some((effect, own)) = pendulum.owner(place) else { return Self::Linear };
        let parameters = pendulum.effects[effect].kind.definition().parameters;
        let positive = |index: usize| parameters.at(index).range[0] > 0.0;
        let is_free = |index: usize| {
            let slot = (record, Slot::Parameter(place - own + index));
            all.iter().any(|free| free.places.contains(&slot))
        };
        match own {
            0 if (1..parameters.count()).any(|k| positive(k) && is_free(k)) => Self::Size,
            1.. if positive(own) => Self::Width,
            _ => Self::Linear,
        }
    }

    /// The part of a step `by` from `value` that is not too far.
    #[must_use]
    pub fn part(self, value: f64, by: f64) -> f64 {
        if self == Self::Width { (FARTHEST * value.abs() / by.abs()).min(1.0) } else { 1.0 }
    }

    /// Where a step `by` leads from `value`.
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
