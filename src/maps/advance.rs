//! Plain integration of many starts on all threads: no labels, no early end.

use rayon::prelude::*;

use super::control::{Control, pool};
use crate::error::Error;
use crate::integrate::Strobe;
use crate::memory;

/// Starts per task: enough to fill any bundle many times.
const BLOCK: usize = 1024;
/// Periods between two checks of the control.
const STRETCH: usize = 64;
/// Bytes of a start: where it began and its turns.
const EACH: usize = 24;

/// Advances every start by `periods` forcing periods, in place; the net turns come back.
///
/// # Errors
/// [`Error::Lengths`] if the slices differ in length, [`Error::NotMappable`] for effects that a map
/// cannot have, [`Error::Memory`], [`Error::Interrupted`] after [`Control::cancel`].
pub fn advance(
    strobe: &Strobe,
    theta: &mut [f64],
    velocity: &mut [f64],
    periods: usize,
    threads: usize,
    control: &Control,
) -> Result<Vec<i64>, Error> {
    if theta.len() != velocity.len() {
        let given = (theta.len(), velocity.len());
        return Err(Error::Lengths { given, names: ("theta", "velocity") });
    }
    strobe.pendulum.check_mappable()?;
    memory::reckon("starts", theta.len(), EACH)?;
    control.begin(theta.len());
    let first = theta.to_vec();
    let mut turns = vec![0.0; theta.len()];
    pool(threads)?.install(|| {
        theta
            .par_chunks_mut(BLOCK)
            .zip(velocity.par_chunks_mut(BLOCK))
            .zip(turns.par_chunks_mut(BLOCK))
            .try_for_each(|((theta, velocity), turns)| {
                for begin in (0..periods).step_by(STRETCH) {
                    control.check()?;
                    strobe.advance(theta, velocity, turns, STRETCH.min(periods - begin))?;
                }
                control.add(theta.len());
                Ok(())
            })
    })?;
    let net = |((turns, end), start): ((f64, &f64), f64)| {
        (turns + (end - start) / std::f64::consts::TAU).round() as i64
    };
    Ok(turns.into_iter().zip(theta.iter()).zip(first).map(net).collect())
}
