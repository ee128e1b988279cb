//! Many trajectories in one register: numbers, sine, instruction sets.
//!
//! - [`real`]: the arithmetic that the model and the integrators are written over
//! - [`pack`]: that arithmetic on vector registers
//! - [`sine`]: sine, cosine, reduction modulo a turn
//! - [`elementary`]: exponential and logarithm
//! - [`isa`], [`dispatch`]: the instruction sets, and the choice among them at run time

pub mod dispatch;
pub mod elementary;
pub mod isa;
pub mod pack;
pub mod real;
pub mod sine;

pub use dispatch::{Job, Path};
pub use isa::Isa;
pub use real::{Lane, Real, Work};

/// No bundle is wider than this.
pub const MAX_WIDTH: usize = 96;
