//! Periodic orbits: the precise stroboscopic map, Newton's method, Floquet multipliers.

pub mod brackets;
pub mod floquet;
pub mod kink;
pub mod newton;
pub mod poincare;
pub mod rotation;
mod sectors;
pub mod symmetry;

pub use floquet::Multipliers;
pub use kink::KinkedRest;
pub use newton::PeriodicOrbit;
pub use poincare::PoincareMap;
