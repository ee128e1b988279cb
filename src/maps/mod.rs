//! Pictures of whole planes, on all threads.
//!
//! - [`advance`]: plain integration of many starts
//! - [`starts`]: the grid or list of initial conditions
//! - [`basins`]: basins of attraction
//! - [`label`]: every start to the attractor that captures it
//! - [`layers`]: turns and exponents over a fixed time
//! - [`texture`], [`uncertainty`]: how fine the basins are, with `near`'s cells; [`reliability`]: whether labels can be
//!   believed
//! - [`lyapunov`]: the largest exponent of what a start reaches; [`ensemble`], [`growth`]: of many
//!   trajectories
//! - [`orbits`]: all closed orbits of one period and winding
//! - [`resolution`], [`cell`], [`parameter_map`]: which attractors exist over a plane of two parameters
//! - [`bifurcation`]: along one parameter, all attractors, and one followed up and down
//! - [`orbits`]: all closed orbits of one period and winding: `vanishing` and `approach` find
//!   where Newton's method begins
//! - [`tongues`]: where rest loses and gains stability, with `chebyshev`'s polynomials; `continued`
//!   where a torque makes it an orbit
//! - [`bounds`]: how many periods a trajectory is given to settle
//! - [`control`]: progress, cancellation, threads

pub mod advance;
mod approach;
pub mod basins;
pub mod bifurcation;
pub mod bounds;
pub mod cell;
mod chebyshev;
mod continued;
pub mod control;
pub mod ensemble;
pub mod growth;
pub mod label;
pub mod layers;
pub mod lyapunov;
mod near;
pub mod orbits;
pub mod parameter_map;
pub mod reliability;
pub mod resolution;
pub mod starts;
pub mod texture;
pub mod tongues;
pub mod uncertainty;
mod vanishing;
