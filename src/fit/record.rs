//! A record of one motion.

use std::sync::Arc;

use super::quantised::surplus;
use super::rod_sensor::RodSensor;
use crate::error::Error;
use crate::model::{Pendulum, Recorded};

/// A record of one motion, and the pendulum that models it.
#[derive(Clone, Debug)]
pub struct Record {
    /// The pendulum with all parameters that are not free.
    pub pendulum: Pendulum,
    /// A recorded motion of the pivot.
    pub recorded: Option<Arc<Recorded>>,
    /// Times of the samples, times `w_ref`; each after the one before it.
    pub times: Vec<f64>,
    /// Readings, rad; for a sensor on the rod in the unit of its factors.
    pub readings: Vec<f64>,
    /// The gyroscope that read, where it was no sensor of the angle; of effects on
    /// the reading only those that multiply it act.
    pub rod_sensor: Option<RodSensor>,
    /// About which angles these were, rad, where the readings are none: initial states begin there.
    pub angles: Option<Vec<f64>>,
    /// One over the standard error of each reading; 0 for untrusted readings.
    pub weights: Vec<f64>,
    /// The counts that readings were rounded to; then their standard errors are those before. None
    /// where these hold the rounding.
    pub counts: Option<Counts>,
    /// The longest window, times `w_ref`; infinite where one may cover the whole record.
    pub longest: f64,
}

/// Counts of a sensor.
#[derive(Clone, Debug)]
pub struct Counts {
    /// The step from one to the next, in the unit of the readings.
    pub step: f64,
    /// For each sample the excess of its deviance over that of a value, see [`surplus`].
    pub surplus: Vec<f64>,
}

impl Counts {
    /// Counts of `step` for readings with one over the standard errors `weights`.
    ///
    /// # Errors
    /// [`Error::Range`] for a step that is not above 0.
    pub fn new(step: f64, weights: &[f64]) -> Result<Self, Error> {
        if !(step > 0.0 && step.is_finite()) {
            return Err(range("count", step, "a number above 0"));
        }
        let mut last = (0.0_f64, 0.0);
        let of = |weight: &f64| {
            // Neighbours mostly have the same, and it takes an integral.
            if *weight > 0.0 && weight.to_bits() != last.0.to_bits() {
                last = (*weight, surplus(step, *weight));
            }
            last.1
        };
        Ok(Self { step, surplus: weights.iter().map(of).collect() })
    }
}

impl Record {
    /// Angles that its readings are, or are about.
    #[must_use]
    pub fn angles(&self) -> &[f64] {
        self.angles.as_ref().unwrap_or(&self.readings)
    }

    /// Checks lengths, times and numbers, as [`Problem::new`](super::Problem::new) says.
    ///
    /// # Errors
    /// [`Error::Lengths`] and [`Error::Range`].
    pub fn check(&self) -> Result<(), Error> {
        let all: [(_, &[f64]); 3] =
            [("readings", &self.readings), ("weights", &self.weights), ("angles", self.angles())];
        for (name, values) in all {
            if values.len() != self.times.len() {
                let given = (self.times.len(), values.len());
                return Err(Error::Lengths { given, names: ("times", name) });
            }
            if let Some(value) = values.iter().find(|value| !value.is_finite()) {
                return Err(range("reading or weight", *value, "a finite number"));
            }
        }
        if let Some(value) = self.weights.iter().find(|weight| **weight < 0.0) {
            return Err(range("weight", *value, "0 or more"));
        }
        let late = self.times.windows(2).find(|pair| pair[1] <= pair[0]).map(|pair| pair[1]);
        if let Some(value) = self.times.iter().copied().find(|time| !time.is_finite()).or(late) {
            return Err(range("time of a sample", value, "a finite time after the one before it"));
        }
        let trusted = self.weights.iter().filter(|weight| **weight > 0.0).count();
        if trusted < 3 {
            return Err(range(
                "number of trusted samples",
                trusted as f64,
                "3 or more in a record",
            ));
        }
        Ok(())
    }
}

/// The error for a number out of its range.
pub(super) fn range(name: &'static str, value: f64, allowed: &'static str) -> Error {
    Error::Range { name, value, allowed }
}
