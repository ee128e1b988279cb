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

impl Type {
    /// Whether period, turns and closure are the same, and of rest its side.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        let side = self.closure != Closure::Rest || (self.centre - other.centre).cos() > 0.0;
        side && (self.n, self.w, self.closure) == (other.n, other.w, other.closure)
    }
}
