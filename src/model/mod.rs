//! The equation of motion and what drives it.

pub mod drive;
pub mod pendulum;

pub use drive::HarmonicDrive;
pub use pendulum::Pendulum;
