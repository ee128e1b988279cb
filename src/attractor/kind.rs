//! Kinds of motions.

/// The kind of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Hanging at rest.
    Rest,
    /// Standing on its head.
    InvertedRest,
    /// Periodic without net turns.
    Oscillation,
    /// Periodic with net turns.
    Rotation,
    /// Running on without closing: a closed curve of the stroboscopic map.
    QuasiperiodicRotation,
    /// Chaos that never goes over the top.
    LibrationChaos,
    /// Chaos that goes over the top in one sense only.
    RotatingChaos,
    /// Chaos with turns in both senses.
    TumblingChaos,
}

impl Kind {
    /// The word in files.
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

    /// Whether it is one of the three kinds of chaos.
    #[must_use]
    pub const fn is_chaotic(self) -> bool {
        matches!(self, Self::LibrationChaos | Self::RotatingChaos | Self::TumblingChaos)
    }
}
