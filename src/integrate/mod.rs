//! From a state to a later one.
//!
//! - [`tableau`], [`dop853`]: coefficients and their source
//! - [`schedule`]: what all trajectories of a run of equal steps share, damping folded in
//! - [`step`]: one step, for any number type
//! - [`tangent`]: numbers with derivatives, for the variational equations
//! - [`general`]: one step where torques depend on the velocity
//! - [`block`], [`ticket`]: a block of trajectories, one forcing period; turns, sticks, releases in it
//! - [`corner`]: where an effect's formula changes besides the velocity's zeros
//! - [`course`], [`dense`], [`turning`], [`event`], [`flight`]: one trajectory of any
//!   model, adaptive, with exact turns, sticks and releases
//! - [`sway`]: a mode of the rig beside it
//! - [`sample`], [`sensitivity`]: the same at chosen times, with derivatives by parameters and start
//! - [`flow`]: the stroboscopic map by it, with its derivative
//! - [`stroboscopic`]: many trajectories, one forcing period at a time
//! - [`stretch`]: tangents beside them
//! - [`accuracy`]: how many steps a tolerance asks for
//! - [`trajectory`]: one trajectory, sampled in time

pub mod accuracy;
pub mod block;
pub mod corner;
pub mod course;
pub mod dense;
pub mod dop853;
pub mod event;
pub mod flight;
pub mod flow;
pub mod general;
mod runner;
pub mod sample;
pub mod schedule;
pub mod sensitivity;
pub mod step;
pub mod stretch;
pub mod stroboscopic;
pub mod sway;
pub mod tableau;
pub mod tangent;
pub mod ticket;
pub mod trajectory;
pub mod turning;

pub use schedule::Schedule;
pub use step::Moving;
pub use stroboscopic::{State, Strobe};
