//! The sequence of phases of a motion under dry friction.

/// A phase: the sense of the motion, or rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Slips backward.
    Backward,
    /// Friction holds it.
    Stick,
    /// Slips forward.
    Forward,
}

impl Phase {
    /// Motion in this sense, 1 or -1.
    #[must_use]
    pub fn moving(sense: f64) -> Self {
        if sense > 0.0 { Self::Forward } else { Self::Backward }
    }

    /// The phase of the mirrored motion.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::Backward => Self::Forward,
            Self::Stick => Self::Stick,
            Self::Forward => Self::Backward,
        }
    }

    /// A sign for it.
    #[must_use]
    pub fn sign(self) -> char {
        match self {
            Self::Backward => '-',
            Self::Stick => '0',
            Self::Forward => '+',
        }
    }
}

/// The phases of a closed orbit in turn, each different from the next, from the place on at which they come first in
/// the order of phases: the moment of the section plays no part.
#[must_use]
pub fn round(pieces: impl IntoIterator<Item = Phase>) -> Vec<Phase> {
    let mut all: Vec<Phase> = pieces.into_iter().collect();
    all.dedup();
    if all.len() > 1 && all.first() == all.last() {
        all.pop();
    }
    let from = |k: usize| all[k..].iter().chain(&all[..k]).copied().collect::<Vec<Phase>>();
    (0..all.len()).map(from).min().unwrap_or_default()
}
