//! Fitting a pendulum to records: least squares by multiple shooting on the reference integrator.
//!
//! - [`record`]: a record of one motion
//! - [`problem`]: records, and which parameters of their pendulums are free
//! - [`rod_sensor`]: readings of a gyroscope on the rod
//! - [`window`]: a record divided into windows, each with its own initial state
//! - [`quantised`]: the likelihood of readings rounded to counts
//! - [`linear`]: residuals of a window and their derivatives
//! - [`block`]: the equations of one window
//! - [`normal`]: the equations of all windows, their initial states eliminated
//! - [`step_scale`]: linear and logarithmic steps of parameters
//! - [`levenberg_marquardt`]: the Levenberg-Marquardt method at fixed windows
//! - [`single_window`]: the initial state of one window, parameters held
//! - [`window_growth`]: from short windows to long ones
//! - [`profile`]: intervals from the profile of the likelihood
//! - [`replay`]: the pendulum of a record from many starts at once
//!
//! Multiple shooting: Bock (1983), Progress in Scientific Computing 2, 95; without conditions of
//! continuity between windows, so that each window stands for itself. Time is counted in `1 / w_ref`
//! with a fixed `w_ref` near `w0`; `w0` itself is the parameter [`Slot::Gravity`](problem::Slot).

pub mod block;
pub mod levenberg_marquardt;
pub mod linear;
pub mod normal;
pub mod problem;
pub mod profile;
pub mod quantised;
pub mod record;
pub mod replay;
pub mod rod_sensor;
pub mod single_window;
pub mod step_scale;
pub mod window;
pub mod window_growth;

pub use problem::{Free, Problem, Slot};
pub use record::{Counts, Record};
pub use rod_sensor::RodSensor;
pub use window_growth::{Fit, Settings, fit};
