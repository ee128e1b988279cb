//! The library of effects: one file each, and the list of them.
//!
//! [`law`] defines an effect. A new one is one file with a [`Law`] and one line in the list below;
//! Python, the command line, model files, maps and fits read it from here. A user's own effect
//! needs neither: it is a [`Formula`].

pub mod law;
pub mod parameter;

pub use law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters,
    Point, Power, Role,
};

use std::sync::Arc;

use super::drive::Motion;
use super::formula::Formula;
use crate::error::Error;
use crate::lanes::Real;

macro_rules! library {
    ($($module:ident :: $law:ident,)*) => {
        $(mod $module;)*

        /// An effect of the library, or a formula of a user.
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub enum Kind {
            $(
                #[doc = concat!("`", stringify!($module), "`")]
                $law,
            )*
            /// A formula.
            Formula(Arc<Formula>),
        }

        impl Kind {
            /// The whole library, in display order.
            pub const ALL: &[Self] = &[$(Self::$law,)*];

            /// Name, formula, parameters and the rest.
            #[must_use]
            pub fn definition(&self) -> Definition<'_> {
                match self {
                    $(Self::$law => <$module::$law as Law>::DEFINITION,)*
                    Self::Formula(formula) => formula.definition(),
                }
            }

            /// [`Law::ready`].
            #[must_use]
            pub fn ready<R: Real>(&self, parameters: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
                match self {
                    $(Self::$law => $module::$law::ready(parameters),)*
                    Self::Formula(_) => parameters,
                }
            }

            /// [`Law::torque`]; of a formula all of it, friction too, in the sense of `at`.
            #[inline(always)]
            pub fn torque<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
                match self {
                    $(Self::$law => $module::$law::torque(parameters, at),)*
                    Self::Formula(formula) => formula.whole(parameters, at),
                }
            }

            /// [`Law::friction`]; none of a formula, which is in its torque.
            #[inline(always)]
            pub fn friction<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
                match self {
                    $(Self::$law => $module::$law::friction(parameters, at),)*
                    Self::Formula(_) => at.constant(0.0),
                }
            }

            /// [`Law::switch`].
            #[inline(always)]
            pub fn switch<R: Real>(
                &self,
                parameters: &[R; MOST_PARAMETERS],
                at: &Point<R>,
            ) -> Option<R> {
                match self {
                    $(Self::$law => $module::$law::switch(parameters, at),)*
                    Self::Formula(formula) => formula.switch(parameters, at),
                }
            }

            /// [`Law::kept`].
            #[inline(always)]
            pub fn kept<R: Real>(
                &self,
                parameters: &[R; MOST_PARAMETERS],
                at: &Point<R>,
            ) -> Option<R> {
                match self {
                    $(Self::$law => $module::$law::kept(parameters, at),)*
                    Self::Formula(_) => None,
                }
            }

            /// [`Law::inertia`].
            #[inline(always)]
            pub fn inertia<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
                match self {
                    $(Self::$law => $module::$law::inertia(parameters, at),)*
                    Self::Formula(_) => at.constant(0.0),
                }
            }

            /// [`Law::sway`].
            #[inline(always)]
            pub fn sway<R: Real>(
                &self,
                parameters: &[R; MOST_PARAMETERS],
                at: &Point<R>,
            ) -> Option<[R; 2]> {
                match self {
                    $(Self::$law => $module::$law::sway(parameters, at),)*
                    Self::Formula(_) => None,
                }
            }

            /// [`Law::aside`].
            pub fn aside<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
                match self {
                    $(Self::$law => $module::$law::aside(parameters, at),)*
                    Self::Formula(_) => at.constant(0.0),
                }
            }

            /// [`Law::drive`].
            pub fn drive<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
                match self {
                    $(Self::$law => $module::$law::drive(parameters, motion),)*
                    Self::Formula(_) => {}
                }
            }

            /// [`Law::reading`].
            pub fn reading<R: Real>(
                &self,
                parameters: &[R; MOST_PARAMETERS],
                theta: R,
                velocity: R,
                lab: R,
            ) -> R {
                match self {
                    $(Self::$law => $module::$law::reading(parameters, theta, velocity, lab),)*
                    Self::Formula(_) => theta,
                }
            }

            /// [`Law::SCALES`].
            #[must_use]
            pub const fn scales(&self) -> bool {
                match self {
                    $(Self::$law => <$module::$law as Law>::SCALES,)*
                    Self::Formula(_) => false,
                }
            }

            /// [`Law::keeps_mirror`].
            #[must_use]
            pub fn keeps_mirror(&self, parameters: &[f64; MOST_PARAMETERS]) -> bool {
                match self {
                    $(Self::$law => $module::$law::keeps_mirror(parameters),)*
                    Self::Formula(formula) => formula.keeps_mirror(parameters),
                }
            }

            /// [`Law::counts_turns`].
            #[must_use]
            pub fn counts_turns(&self, parameters: &[f64; MOST_PARAMETERS]) -> bool {
                match self {
                    $(Self::$law => $module::$law::counts_turns(parameters),)*
                    Self::Formula(formula) => formula.counts_turns(parameters),
                }
            }

            /// [`Law::bars_maps`].
            #[must_use]
            pub fn bars_maps(&self, parameters: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
                match self {
                    $(Self::$law => $module::$law::bars_maps(parameters),)*
                    Self::Formula(formula) => formula.bars_maps(parameters),
                }
            }
        }
    };
}

library! {
    viscous_damping::ViscousDamping,
    coulomb_friction::CoulombFriction,
    quadratic_drag::QuadraticDrag,
    cubic_damping::CubicDamping,
    power_law_drag::PowerLawDrag,
    eddy_brake::EddyBrake,
    stribeck_friction::StribeckFriction,
    dahl_friction::DahlFriction,
    load_dependent_friction::LoadDependentFriction,
    asymmetric_viscous::AsymmetricViscous,
    asymmetric_coulomb::AsymmetricCoulomb,
    rough_spot::RoughSpot,
    coulomb_drift::CoulombDrift,
    viscous_drift::ViscousDrift,
    coulomb_warm_up::CoulombWarmUp,
    viscous_warm_up::ViscousWarmUp,
    bias_torque::BiasTorque,
    bearing_harmonic::BearingHarmonic,
    magnet::Magnet,
    elastic_restoring::ElasticRestoring,
    natural_frequency_drift::NaturalFrequencyDrift,
    inertia_ripple::InertiaRipple,
    pivot_compliance::PivotCompliance,
    added_mass::AddedMass,
    rig_tilt::RigTilt,
    drive_amplitude::DriveAmplitude,
    drive_phase::DrivePhase,
    drive_frequency::DriveFrequency,
    drive_chirp::DriveChirp,
    drive_second_harmonic::DriveSecondHarmonic,
    lateral_drive::LateralDrive,
    base_sway::BaseSway,
    impulses::Impulses,
    encoder_offset::EncoderOffset,
    encoder_drift::EncoderDrift,
    encoder_backlash::EncoderBacklash,
    encoder_gain::EncoderGain,
    encoder_eccentricity::EncoderEccentricity,
    sensor_lag::SensorLag,
    timebase::Timebase,
}

impl Kind {
    /// The effect of that name.
    ///
    /// # Errors
    /// [`Error::Effect`] if the library has none.
    pub fn named(name: &str) -> Result<Self, Error> {
        Self::ALL
            .iter()
            .find(|kind| kind.definition().name == name)
            .cloned()
            .ok_or_else(|| Error::Effect { name: name.to_owned() })
    }
}

impl Kind {
    /// This kind; of a formula, the version that steps over its corner.
    #[must_use]
    pub fn loosened(&self) -> Self {
        match self {
            Self::Formula(formula) => Self::Formula(Formula::loosened(formula)),
            other => other.clone(),
        }
    }
}

/// An effect with values for its parameters, without dimensions.
#[derive(Clone, Debug, PartialEq)]
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
    /// [`Error::Values`] for the wrong number of them, [`Error::Range`] for the first one outside
    /// its range.
    pub fn new(kind: Kind, values: &[f64]) -> Result<Self, Error> {
        let definition = kind.definition();
        let wanted = definition.parameters;
        if values.len() != wanted.count() {
            let given = [wanted.count(), values.len()];
            return Err(Error::Values { effect: definition.name.to_owned(), given });
        }
        let mut parameters = [0.0; MOST_PARAMETERS];
        for ((slot, value), parameter) in parameters.iter_mut().zip(values).zip(wanted.iter()) {
            let [low, high] = parameter.range;
            if !(low..=high).contains(value) || !value.is_finite() {
                return Err(Error::Parameter {
                    effect: definition.name.to_owned(),
                    parameter: parameter.name.to_owned(),
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
        &self.parameters[..self.kind.definition().parameters.count()]
    }

    /// Its parameters as its formulas take them, in numbers of another kind, as effect number `effect` of a
    /// pendulum: `number` makes a number of a parameter and its value.
    pub fn lift<R: Real>(
        &self,
        effect: usize,
        mut number: impl FnMut(crate::model::Parameter, f64) -> R,
    ) -> [R; MOST_PARAMETERS] {
        let of = |place| crate::model::Parameter::OfEffect { effect, place };
        let values = self.values().iter().enumerate();
        let values: Vec<R> = values.map(|(place, value)| number(of(place), *value)).collect();
        let none = values[0].like(0.0);
        self.kind.ready(std::array::from_fn(|i| values.get(i).map_or(none, |value| *value)))
    }

    /// Whether it acts in one of these ways.
    #[must_use]
    pub fn is(&self, actions: &[Action]) -> bool {
        actions.contains(&self.kind.definition().action)
    }

    /// Whether it is a friction that can hold the pendulum.
    #[must_use]
    pub fn rubs(&self) -> bool {
        self.is(&[Action::Friction, Action::SlidingFriction, Action::LoadedFriction])
    }

    /// Whether steps end at a corner of it.
    #[must_use]
    pub fn has_corner(&self) -> bool {
        self.kind.switch(&self.parameters, &Point::nowhere(0.0)).is_some()
    }

    /// Whether it is the same for the mirrored motion, at the same phase of the drive.
    #[must_use]
    pub fn is_mirror_symmetric(&self) -> bool {
        self.kind.keeps_mirror(&self.parameters)
    }

    /// Whether it is the same for the mirrored motion half a period of the drive later, the pivot at rest.
    #[must_use]
    pub fn is_mirror_symmetric_later(&self) -> bool {
        match &self.kind {
            Kind::Formula(formula) => formula.keeps_mirror_later(&self.parameters),
            kind => kind.keeps_mirror(&self.parameters),
        }
    }
}
