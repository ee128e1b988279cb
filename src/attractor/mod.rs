//! Attractors: how they are found, told apart, named and recognised.
//!
//! - [`find`]: the search, from starts to a catalogue; what it leaves is watched, and told where it belongs
//! - [`effort`]: how much that spends
//! - [`kind`]: what a motion looks like
//! - [`catalogue`]: keys, names, twins
//! - [`trap`]: regions that nothing leaves
//! - [`capture`]: trajectories run until a trap holds them
//! - [`chaos`]: what never closes, from long runs cut into windows ([`walk`]), and where it lives ([`region`])

pub mod capture;
pub mod catalogue;
pub mod chaos;
pub mod effort;
pub mod find;
mod groups;
pub mod kind;
mod place;
pub mod region;
pub mod rest;
mod returns;
mod short_cycles;
pub mod trap;
pub mod walk;
mod watch;

pub use catalogue::Attractor;
pub use effort::Effort;
pub use find::{Catalogue, Ending};
pub use kind::Kind;
