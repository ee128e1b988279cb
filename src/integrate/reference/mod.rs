//! One trajectory of any model: adaptive steps, exact turns, sticks and releases.
//!
//! - [`problem`]: the equation of motion over some number type, and the tolerance
//! - [`dense`]: one step of DOP853, its error and its interpolant
//! - [`driver`]: the loop over steps and events
//! - [`turning`]: zeros of the velocity within a step
//! - [`corner`]: corners within a step, where the formula of an effect changes
//! - [`event`]: the reported turns, sticks and releases of a trajectory
//! - [`rig_mode`]: a mode of the rig coupled to the pendulum
//! - [`sample`]: a trajectory at given times
//! - [`flow`]: the stroboscopic map with its derivative

pub mod corner;
pub mod dense;
pub mod driver;
pub mod event;
pub mod flow;
pub mod problem;
pub mod rig_mode;
pub mod sample;
pub mod turning;
