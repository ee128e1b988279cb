//! Branches of periodic orbits along a parameter: where orbits are born, change and end.
//!
//! - [`course`]: parameters along one coordinate
//! - [`period`]: the stroboscopic map with derivatives by state and parameters; `smooth`: its equal steps
//! - [`phases`]: slips and sticks of a motion
//! - [`cycle`]: closed orbits as zeros, by Newton's method; their multipliers; symmetry
//! - [`branch`]: steps along a branch, and why it ends; `meeting`: on another one
//! - [`event`]: folds, doublings, symmetry breakings; [`shed`]: the branches that begin there
//! - `transition`: where slips and sticks change
//! - [`family`]: branches, and what they shed

pub mod branch;
mod closure;
pub mod course;
pub mod cycle;
pub mod event;
pub mod family;
mod meeting;
pub mod period;
pub mod phases;
pub mod shed;
mod smooth;
mod transition;
