//! Trajectories run until an attractor has captured them: a lane that has finished takes the next
//! start at a period's end.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_1_PI, TAU};
use std::sync::atomic::AtomicBool;

use super::capture_test::{CaptureHistory, CaptureTest, fate_at_bound};
use super::trap::{Band, Ellipse};
use crate::error::{Error, unless_cancelled};
use crate::integrate::kernel::block::Block;
use crate::integrate::{State, Strobe};
use crate::lanes::{Isa, Job, Lane, dispatch};
use crate::model::Angle;

/// All trapping regions.
#[derive(Clone, Debug, Default)]
pub struct Traps {
    /// Around the points of periodic attractors.
    pub ellipses: Vec<Ellipse>,
    /// Around running states.
    pub bands: Vec<Band>,
    /// With friction, the states of permanent sticking.
    pub rests: Rests,
}

/// The sets of states that friction holds for ever: at most one around each half turn.
#[derive(Clone, Debug, Default)]
pub struct Rests {
    /// Topology of the angle: circle or line.
    pub angle: Angle,
    /// The index of each set's attractor, by [`Angle::half_turn`].
    pub sets: BTreeMap<i64, usize>,
}

impl Rests {
    /// The set that holds the angle `theta`.
    #[must_use]
    pub fn of(&self, theta: f64) -> Option<usize> {
        self.sets.get(&self.angle.half_turn(theta)).copied()
    }
}

/// How a trajectory ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    /// Inside the traps of this attractor for two successive periods.
    Captured(usize),
    /// The bound was reached first.
    Open,
    /// Left the range of numbers.
    Failed,
}

/// A trajectory's end.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// How it ended.
    pub fate: Fate,
    /// Periods until the first of the two hits, or until the bound.
    pub periods: u32,
    /// Net turns over these periods.
    pub turns: i64,
    /// The state at the end, angle in [-pi, pi].
    pub state: State,
    /// Periods integrated.
    pub work: u32,
}

impl Outcome {
    /// The periods after which it ended; `None` if nothing ended it within the bound.
    #[must_use]
    pub fn end(&self) -> Option<u32> {
        (self.fate != Fate::Open).then_some(self.periods)
    }
}

/// A source of starts: indices and states.
pub trait Source {
    /// Approximate number of starts.
    fn count(&self) -> usize;
    /// The next start.
    fn next(&mut self) -> Option<(usize, State)>;
    /// Takes the outcome of start `index`.
    fn done(&mut self, index: usize, outcome: Outcome);
}

/// Runs all starts of `source` for at most `bound` periods.
///
/// # Errors
/// [`Error::Interrupted`] if `cancel` was set.
pub fn run(
    strobe: &Strobe,
    traps: &Traps,
    bound: u32,
    cancel: &AtomicBool,
    source: &mut dyn Source,
) -> Result<(), Error> {
    CaptureRun::new(CaptureJob { strobe, traps, bound, cancel, source }).run()
}

/// All outcomes of `starts`, in their order.
///
/// # Errors
/// [`Error::Interrupted`] if `cancel` was set.
pub fn outcomes(
    strobe: &Strobe,
    traps: &Traps,
    bound: u32,
    starts: &[State],
    cancel: &AtomicBool,
) -> Result<Vec<Outcome>, Error> {
    struct Slice<'a>(std::iter::Enumerate<std::slice::Iter<'a, State>>, Vec<Option<Outcome>>);
    impl Source for Slice<'_> {
        fn count(&self) -> usize {
            self.1.len()
        }
        fn next(&mut self) -> Option<(usize, State)> {
            self.0.next().map(|(i, s)| (i, *s))
        }
        fn done(&mut self, index: usize, outcome: Outcome) {
            self.1[index] = Some(outcome);
        }
    }
    let mut slice = Slice(starts.iter().enumerate(), vec![None; starts.len()]);
    run(strobe, traps, bound, cancel, &mut slice)?;
    Ok(slice.1.into_iter().flatten().collect())
}

struct CaptureJob<'a> {
    strobe: &'a Strobe,
    traps: &'a Traps,
    bound: u32,
    cancel: &'a AtomicBool,
    source: &'a mut dyn Source,
}

/// The trajectory in one lane.
#[derive(Clone, Copy)]
struct LaneTrajectory {
    index: usize,
    first_theta: f64,
    begin: u64,
    history: CaptureHistory,
}

/// A block whose lanes take a new start when one has ended.
struct CaptureRun<'a> {
    job: CaptureJob<'a>,
    test: CaptureTest<'a>,
    block: Block,
    height: Vec<f64>,
    trajectories: Vec<Option<LaneTrajectory>>,
    clock: u64,
    next_expiry: u64,
}

impl<'a> CaptureRun<'a> {
    fn new(job: CaptureJob<'a>) -> Self {
        let width = job.strobe.block_width(job.source.count());
        Self {
            test: CaptureTest::new(job.strobe, job.traps),
            job,
            block: Block::new(width),
            height: vec![f64::INFINITY; width],
            trajectories: vec![None; width],
            clock: 0,
            next_expiry: u64::MAX,
        }
    }

    fn run(mut self) -> Result<(), Error> {
        let width = self.trajectories.len();
        let mut occupied = 0;
        for lane in 0..width {
            occupied += usize::from(self.refill(lane));
        }
        while occupied > 0 {
            self.job.strobe.period(&mut self.block);
            let heights = Heights {
                angle: self.job.strobe.angle,
                block: &mut self.block,
                ellipses: &self.test.scaled,
                height: &mut self.height,
            };
            let low = dispatch::run(self.job.strobe.simd, heights);
            self.clock += 1;
            let bands = !self.job.traps.bands.is_empty();
            if low < 1.0 || bands {
                for lane in 0..width {
                    if (self.height[lane] < 1.0 || bands) && self.captured(lane) {
                        occupied -= usize::from(!self.refill(lane));
                    }
                }
            }
            if self.job.strobe.friction {
                for lane in 0..width {
                    if !self.block.held_at[lane].is_nan() && self.at_rest(lane) {
                        occupied -= usize::from(!self.refill(lane));
                    }
                }
            }
            if self.clock >= self.next_expiry {
                occupied -= self.expire(width);
            }
            unless_cancelled(self.job.cancel)?;
        }
        Ok(())
    }

    /// Puts the next start into `lane`; false if there is none.
    #[inline(never)]
    fn refill(&mut self, lane: usize) -> bool {
        let Some((index, [theta, velocity])) = self.job.source.next() else {
            self.trajectories[lane] = None;
            self.block.idle[lane] = true;
            (self.block.half_turns[lane], self.block.kick[lane]) = (0.0, 0.0);
            return false;
        };
        self.block.half_turns[lane] = theta * FRAC_1_PI;
        self.block.kick[lane] = velocity * self.job.strobe.schedule.kick;
        self.block.turns[lane] = 0.0;
        self.trajectories[lane] = Some(LaneTrajectory {
            index,
            first_theta: theta,
            begin: self.clock,
            history: CaptureHistory::default(),
        });
        self.next_expiry = self.next_expiry.min(self.clock + u64::from(self.job.bound));
        true
    }

    /// Whether a trap has captured `lane`; if so its outcome has been delivered.
    #[inline(never)]
    fn captured(&mut self, lane: usize) -> bool {
        let Some(trajectory) = &mut self.trajectories[lane] else { return false };
        let hit = self.test.captured(&self.block, lane, self.clock, &mut trajectory.history);
        let (Some(hit), trajectory) = (hit, *trajectory) else { return false };
        let end = ([hit.theta, hit.velocity], hit.turns, hit.clock);
        self.deliver(trajectory, Fate::Captured(hit.attractor), end);
        true
    }

    /// Whether friction holds `lane` for ever, or it creeps to such a state; if so its outcome has
    /// been delivered.
    #[inline(never)]
    fn at_rest(&mut self, lane: usize) -> bool {
        let Some(trajectory) = &mut self.trajectories[lane] else { return false };
        let rest = self.test.at_rest(&self.block, lane, self.clock, &mut trajectory.history);
        let (Some(rest), trajectory) = (rest, *trajectory) else { return false };
        self.deliver(trajectory, Fate::Captured(rest), self.end(lane));
        true
    }

    /// State, turns and time of `lane` now.
    fn end(&self, lane: usize) -> (State, f64, u64) {
        (self.test.state(&self.block, lane), self.block.turns[lane], self.clock)
    }

    fn deliver(&mut self, trajectory: LaneTrajectory, fate: Fate, end: (State, f64, u64)) {
        let ([theta, velocity], turns, clock) = end;
        let whole = turns + (theta - trajectory.first_theta) / TAU;
        let outcome = Outcome {
            fate,
            periods: (clock - trajectory.begin) as u32,
            turns: whole.round() as i64,
            state: [theta, velocity],
            work: (self.clock - trajectory.begin) as u32,
        };
        self.job.source.done(trajectory.index, outcome);
    }

    /// Ends the lanes that have reached their bound; returns the number of lanes that stay empty.
    #[inline(never)]
    fn expire(&mut self, width: usize) -> usize {
        let bound = u64::from(self.job.bound);
        self.next_expiry = u64::MAX;
        let mut emptied = 0;
        for lane in 0..width {
            let Some(trajectory) = self.trajectories[lane] else { continue };
            let expiry = trajectory.begin + bound;
            if expiry > self.clock {
                self.next_expiry = self.next_expiry.min(expiry);
                continue;
            }
            let end = self.end(lane);
            let rest = self.test.approached(end.0).map(Fate::Captured);
            self.deliver(trajectory, rest.unwrap_or_else(|| fate_at_bound(end.0)), end);
            emptied += usize::from(!self.refill(lane));
        }
        emptied
    }
}

/// Removes whole turns; returns the lowest height above the traps' centres.
struct Heights<'a> {
    angle: Angle,
    block: &'a mut Block,
    ellipses: &'a [Ellipse],
    height: &'a mut [f64],
}

impl Job for Heights<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) -> f64 {
        if self.height.len().is_multiple_of(S::Lanes::WIDTH) {
            self.of::<S::Lanes>(isa)
        } else {
            self.of::<S::Few>(isa)
        }
    }
}

impl Heights<'_> {
    #[inline(always)]
    fn of<L: Lane>(self, token: L::Token) -> f64 {
        let mut lowest = f64::INFINITY;
        let mut at = 0;
        while at < self.height.len() {
            let (half_turns, whole) = self.angle.wrap(L::load(token, &self.block.half_turns[at..]));
            let kick = L::load(token, &self.block.kick[at..]);
            let mut height = L::splat(token, f64::INFINITY);
            for e in self.ellipses {
                let x = half_turns - half_turns.like(e.centre[0]);
                let y = kick - half_turns.like(e.centre[1]);
                let y1 = x.scale_add(e.shape[0], y.scale(e.shape[1]));
                let y2 = y.scale(e.shape[2]);
                height = y1.mul_add(y1, y2 * y2).min(height);
            }
            half_turns.store(&mut self.block.half_turns[at..]);
            (L::load(token, &self.block.turns[at..]) + whole).store(&mut self.block.turns[at..]);
            height.store(&mut self.height[at..]);
            for h in &self.height[at..at + L::WIDTH] {
                lowest = if *h < lowest { *h } else { lowest };
            }
            at += L::WIDTH;
        }
        lowest
    }
}
