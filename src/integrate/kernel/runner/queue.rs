//! The queue of a block: lanes whose velocity passes zero, or that pass a corner, each with its own
//! phase and step.

use std::f64::consts::{FRAC_1_PI, PI};

use super::Runner;
use crate::integrate::kernel::block::{Block, Held, Scratch};
use crate::integrate::kernel::event::{EventSearch, Progress, Reached, Switching};
use crate::integrate::kernel::general::{Own, Running, Stages, WHOLE};
use crate::integrate::kernel::step::Moving;
use crate::lanes::Lane;

impl<L: Lane, Q: Lane> Runner<'_, L, Q> {
    #[inline(always)]
    pub(super) fn flagged<A: Lane>(
        &self,
        block: &mut Block,
        at: usize,
        flags: u128,
        [before, after]: [Moving<A>; 2],
        ends: [A; 2],
        time: [f64; 2],
    ) {
        let stored = &mut block.scratch;
        before.half_turns.store(&mut stored[0]);
        before.kick.store(&mut stored[1]);
        after.half_turns.store(&mut stored[2]);
        after.kick.store(&mut stored[3]);
        ends[0].store(&mut stored[4]);
        ends[1].store(&mut stored[5]);
        self.enqueue(block, at, flags, time);
    }

    /// Event searches for the flagged lanes of the bundle at `at`.
    #[inline(never)]
    fn enqueue(&self, block: &mut Block, at: usize, mut flags: u128, time: [f64; 2]) {
        let scale = 1.0 / self.strobe.schedule.kick;
        // The change of the kick in one step by the load of a stage.
        let gain = scale / (time[1] - time[0]);
        while flags != 0 {
            let bit = flags.trailing_zeros() as usize;
            flags &= flags - 1;
            let [x0, k0, x1, k1, first, last, ..] =
                block.scratch.each_ref().map(|values| values[bit]);
            let sense = 1_f64.copysign(k0);
            let state = [x0 * PI, k0 * scale];
            let whole = Reached {
                theta: x1 * PI,
                velocity: k1 * scale,
                acceleration: [first * gain, last * gain],
                switching: Switching::of(&block.scratch, bit),
            };
            block.queue.extend(EventSearch::known(at + bit, state, sense, time, &whole));
        }
    }

    /// Runs the queue until every search has reached the end of the step or is held.
    #[inline(always)]
    pub(super) fn work_off(&self, block: &mut Block, stages: &mut Stages<Q>) {
        let token = self.tokens.1;
        while !block.queue.is_empty() {
            let mut first = 0;
            while first < block.queue.len() {
                let count = (block.queue.len() - first).min(Q::WIDTH);
                gather(&block.queue[first..first + count], &mut block.scratch);
                let asked = &mut *block.scratch;
                let mut lanes = Running {
                    theta: Q::load(token, &asked[0]),
                    velocity: Q::load(token, &asked[1]),
                };
                let sense = Q::load(token, &asked[2]);
                let clock =
                    Own { begin: Q::load(token, &asked[3]), length: Q::load(token, &asked[4]) };
                let mut ends = [sense; 2];
                let mut side = sense;
                let mut early = None;
                if let Some(corner) = &self.corner {
                    let begin = corner.forcing(clock.begin);
                    let switch = corner.at(&begin, lanes.theta, lanes.velocity);
                    side = switch.side(Q::load(token, &asked[6]));
                    early = Some(switch);
                }
                self.carry(WHOLE, clock, [sense, side], &mut lanes, &mut ends, stages);
                if let (Some(corner), Some(early)) = (&self.corner, early) {
                    let end = corner.forcing(clock.begin + clock.length);
                    let last = corner.at(&end, lanes.theta, lanes.velocity);
                    let rates = [early.rate(ends[0]), last.rate(ends[1])];
                    keep(asked, side, [early.value, last.value], rates);
                }
                lanes.theta.store(&mut asked[0]);
                lanes.velocity.store(&mut asked[1]);
                ends[0].store(&mut asked[2]);
                ends[1].store(&mut asked[3]);
                self.answer(block, first, count);
                first += count;
            }
            block.queue.retain(|search| search.lane != usize::MAX);
        }
    }

    #[inline(never)]
    fn answer(&self, block: &mut Block, first: usize, count: usize) {
        let holds = self.strobe.friction.then_some(self.single);
        for i in 0..count {
            let ends = &block.scratch;
            let reached = Reached {
                theta: ends[0][i],
                velocity: ends[1][i],
                acceleration: [ends[2][i], ends[3][i]],
                switching: Switching::of(ends, i),
            };
            let search = &mut block.queue[first + i];
            let lane = search.lane;
            match search.take(&reached, holds, self.length) {
                Progress::Asks => continue,
                Progress::Arrived { theta, velocity } => {
                    block.half_turns[lane] = theta * FRAC_1_PI;
                    block.kick[lane] = velocity * self.strobe.schedule.kick;
                }
                Progress::Held { theta, until, sense } => {
                    let half_turns = theta * FRAC_1_PI;
                    block.half_turns[lane] = half_turns;
                    block.kick[lane] = 0.0;
                    block.held_at[lane] = half_turns;
                    block.held.push(Held { lane, half_turns, until, sense });
                }
            }
            search.lane = usize::MAX;
        }
    }
}

#[inline(never)]
fn gather(searches: &[EventSearch], asked: &mut Scratch) {
    for (i, search) in searches.iter().enumerate() {
        asked[0][i] = search.theta;
        asked[1][i] = search.velocity;
        asked[2][i] = search.sense;
        asked[3][i] = search.begin;
        asked[4][i] = search.length;
        asked[6][i] = search.side;
    }
}

/// Writes the side of a corner, and values and rates of its function at both ends, where
/// [`Switching::of`] reads them.
#[inline(always)]
pub(super) fn keep<L: Lane>(scratch: &mut Scratch, side: L, values: [L; 2], rates: [L; 2]) {
    side.store(&mut scratch[6]);
    values[0].store(&mut scratch[7]);
    rates[0].store(&mut scratch[8]);
    values[1].store(&mut scratch[9]);
    rates[1].store(&mut scratch[10]);
}
