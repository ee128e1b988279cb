//! Attractors: search, names, recognition.
//!
//! - [`find`]: the search, from starts to a catalogue; [`effort`]: its budget
//! - [`kind`], [`catalogue`]: kinds, names and twins of attractors
//! - [`trap`]: regions that no trajectory leaves; [`capture`]: trajectories run until a trap holds them, by
//!   the tests of `capture_test`
//! - `gauge`: what shrinks within a trap
//! - [`rest`]: equilibria, and sets of equilibria under friction
//! - `uncaptured`: whether uncaptured trajectories are chaotic or unsettled; `membership`: the attractor of each
//! - [`chaos`]: chaotic attractors, from long runs divided into windows ([`long_runs`]), which `groups` sorts; [`region`]:
//!   the part of the plane that one visits
//! - [`attracting`]: attracting orbits from those of similar pendulums; `near_returns`, `short_cycles`: candidates for periodic orbits

pub mod attracting;
pub mod capture;
mod capture_test;
pub mod catalogue;
pub mod chaos;
pub mod effort;
pub mod find;
mod gauge;
mod groups;
pub mod kind;
pub mod long_runs;
mod membership;
mod near_returns;
pub mod region;
pub mod rest;
mod short_cycles;
pub mod trap;
mod uncaptured;

pub use catalogue::Attractor;
pub use effort::Effort;
pub use find::{Catalogue, Ending};
pub use kind::Kind;
