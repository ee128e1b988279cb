//! Layers of a map without basins: turns and stretching over a fixed time.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use rayon::prelude::*;

use super::control::Control;
use super::starts::Starts;
use crate::error::Error;
use crate::integrate::{State, Strobe, TangentStates};

/// Starts per task.
const BLOCK: usize = 4096;

/// Layers after a fixed number of periods, one entry a start.
#[derive(Debug)]
pub struct FiniteTime {
    /// Net turns.
    pub turns: Vec<i32>,
    /// Finite-time Lyapunov exponent per unit of tau; NaN where the trajectory failed.
    pub exponent: Vec<f32>,
}

/// Net turns and finite-time exponents of all starts after `periods` periods.
///
/// The exponent is `ln |D P^N t| / (N T)` for the tangent `t = (1, 1)/sqrt 2`.
///
/// # Errors
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn finite_time(
    strobe: &Strobe,
    starts: &Starts,
    periods: usize,
    pool: &rayon::ThreadPool,
    control: &Control,
) -> Result<FiniteTime, Error> {
    let count = starts.len();
    control.begin(count);
    let mut turns = vec![0_i32; count];
    let mut exponent = vec![0.0_f32; count];
    let time = periods as f64 * strobe.pendulum.period();
    pool.install(|| {
        turns.par_chunks_mut(BLOCK).zip(exponent.par_chunks_mut(BLOCK)).enumerate().try_for_each(
            |(block, (turns, exponent))| {
                let size = turns.len();
                let first: Vec<State> = (0..size).map(|i| starts.get(block * BLOCK + i)).collect();
                let mut all = TangentStates::along(&first, [FRAC_1_SQRT_2; 2]);
                for _ in 0..periods {
                    control.check()?;
                    strobe.stretch(&mut all, 1);
                }
                let ends = all.states();
                for i in 0..size {
                    let net = ends.turns()[i] + (ends.theta()[i] - first[i][0]) / TAU;
                    turns[i] = net.round() as i32;
                    exponent[i] = (all.growth()[i] / time) as f32;
                }
                control.add(size);
                Ok(())
            },
        )
    })?;
    Ok(FiniteTime { turns, exponent })
}
