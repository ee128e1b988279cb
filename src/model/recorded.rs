//! A recorded motion of the pivot, interpolated.
//!
//! Without dimensions: lengths in `g / w0^2` (a simple pendulum's own length), times in `1 / w0`, so
//! that an acceleration is one over gravity. Upward and toward positive theta are positive.

use super::spline::Spline;
use crate::error::Error;

/// The recorded quantity of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Position of the pivot.
    Position,
    /// Its velocity.
    Velocity,
    /// Its acceleration.
    Acceleration,
}

/// Samples of one component of the motion.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Their quantity.
    pub quantity: Quantity,
    /// One for each time.
    pub values: &'a [f64],
}

/// The pivot's acceleration, from samples of it, of the velocity or of the position at times that
/// need not be equally far apart.
///
/// A spline of degree 5 goes through the samples; its second derivative, from positions, still has
/// two continuous derivatives. Before the first and after the last sample the acceleration stays
/// what it is there.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    times: Vec<f64>,
    vertical: Option<Spline>,
    horizontal: Option<Spline>,
}

impl Recorded {
    /// The motion from samples at `times` of the upward motion, the motion toward positive theta, or both.
    ///
    /// # Errors
    /// [`Error::Range`] for a number that is not finite, a time that is not after the one before it,
    /// and fewer than 6 samples; [`Error::Lengths`] where there are not as many values as times.
    pub fn new(
        times: &[f64],
        vertical: Option<Samples<'_>>,
        horizontal: Option<Samples<'_>>,
    ) -> Result<Self, Error> {
        if times.len() < Spline::FEWEST {
            let value = times.len() as f64;
            return Err(Error::Range { name: "number of samples", value, allowed: "6 or more" });
        }
        let late = times.windows(2).find(|pair| pair[1] <= pair[0]).map(|pair| pair[1]);
        let odd = times.iter().copied().find(|time| !time.is_finite()).or(late);
        if let Some(value) = odd {
            let allowed = "a finite time after the one before it";
            return Err(Error::Range { name: "time of a sample", value, allowed });
        }
        let spline = |samples: Option<Samples<'_>>| {
            let Some(Samples { quantity, values }) = samples else { return Ok(None) };
            if values.len() != times.len() {
                let given = (times.len(), values.len());
                return Err(Error::Lengths { given, names: ("times", "the pivot's motion") });
            }
            if let Some(value) = values.iter().copied().find(|value| !value.is_finite()) {
                let allowed = "a finite number";
                return Err(Error::Range { name: "sample", value, allowed });
            }
            let order = match quantity {
                Quantity::Position => 2,
                Quantity::Velocity => 1,
                Quantity::Acceleration => 0,
            };
            Ok(Some(Spline::derivative(times, values, order)))
        };
        let (vertical, horizontal) = (spline(vertical)?, spline(horizontal)?);
        Ok(Self { times: times.to_vec(), vertical, horizontal })
    }

    /// The accelerations over gravity at time `tau`: upward, and toward positive theta.
    #[must_use]
    pub fn acceleration(&self, tau: f64) -> [f64; 2] {
        let last = self.times.len() - 1;
        let inside = tau.clamp(self.times[0], self.times[last]);
        let piece = self.times.partition_point(|time| *time <= inside).clamp(1, last) - 1;
        let passed = inside - self.times[piece];
        [&self.vertical, &self.horizontal]
            .map(|spline| spline.as_ref().map_or(0.0, |spline| spline.at(piece, passed)))
    }

    /// The first and the last time.
    #[must_use]
    pub fn span(&self) -> [f64; 2] {
        [self.times[0], self.times[self.times.len() - 1]]
    }

    /// The greatest acceleration at a sample, in either component.
    #[must_use]
    pub fn greatest(&self) -> f64 {
        let all = self.times.iter().flat_map(|time| self.acceleration(*time));
        all.fold(0.0, |most, a| a.abs().max(most))
    }

    /// The mean time between samples.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        let [first, last] = self.span();
        (last - first) / (self.times.len() - 1) as f64
    }
}
