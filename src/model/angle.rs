//! Topology of a pendulum's angle: the circle, or the line.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use crate::lanes::Lane;
use crate::lanes::sine;

/// The circle, where a turn makes no difference, or the line, where an effect counts turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Angle {
    /// Angles in [-pi, pi].
    #[default]
    Circle,
    /// Angles of any size.
    Line,
}

impl Angle {
    /// Other angles, relative to one, that are equal to it or may be adjacent.
    #[must_use]
    pub const fn turns(self) -> &'static [f64] {
        match self {
            Self::Circle => &[-TAU, 0.0, TAU],
            Self::Line => &[0.0],
        }
    }

    /// The angle without whole turns.
    #[must_use]
    pub fn wrapped(self, angle: f64) -> f64 {
        match self {
            Self::Circle => angle - TAU * (angle / TAU).round(),
            Self::Line => angle,
        }
    }

    /// The half turn nearest to an angle: even numbers hang, odd ones are inverted.
    #[must_use]
    pub fn half_turn(self, angle: f64) -> i64 {
        let nearest = (angle / PI).round() as i64;
        if self == Self::Circle { nearest.rem_euclid(2) } else { nearest }
    }

    /// Distance of two states.
    #[must_use]
    pub fn distance(self, a: [f64; 2], b: [f64; 2]) -> f64 {
        self.wrapped(a[0] - b[0]).hypot(a[1] - b[1])
    }

    /// The angle wrapped by [`sine::wrap`], in half turns; on the line the angle itself.
    #[inline(always)]
    pub fn wrap<L: Lane>(self, half_turns: L) -> (L, L) {
        let part = if self == Self::Circle { 0.5 } else { 0.0 };
        sine::wrap(half_turns, part)
    }
}
