//! Branches of periodic orbits along a parameter: where orbits are born, change and end.
//!
//! - [`course`]: parameters along one coordinate
//! - [`period`]: the stroboscopic map with derivatives by state and parameters; `smooth`: its equal steps
//! - [`phases`]: slips and sticks of a motion
//! - [`cycle`]: closed orbits as zeros, by Newton's method; their multipliers; symmetry
//! - [`branch`]: steps along a branch, and why it ends; `meeting`: on another one
//! - [`event`]: folds, doublings, symmetry breakings; [`shed`]: the branches that begin there
//! - `neimark_sacker`: the invariant curves that begin where a complex pair passes the unit circle
//! - `swing`: amplitudes
//! - `transition`: where slips and sticks change; [`edge`]: numbers that vanish there
//! - [`family`]: branches, and what they shed; [`regions`]: where the same orbits are stable
//! - [`critical`]: orbits in the plane of two coordinates at which something happens; `normal_form`: which side the
//!   new orbits live on; [`curve`]: curves of them; [`plane`]: all curves

pub mod branch;
mod closure;
pub mod course;
pub mod critical;
pub mod curve;
pub mod cycle;
pub mod edge;
pub mod event;
pub mod family;
mod meeting;
mod neimark_sacker;
mod normal_form;
pub mod period;
pub mod phases;
pub mod plane;
pub mod regions;
pub mod shed;
mod smooth;
mod swing;
mod transition;
