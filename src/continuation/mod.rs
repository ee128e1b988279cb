//! Branches of periodic orbits along a parameter: where orbits are born, change and end.
//!
//! - [`course`]: parameters along one coordinate
//! - [`period`]: the stroboscopic map with derivatives by state and parameters; `smooth`: its equal steps
//! - [`phases`]: slips and sticks of a motion
//! - [`cycle`]: closed orbits as zeros, by Newton's method; their multipliers; symmetry
//! - [`branch`]: steps along a branch, and why it ends; `meeting`: on another one
//! - [`event`]: folds, doublings, symmetry breakings; [`shed`]: the branches that begin there
//! - `neimark_sacker`: the invariant curves that begin where a complex pair passes the unit circle
//! - `transition`: where slips and sticks change
//! - [`family`]: branches, and what they shed; [`regions`]: where the same orbits are stable

pub mod branch;
mod closure;
pub mod course;
pub mod cycle;
pub mod event;
pub mod family;
mod meeting;
mod neimark_sacker;
pub mod period;
pub mod phases;
pub mod regions;
pub mod shed;
mod smooth;
mod transition;
