//! Integrators of the equation of motion.
//!
//! - [`kernel`]: many trajectories in lanes, by steps of equal length
//! - [`mod@reference`]: one trajectory of any model, adaptive, with exact events and derivatives
//! - [`tangent`]: numbers with derivatives, for the variational equations
//! - [`dop853`]: coefficients of the Runge-Kutta method that both use, and their source
//! - [`accuracy`]: the number of steps that a tolerance requires
//! - [`states`]: states of many trajectories, in columns
//! - [`trajectory`]: one trajectory, sampled in time

pub mod accuracy;
pub mod dop853;
pub mod kernel;
pub mod reference;
pub mod states;
pub mod tangent;
pub mod trajectory;

pub use kernel::schedule::Schedule;
pub use kernel::step::Moving;
pub use kernel::stroboscopic::Strobe;
pub use states::{State, States, TangentStates};
