//! Results over whole planes, on all threads.
//!
//! - [`starts`]: the grid or list of initial conditions
//! - [`basins`]: basins of attraction; [`basin_plan`]: what their starts share; [`label`]: the attractor that captures each start
//! - [`finite_time`]: turns and exponents over a fixed time
//! - [`basin_entropy`], [`uncertainty`]: fractality of basins, with distances from [`boundary_distance`]
//! - [`reliability`]: the part of labels that half the step or mirroring changes
//! - [`lyapunov`]: the largest exponent of the attractor that a start reaches; [`ensemble`], [`tangent_growth`]:
//!   exponents of many trajectories
//! - [`orbits`]: all periodic orbits of one period and winding; `multistart`: starting points of
//!   Newton's method; `every_orbit`: those of all periods and windings
//! - [`branches`]: all branches of orbits of one type along a parameter; [`curves`]: the bifurcation set of a plane;
//!   [`pieces`]: where orbits are stable there
//! - [`parameter_map`]: the attractors over a plane of two parameters; [`survey`]: its blocks; [`cell`],
//!   [`resolution`]: one pendulum of it, and its step length
//! - [`bifurcation`]: the attractors along one parameter, and one followed up and down
//! - [`tongues`]: critical amplitudes of the stability of rest
//! - [`advance`]: plain integration of many starts
//! - [`bounds`]: the number of periods within which a trajectory must settle
//! - `stored`: plans and blocks as bytes
//! - [`matching`]: which attractors of neighbours are one
//! - [`control`]: progress, cancellation, threads

pub mod advance;
pub mod basin_entropy;
pub mod basin_plan;
pub mod basins;
pub mod bifurcation;
pub mod boundary_distance;
pub mod bounds;
pub mod branches;
pub mod cell;
pub mod control;
pub mod curves;
pub mod ensemble;
mod every_orbit;
pub mod finite_time;
mod kinked_tongues;
pub mod label;
pub mod lyapunov;
pub mod matching;
mod multistart;
pub mod orbits;
pub mod parameter_map;
pub mod pieces;
pub mod reliability;
pub mod resolution;
pub mod starts;
mod stored;
pub mod survey;
pub mod tangent_growth;
pub mod tongues;
pub mod uncertainty;
