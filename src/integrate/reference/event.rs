//! Events of a trajectory where its velocity is zero.

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// The velocity passed zero.
    Turn,
    /// The velocity became zero, and friction holds.
    Stick,
    /// The load overcame the friction.
    Release,
    /// Friction holds for ever.
    StuckForEver,
}

impl EventKind {
    /// The name of the kind.
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

/// An event of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Its time.
    pub tau: f64,
    /// Its kind.
    pub kind: EventKind,
    /// The angle there, rad, not wrapped.
    pub theta: f64,
}
