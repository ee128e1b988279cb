//! Plain integration of many starts on all threads: no labels, no early end.

use rayon::prelude::*;

use super::control::{Control, pool};
use crate::error::Error;
use crate::integrate::{State, States, Strobe};
use crate::memory;

/// Starts per task: enough to fill any bundle many times.
const BLOCK: usize = 1024;
/// Periods between two checks of the control.
const STRETCH: usize = 64;
/// Bytes of a start: its state and turns in a block, and in the result.
const EACH: usize = 48;

/// The states after `periods` forcing periods from `starts`, and the net turns until then.
///
/// # Errors
/// [`Error::NotMappable`] for effects that a map cannot have, [`Error::Memory`],
/// [`Error::Interrupted`] after [`Control::cancel`].
pub fn advance(
    strobe: &Strobe,
    starts: &[State],
    periods: usize,
    threads: usize,
    control: &Control,
) -> Result<(States, Vec<i64>), Error> {
    strobe.pendulum.check_mappable()?;
    memory::reckon("starts", starts.len(), EACH)?;
    control.begin(starts.len());
    let block = |part: &[State]| {
        let mut states = States::from(part);
        for begin in (0..periods).step_by(STRETCH) {
            control.check()?;
            strobe.advance(&mut states, STRETCH.min(periods - begin));
        }
        control.add(part.len());
        Ok(states)
    };
    let blocks: Vec<States> = pool(threads)?
        .install(|| starts.par_chunks(BLOCK).map(block).collect::<Result<_, Error>>())?;
    let mut ends = States::default();
    for block in blocks {
        ends.append(block);
    }
    let net = |((turns, end), start): ((&f64, &f64), &State)| {
        (turns + (end - start[0]) / std::f64::consts::TAU).round() as i64
    };
    let turns = ends.turns().iter().zip(ends.theta()).zip(starts).map(net).collect();
    Ok((ends, turns))
}
