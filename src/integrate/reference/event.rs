//! What happens to a trajectory where its velocity is zero.

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// The velocity passed zero.
    Turn,
    /// The velocity became zero, and friction holds.
    Stick,
    /// The load overcame the friction.
    Release,
    /// It never will.
    StuckForEver,
}

impl EventKind {
    /// The words for it.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Turn => "turn",
            Self::Stick => "stick",
            Self::Release => "release",
            Self::StuckForEver => "stuck for ever",
        }
    }
}

/// What happened, when and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// When.
    pub tau: f64,
    /// What.
    pub kind: EventKind,
    /// At which angle, rad, not wrapped.
    pub theta: f64,
}
