//! Kinds of motions.

use serde::{Deserialize, Serialize};

/// The kind of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Kind {
    /// Hanging at rest.
    Rest,
    /// Inverted rest.
    InvertedRest,
    /// Periodic without net turns.
    Oscillation,
    /// Periodic with net turns.
    Rotation,
    /// Quasi-periodic: a closed curve of the stroboscopic map.
    QuasiperiodicRotation,
    /// Chaos that never passes the top.
    LibrationChaos,
    /// Chaos that passes the top in one sense only.
    RotatingChaos,
    /// Chaos with turns in both senses.
    TumblingChaos,
}

impl Kind {
    /// All kinds, in the order of attractors.
    pub const ALL: [Self; 8] = [
        Self::Rest,
        Self::InvertedRest,
        Self::Oscillation,
        Self::Rotation,
        Self::QuasiperiodicRotation,
        Self::LibrationChaos,
        Self::RotatingChaos,
        Self::TumblingChaos,
    ];

    /// The name in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::InvertedRest => "inverted_rest",
            Self::Oscillation => "oscillation",
            Self::Rotation => "rotation",
            Self::QuasiperiodicRotation => "quasiperiodic_rotation",
            Self::LibrationChaos => "libration_chaos",
            Self::RotatingChaos => "rotating_chaos",
            Self::TumblingChaos => "tumbling_chaos",
        }
    }

    /// Whether it is one of the two of rest.
    #[must_use]
    pub const fn is_rest(self) -> bool {
        matches!(self, Self::Rest | Self::InvertedRest)
    }

    /// Whether it is one of the three kinds of chaos.
    #[must_use]
    pub const fn is_chaotic(self) -> bool {
        matches!(self, Self::LibrationChaos | Self::RotatingChaos | Self::TumblingChaos)
    }
}
