//! Families of effects: what two effects have in common that are mistaken for each other first.

use super::Kind;

/// What kind of thing an effect is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Drag: it goes with the velocity.
    Damping,
    /// Friction that jumps with the sign of the velocity.
    DryFriction,
    /// A torque, or an inertia, of the angle.
    PositionTorque,
    /// What moves the pivot.
    Drive,
    /// Sensor and clock.
    Reading,
    /// A formula of the user's own, which may be any of these.
    Own,
}

impl Family {
    /// The words for it.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Damping => "damping",
            Self::DryFriction => "dry friction",
            Self::PositionTorque => "position torque",
            Self::Drive => "drive",
            Self::Reading => "reading",
            Self::Own => "own",
        }
    }
}

impl Kind {
    /// The family that the effect belongs to: the one table of it.
    #[must_use]
    pub const fn family(self) -> Family {
        match self {
            Self::ViscousDamping
            | Self::QuadraticDrag
            | Self::CubicDamping
            | Self::PowerLawDrag
            | Self::EddyBrake
            | Self::AsymmetricViscous
            | Self::ViscousDrift
            | Self::ViscousWarmUp => Family::Damping,
            Self::CoulombFriction
            | Self::StribeckFriction
            | Self::DahlFriction
            | Self::LoadDependentFriction
            | Self::AsymmetricCoulomb
            | Self::CoulombDrift
            | Self::CoulombWarmUp
            | Self::RoughSpot => Family::DryFriction,
            Self::BiasTorque
            | Self::BearingHarmonic
            | Self::Magnet
            | Self::ElasticRestoring
            | Self::NaturalFrequencyDrift
            | Self::InertiaRipple
            | Self::PivotCompliance
            | Self::RigTilt => Family::PositionTorque,
            Self::AddedMass
            | Self::DriveAmplitude
            | Self::DrivePhase
            | Self::DriveFrequency
            | Self::DriveChirp
            | Self::DriveSecondHarmonic
            | Self::LateralDrive
            | Self::BaseSway
            | Self::Impulses => Family::Drive,
            Self::EncoderOffset
            | Self::EncoderDrift
            | Self::EncoderBacklash
            | Self::EncoderGain
            | Self::EncoderEccentricity
            | Self::SensorLag
            | Self::Timebase => Family::Reading,
            Self::Formula(_) => Family::Own,
        }
    }
}
