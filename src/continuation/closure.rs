//! The types of orbits.

/// How an orbit closes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Closure {
    /// After its period.
    Whole,
    /// After half of it at its mirror image.
    Half,
    /// At its own mirror image always: rest.
    Rest,
}

/// The type of the orbits of a branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Type {
    /// Smallest period, in forcing periods.
    pub n: usize,
    /// Net turns over it.
    pub w: i64,
    /// How they close.
    pub closure: Closure,
    /// The angle about which symmetric ones lie: a multiple of pi.
    pub centre: f64,
}
