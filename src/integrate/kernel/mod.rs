//! Many trajectories in lanes, by steps of equal length.
//!
//! - [`stroboscopic`]: the stroboscopic map of many trajectories, one forcing period at a time
//! - [`schedule`]: the tables shared by all trajectories of a run, with damping folded in
//! - [`tableau`]: coefficients of the Runge-Kutta-Nystrom method and their source
//! - [`step`]: one step of that method, for any number type
//! - [`general`]: one step of DOP853, where torques depend on the velocity
//! - [`block`]: a block of trajectories over one forcing period; `runner`: its steps
//! - [`event`]: turns, sticks and releases within a step
//! - [`corner`]: corners of an effect's formula other than the zeros of the velocity
//! - [`stretching`]: tangent vectors of the states

pub mod block;
pub mod corner;
pub mod event;
pub mod general;
mod runner;
pub mod schedule;
pub mod step;
pub mod stretching;
pub mod stroboscopic;
pub mod tableau;
