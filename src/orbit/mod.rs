//! Periodic orbits: the precise stroboscopic map, Newton's method, Floquet multipliers.

pub mod floquet;
pub mod fold;
pub mod newton;
pub mod poincare;
pub mod rotation;
pub mod symmetry;

pub use floquet::Multipliers;
pub use newton::PeriodicOrbit;
pub use poincare::PoincareMap;
