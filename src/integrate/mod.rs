//! From a state to a later one.
//!
//! - [`tableau`], [`dop853`]: coefficients and their source
//! - [`schedule`]: what all trajectories of a run of equal steps share, damping folded in
//! - [`step`]: one step, for any number type
//! - [`tangent`]: numbers with derivatives, for the variational equations
//! - [`general`]: one step where torques depend on the velocity
//! - [`block`]: a block of trajectories, one forcing period; [`event`]: turns, sticks, releases
//! - [`stroboscopic`]: many trajectories, one forcing period at a time
//! - [`accuracy`]: how many steps a tolerance asks for
//! - [`trajectory`]: one trajectory, sampled in time

pub mod accuracy;
pub mod block;
pub mod dop853;
pub mod event;
pub mod general;
pub mod schedule;
pub mod step;
pub mod stroboscopic;
pub mod tableau;
pub mod tangent;
pub mod trajectory;

pub use schedule::Schedule;
pub use step::Moving;
pub use stroboscopic::{State, Strobe};
