//! Many trajectories in one register: numbers, sine, instruction sets.
//!
//! - [`real`]: the arithmetic that the model and the integrators are written over
//! - [`pack`]: that arithmetic on vector registers
//! - [`sine`]: sine, cosine, reduction modulo a turn
//! - [`elementary`]: exponential and logarithm
//! - [`isa`], [`dispatch`]: the instruction sets, and the choice among them at run time

/// `$body` for each `$i` below `$n`, at most 16, written out.
///
/// The compiler would unroll a loop all the same. A kernel has thousands of them, and each takes it time
/// in proportion to the length of the whole kernel: with loops the crate takes four times as long to build.
macro_rules! each {
    ($i:ident in $n:ident => $body:expr) => {
        each!($i, $n, $body, 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15)
    };
    ($i:ident, $n:ident, $body:expr, $($k:literal)*) => {
        const { assert!($n <= 16) };
        $(if const { $k < $n } {
            let $i: usize = $k;
            $body;
        })*
    };
}
pub(crate) use each;

pub mod dispatch;
pub mod elementary;
pub mod isa;
pub mod pack;
pub mod real;
pub mod sine;

pub use dispatch::{InstructionSet, Job};
pub use isa::Isa;
pub use real::{Lane, Real, Work};

/// No bundle is wider than this.
pub const MAX_WIDTH: usize = 96;
