//! A block of trajectories at one phase of the drive, one forcing period at a time.
//!
//! Smooth motions run a bundle at a time through the whole period. With friction, or another law that
//! changes with the sign of the velocity, all bundles take each step with the sign held; lanes whose
//! velocity passed zero, or that met a corner ([`super::corner`]), go into a queue that runs in lanes too,
//! each with its own phase and step ([`super::event`]). Lanes that are held fast wait for their release.

use std::f64::consts::{FRAC_1_PI, PI};

use super::event::EventSearch;
use super::runner::run;
use super::stroboscopic::Strobe;
use crate::lanes::{Isa, Job, Lane, MAX_WIDTH, dispatch};
use crate::model::Angle;

/// Most trajectories of a block with events: enough for the queue of a step to fill its lanes.
const WITH_EVENTS: usize = 6144;

/// States, accelerations or times of a bundle, and from the seventh on what [`super::event::Switching`] holds: 0
/// where there is no corner.
pub(super) type Scratch = [[f64; MAX_WIDTH]; 11];

/// A lane held by friction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub lane: usize,
    pub half_turns: f64,
    pub until: f64,
    pub sense: f64,
}

/// The states of a block, in memory, and those that wait.
#[derive(Clone, Debug)]
pub struct Block {
    /// Angles over pi.
    pub half_turns: Vec<f64>,
    /// Velocities times the schedule's `kick`.
    pub kick: Vec<f64>,
    /// Whole turns removed.
    pub turns: Vec<f64>,
    /// Angles over pi at which friction has held a trajectory during the last period; NaN where it
    /// has not.
    pub held_at: Vec<f64>,
    /// Lanes without a trajectory: they stay at rest at 0.
    pub idle: Vec<bool>,
    pub(super) held: Vec<Held>,
    pub(super) queue: Vec<EventSearch>,
    /// Values transferred from lanes to the queue.
    pub(super) scratch: Box<Scratch>,
}

impl Block {
    /// `width` trajectories at rest.
    #[must_use]
    pub fn new(width: usize) -> Self {
        let zeros = vec![0.0; width];
        Self {
            half_turns: zeros.clone(),
            kick: zeros.clone(),
            turns: zeros,
            held_at: vec![f64::NAN; width],
            idle: vec![false; width],
            held: Vec::new(),
            queue: Vec::new(),
            scratch: Box::new([[0.0; MAX_WIDTH]; 11]),
        }
    }

    /// These states in front, idle lanes behind them; `kick` is the schedule's.
    pub fn fill(&mut self, theta: &[f64], velocity: &[f64], kick: f64) {
        self.half_turns.fill(0.0);
        self.kick.fill(0.0);
        self.turns.fill(0.0);
        self.idle.fill(true);
        self.idle[..theta.len()].fill(false);
        for (slot, theta) in self.half_turns.iter_mut().zip(theta) {
            *slot = theta * FRAC_1_PI;
        }
        for (slot, velocity) in self.kick.iter_mut().zip(velocity) {
            *slot = velocity * kick;
        }
    }

    /// Takes whole turns off the angles and adds them to `turns`.
    pub fn wrap(&mut self, angle: Angle) {
        for (half_turns, turns) in self.half_turns.iter_mut().zip(&mut self.turns) {
            let (wrapped, whole) = angle.wrap(*half_turns);
            *half_turns = wrapped;
            *turns += whole;
        }
    }

    /// Keeps the held lanes at rest through the step, and releases those whose time has come.
    #[inline(never)]
    pub(super) fn let_go(&mut self, time: [f64; 2]) {
        let Self { half_turns, kick, held, queue, idle, .. } = self;
        for ((half_turns, kick), _) in
            half_turns.iter_mut().zip(kick.iter_mut()).zip(idle).filter(|(_, idle)| **idle)
        {
            (*half_turns, *kick) = (0.0, 0.0);
        }
        held.retain(|h| {
            half_turns[h.lane] = h.half_turns;
            kick[h.lane] = 0.0;
            if h.until >= time[1] {
                return true;
            }
            let state = [h.half_turns * PI, 0.0];
            queue.push(EventSearch::new(h.lane, state, h.sense, h.until.max(time[0]), time[1]));
            false
        });
    }
}

impl Strobe {
    /// Number of trajectories of a block for `count` of them: small bundles of lanes as long as these take less time
    /// than a whole one, a whole one, or with events so many that those of a step fill the lanes of their queue.
    #[must_use]
    pub fn block_width(&self, count: usize) -> usize {
        let [few, wide, both] = dispatch::run(self.simd, Widths);
        let small = count.max(1).next_multiple_of(few);
        match (self.is_plain(), self.events) {
            _ if 4 * small <= 3 * wide => small,
            (true, _) => wide,
            (false, true) => count.clamp(1, WITH_EVENTS).next_multiple_of(both),
            (false, false) => both,
        }
    }

    /// Advances by one forcing period; the block is [`Strobe::block_width`] wide.
    pub fn period(&self, block: &mut Block) {
        dispatch::run(self.simd, Steps { strobe: self, block, see: None });
    }

    /// [`Strobe::period`] that shows the block to `see` after each step.
    pub fn period_seen(&self, block: &mut Block, see: &mut dyn FnMut(&Block)) {
        dispatch::run(self.simd, Steps { strobe: self, block, see: Some(see) });
    }

    /// Runs a block of any width, one trajectory at a time with the arithmetic of a lane.
    // Compiled where it is called: in tests alone.
    #[inline]
    pub fn period_singly(&self, block: &mut Block) {
        dispatch::run(self.simd, Singly(Steps { strobe: self, block, see: None }));
    }
}

/// The width of a small bundle and of a whole one, and the least that holds whole bundles of
/// either kind.
struct Widths;

impl Job for Widths {
    type Output = [usize; 3];
    #[inline(always)]
    fn run<S: Isa>(self, _: S) -> [usize; 3] {
        let (wide, narrow) = (S::Lanes::WIDTH, S::Narrow::WIDTH);
        let both = (1..=narrow).map(|k| k * wide).find(|w| w % narrow == 0);
        [S::Few::WIDTH, wide, both.unwrap_or(wide * narrow)]
    }
}

/// What sees a block after each step.
pub(super) type See<'a> = Option<&'a mut dyn FnMut(&Block)>;

struct Steps<'a> {
    strobe: &'a Strobe,
    block: &'a mut Block,
    see: See<'a>,
}

impl Job for Steps<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) {
        let Self { strobe, block, see } = self;
        if block.kick.len().is_multiple_of(S::Lanes::WIDTH) {
            run::<S::Lanes, S::Narrow>(strobe, (isa, isa), block, see);
        } else {
            run::<S::Few, S::Few>(strobe, (isa, isa), block, see);
        }
    }
}

struct Singly<'a>(Steps<'a>);

impl Job for Singly<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, _: S) {
        let Steps { strobe, block, see } = self.0;
        run::<S::Single, S::Single>(strobe, ((), ()), block, see);
    }
}
