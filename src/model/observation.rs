//! The sensor's reading as a function of angle and velocity. The motion does not depend on it: maps
//! ignore it.

use super::effects::{Action, Kind, MOST_PARAMETERS};
use super::parameter::Parameter;
use super::pendulum::Pendulum;
use crate::lanes::Real;

/// The effects on the reading, with their parameters as numbers of some kind.
#[derive(Clone, Debug)]
pub struct Observation<R> {
    readings: Vec<(Kind, [R; MOST_PARAMETERS])>,
}

impl<R: Real> Observation<R> {
    /// The observation of `pendulum`; `number` makes a number of a parameter and its value, as for
    /// [`Equation::lift`](super::Equation::lift).
    pub fn lift(pendulum: &Pendulum, mut number: impl FnMut(Parameter, f64) -> R) -> Self {
        let mut readings = Vec::new();
        for (index, effect) in pendulum.effects.iter().enumerate() {
            if effect.is(&[Action::Reading]) {
                readings.push((effect.kind.clone(), effect.lift(index, &mut number)));
            }
        }
        Self { readings }
    }

    /// Keeps only the effects that multiply a reading, for a sensor that reads no angle.
    #[must_use]
    pub fn scaling(mut self) -> Self {
        self.readings.retain(|(kind, _)| kind.scales());
        self
    }

    /// The reading at the angle `theta`, rad and not wrapped, passed at `velocity` at the
    /// laboratory's time `lab`: effects are applied in the order of the model.
    #[must_use]
    pub fn read(&self, theta: R, velocity: R, lab: R) -> R {
        let mut reading = theta;
        for (kind, parameters) in &self.readings {
            reading = kind.reading(parameters, reading, velocity, lab);
        }
        reading
    }
}
