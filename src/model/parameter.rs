//! The parameters of a pendulum, by which they are read and set.

use super::pendulum::Pendulum;
use crate::error::Error;

/// A parameter of a pendulum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// [`Pendulum::gamma`].
    Gamma,
    /// [`Pendulum::theta_r`].
    ThetaR,
    /// [`Pendulum::torque`].
    Torque,
    /// Amplitude of the drive.
    P,
    /// Frequency of the drive.
    Omega,
    /// Phase of the drive.
    Phase,
    /// A parameter of an effect.
    OfEffect {
        /// Index in [`Pendulum::effects`].
        effect: usize,
        /// Index among the parameters of the effect.
        place: usize,
    },
}

impl Parameter {
    /// Those that every pendulum has.
    pub const COMMON: [Self; 6] =
        [Self::Gamma, Self::ThetaR, Self::Torque, Self::P, Self::Omega, Self::Phase];
}

impl Pendulum {
    /// All parameters, those of the effects last.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let of_effect = |(effect, count): (usize, usize)| {
            (0..count).map(move |place| Parameter::OfEffect { effect, place })
        };
        let counts = self.effects.iter().map(|effect| effect.values().len()).enumerate();
        Parameter::COMMON.into_iter().chain(counts.flat_map(of_effect)).collect()
    }

    /// The name of a parameter; that of an effect has the name of the effect before it.
    #[must_use]
    pub fn name_of(&self, parameter: Parameter) -> String {
        match parameter {
            Parameter::Gamma => "gamma".to_owned(),
            Parameter::ThetaR => "theta_r".to_owned(),
            Parameter::Torque => "torque".to_owned(),
            Parameter::P => "p".to_owned(),
            Parameter::Omega => "omega".to_owned(),
            Parameter::Phase => "phase".to_owned(),
            Parameter::OfEffect { effect, place } => {
                let definition = self.effects[effect].kind.definition();
                format!("{}.{}", definition.name, definition.parameters.at(place).name)
            }
        }
    }

    /// The parameter of this name, the first of several.
    ///
    /// # Errors
    /// [`Error::NoParameter`] if it has none of that name.
    pub fn parameter(&self, name: &str) -> Result<Parameter, Error> {
        let named = self.parameters().into_iter().find(|one| self.name_of(*one) == name);
        named.ok_or_else(|| Error::NoParameter { name: name.to_owned() })
    }

    /// Whether it has this parameter.
    #[must_use]
    pub fn has(&self, parameter: Parameter) -> bool {
        match parameter {
            Parameter::OfEffect { effect, place } => {
                self.effects.get(effect).is_some_and(|effect| place < effect.values().len())
            }
            _ => true,
        }
    }

    /// The value of a parameter.
    #[must_use]
    pub fn value(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Gamma => self.gamma,
            Parameter::ThetaR => self.theta_r,
            Parameter::Torque => self.torque,
            Parameter::P => self.drive.p,
            Parameter::Omega => self.drive.omega,
            Parameter::Phase => self.drive.phase,
            Parameter::OfEffect { effect, place } => self.effects[effect].parameters[place],
        }
    }

    /// Sets a parameter, without a check: a fit passes through values that no pendulum has.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        let slot = match parameter {
            Parameter::Gamma => &mut self.gamma,
            Parameter::ThetaR => &mut self.theta_r,
            Parameter::Torque => &mut self.torque,
            Parameter::P => &mut self.drive.p,
            Parameter::Omega => &mut self.drive.omega,
            Parameter::Phase => &mut self.drive.phase,
            Parameter::OfEffect { effect, place } => &mut self.effects[effect].parameters[place],
        };
        *slot = value;
    }
}
