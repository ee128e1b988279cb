//! The library of effects: one file each, and the list of them.
//!
//! [`law`] says what an effect is. A new one is one file with a [`Law`] and one line in the list
//! below; Python, the command line, model files, maps and fits read it from here.

pub mod law;

pub use law::{Action, Definition, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Point, Power};

use super::drive::Motion;
use crate::error::Error;
use crate::lanes::Real;

macro_rules! library {
    ($($module:ident :: $law:ident,)*) => {
        $(mod $module;)*

        /// An effect of the library.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Kind {
            $(
                #[doc = concat!("`", stringify!($module), "`")]
                $law,
            )*
        }

        impl Kind {
            /// The whole library, in the order in which it is shown.
            pub const ALL: &[Self] = &[$(Self::$law,)*];

            /// Name, formula, parameters and the rest.
            #[must_use]
            pub const fn definition(self) -> &'static Definition {
                match self {
                    $(Self::$law => &<$module::$law as Law>::DEFINITION,)*
                }
            }

            /// [`Law::torque`].
            #[inline(always)]
            pub fn torque<R: Real>(self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
                match self {
                    $(Self::$law => $module::$law::torque(parameters, at),)*
                }
            }

            /// [`Law::friction`].
            #[inline(always)]
            pub fn friction<R: Real>(self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
                match self {
                    $(Self::$law => $module::$law::friction(parameters, at),)*
                }
            }

            /// [`Law::drive`].
            pub fn drive<R: Real>(self, parameters: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
                match self {
                    $(Self::$law => $module::$law::drive(parameters, motion),)*
                }
            }

            /// [`Law::reading`].
            pub fn reading<R: Real>(self, parameters: &[R; MOST_PARAMETERS], theta: R) -> R {
                match self {
                    $(Self::$law => $module::$law::reading(parameters, theta),)*
                }
            }
        }
    };
}

library! {
    viscous_damping::ViscousDamping,
    coulomb_friction::CoulombFriction,
    quadratic_drag::QuadraticDrag,
    bias_torque::BiasTorque,
    bearing_harmonic::BearingHarmonic,
}

impl Kind {
    /// The effect of that name.
    ///
    /// # Errors
    /// [`Error::Effect`] if the library has none.
    pub fn named(name: &str) -> Result<Self, Error> {
        Self::ALL
            .iter()
            .copied()
            .find(|kind| kind.definition().name == name)
            .ok_or_else(|| Error::Effect { name: name.to_owned() })
    }
}

/// An effect with values for its parameters, without dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// Which one.
    pub kind: Kind,
    /// Its parameters, in the definition's order; the rest is 0.
    pub parameters: [f64; MOST_PARAMETERS],
}

impl Effect {
    /// Checks number and ranges of the parameters.
    ///
    /// # Errors
    /// [`Error::Lengths`] for the wrong number of them, [`Error::Range`] for the first one outside
    /// its range.
    pub fn new(kind: Kind, values: &[f64]) -> Result<Self, Error> {
        let wanted = kind.definition().parameters;
        if values.len() != wanted.len() {
            let given = (wanted.len(), values.len());
            return Err(Error::Lengths { given, names: (kind.definition().name, "the call") });
        }
        let mut parameters = [0.0; MOST_PARAMETERS];
        for ((slot, value), parameter) in parameters.iter_mut().zip(values).zip(wanted) {
            let [low, high] = parameter.range;
            if !(low..=high).contains(value) || !value.is_finite() {
                return Err(Error::Parameter {
                    effect: kind.definition().name,
                    parameter: parameter.name,
                    value: *value,
                    allowed: parameter.range,
                });
            }
            *slot = *value;
        }
        Ok(Self { kind, parameters })
    }

    /// The values of its parameters.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.parameters[..self.kind.definition().parameters.len()]
    }

    /// Whether it acts in one of these ways.
    #[must_use]
    pub fn is(&self, actions: &[Action]) -> bool {
        actions.contains(&self.kind.definition().action)
    }

    /// Whether it is a friction that can hold the pendulum fast.
    #[must_use]
    pub fn rubs(&self) -> bool {
        self.is(&[Action::Friction, Action::SlidingFriction])
    }

    /// Whether it is the same for the mirrored motion, at the same phase of the drive.
    #[must_use]
    pub fn is_mirror_symmetric(&self) -> bool {
        self.kind.definition().keeps_mirror
    }
}
