//! Basin maps, attractors and damping identification of parametrically excited pendulums.
//!
//! The model is eq. 1.2 of Horton, Wiercigroch & Xu, "Transient tumbling chaos and damping
//! identification for parametric pendulum", Phil. Trans. R. Soc. A (2008), with a constant torque,
//! Coulomb friction (their eq. 2.1) and a library of effects:
//! `th'' + gamma th' + (1 + p cos(omega tau + phase)) sin th = torque - theta_r sign(th') + ...`.
//!
//! Modules by question:
//!
//! | question | module |
//! |---|---|
//! | What is the equation of motion? | [`model`] |
//! | Where is a state some time later, how precisely, for how many at once? | [`integrate`] |
//! | Which closed orbits are there, and are they stable? | [`orbit`] |
//! | How do they change along a parameter? | [`continuation`] |
//! | Where do motions end, and how is that recognised? | [`attractor`] |
//! | What does the whole plane of initial conditions do? | [`maps`] |
//! | Which parameters does a record's pendulum have? | [`fit`] |
//! | How do many trajectories share a register? | [`lanes`] |
//! | Is there enough memory? | [`memory`] |
//! | How far is it? | [`progress`] |
//! | What was wrong with my request? | [`error`] |
//!
//! Imports run upwards in that list's reverse: `maps` -> `attractor`, `continuation` -> `orbit` -> `integrate` ->
//! `model` -> `lanes` -> `memory` -> `error`, and `fit` -> `integrate`. Threads live in `maps` and `fit` alone.
//! The Python module `pendmap._core` is another crate, in `src/python`.
//!
//! ```
//! use pendmap::maps::basins::{Options, basins};
//! use pendmap::maps::control::Control;
//! use pendmap::maps::starts::{Axis, Starts};
//! use pendmap::model::Pendulum;
//!
//! # fn main() -> Result<(), pendmap::error::Error> {
//! let pendulum = Pendulum::new(0.1, 0.6, 2.0, 0.0, 0.0)?;
//! let starts = Starts::Grid {
//!     theta: Axis::new("theta", -std::f64::consts::PI, std::f64::consts::PI, 40)?,
//!     velocity: Axis::new("velocity", -3.0, 3.0, 40)?,
//! };
//! let map = basins(&pendulum, &starts, &Options::default(), &Control::default())?;
//! let names: Vec<&str> = map.attractors.iter().map(|a| a.name.as_str()).collect();
//! assert_eq!(names, ["oscillation 2:0", "rotation 1:-1", "rotation 1:+1"]);
//! # Ok(())
//! # }
//! ```

pub mod attractor;
pub mod continuation;
pub mod error;
pub mod fit;
pub mod integrate;
pub mod lanes;
pub mod maps;
pub mod memory;
pub mod model;
pub mod orbit;
pub mod progress;
