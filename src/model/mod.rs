//! The equation of motion, its drive and its effects.

pub mod angle;
pub mod drive;
pub mod effects;
pub mod equation;
pub mod formula;
pub mod observation;
pub mod parameter;
pub mod pendulum;
pub mod recorded;
pub mod rest;
pub(crate) mod spline;

pub use angle::Angle;
pub use drive::HarmonicDrive;
pub use effects::{Effect, Kind};
pub use equation::Equation;
pub use formula::Formula;
pub use observation::Observation;
pub use parameter::Parameter;
pub use pendulum::Pendulum;
pub use recorded::Recorded;
