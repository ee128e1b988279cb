//! The crate against independent knowledge: exact solutions, symmetries, conserved quantities, and
//! the reference values of `tests/truths.json`.
//!
//! - [`exact`], [`convergence_order`]: solutions in closed form, energy, order of convergence
//! - [`stick_slip`], [`free_decay`], [`edge_cases`]: friction, event by event, and cases sensitive
//!   to rounding
//! - [`recorded`]: recorded pivot motions
//! - [`effects`]: the library, every property of each effect
//! - [`formulas`]: user-defined effects; [`effects_as_formulas`]: the library's as formulas
//! - [`fit`], [`fit_derivatives`], [`fit_ends`], [`fit_quantised`]: parameters from records; [`replay`]: ensembles
//! - [`sine`], [`elementary`], [`lanes`]: the lane arithmetic, alone and against single
//!   trajectories
//! - [`tangent`], [`orbits`], [`orbit_search`], [`bifurcations`]: derivatives, periodic orbits,
//!   their bifurcations
//! - [`traps`], [`attractors`], [`chaos`], [`special_cases`]: attractors
//! - [`maps`], [`continued_plans`], [`finite_time`], [`uncertainty`], [`threads`]: whole planes; [`planes`]: of parameters
//! - [`continuation`]: branches of orbits along a parameter
//! - [`exponents`]: rates of divergence of neighbouring motions, also through friction
//! - [`tongues`]: regions of stability of rest; [`hill`]: their bounds by Hill's determinant
//! - [`properties`]: properties of every pendulum
//! - [`input`]: refused input and its messages

mod attractors;
mod bifurcations;
mod chaos;
mod chaotic_sets;
mod continuation;
mod continued_plans;
mod convergence_order;
mod corners;
mod curves;
mod curves_friction;
mod edge_cases;
mod effects;
mod effects_as_formulas;
mod effects_in_lanes;
mod elementary;
mod exact;
mod exponents;
mod finite_time;
mod fit;
mod fit_derivatives;
mod fit_ends;
mod fit_quantised;
mod fit_records;
mod fit_step_scale;
mod formulas;
mod free_decay;
mod friction;
mod hill;
mod input;
mod kinks;
mod lanes;
mod maps;
mod orbit_search;
mod orbits;
mod parameter_maps;
mod properties;
mod recorded;
mod replay;
mod sine;
mod special_cases;
mod stick_slip;
mod support;
mod tangent;
mod threads;
mod tongues;
mod traps;
mod truths;
mod uncertainty;
