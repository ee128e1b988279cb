//! Attractors: how they are found, told apart, named and recognised.
//!
//! - [`find`]: the search, from starts to a catalogue
//! - [`catalogue`]: kinds, keys, names, twins
//! - [`trap`]: regions that nothing leaves
//! - [`capture`]: trajectories run until a trap holds them
//! - [`chaos`]: what never closes

pub mod capture;
pub mod catalogue;
pub mod chaos;
pub mod find;
pub mod trap;

pub use catalogue::{Attractor, Kind};
pub use find::Catalogue;
