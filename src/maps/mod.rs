//! Pictures of whole planes, on all threads.
//!
//! - [`advance`]: plain integration of many starts
//! - [`starts`]: the grid or list of initial conditions
//! - [`basins`]: basins of attraction
//! - [`label`]: every start to the attractor that captures it
//! - [`layers`]: turns and exponents over a fixed time
//! - [`texture`], [`reliability`]: how fine the basins are, and whether labels can be believed
//! - [`lyapunov`]: the largest exponent of what a start reaches; [`ensemble`], [`growth`]: of many
//!   trajectories
//! - [`orbits`]: all closed orbits of one period and winding
//! - [`control`]: progress, cancellation, threads

pub mod advance;
pub mod basins;
pub mod control;
pub mod ensemble;
pub mod growth;
pub mod label;
pub mod layers;
pub mod lyapunov;
pub mod orbits;
pub mod reliability;
pub mod starts;
pub mod texture;
