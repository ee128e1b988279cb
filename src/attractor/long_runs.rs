//! Long runs of uncaptured trajectories, window by window: visited regions and senses of turns.

use std::sync::atomic::AtomicBool;

use super::capture::{Fate, Traps};
use super::capture_test::{CaptureHistory, CaptureTest, fate_at_bound};
use super::kind::Kind;
use super::region::Region;
use crate::error::{Error, unless_cancelled};
use crate::integrate::kernel::block::Block;
use crate::integrate::{State, States, Strobe};

/// Passages over the top, detected at every step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Senses {
    /// Whether it went over the top at all.
    pub passes: bool,
    /// Whether it passed the top twice in succession backward, and forward: over and back at once
    /// is no turn.
    pub turns: [bool; 2],
}

impl Senses {
    /// Both taken together.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        let [backward, forward] = self.turns;
        Self {
            passes: self.passes || other.passes,
            turns: [backward || other.turns[0], forward || other.turns[1]],
        }
    }

    /// The kind of chaos with these turns, and its sense: 1, -1, or 0 for both or none.
    ///
    /// Motion that passes the top and never twice in succession in one sense is tumbling.
    #[must_use]
    pub fn kind(self) -> (Kind, i64) {
        match self.turns {
            [false, false] if !self.passes => (Kind::LibrationChaos, 0),
            [false, true] => (Kind::RotatingChaos, 1),
            [true, false] => (Kind::RotatingChaos, -1),
            _ => (Kind::TumblingChaos, 0),
        }
    }
}

/// The behaviour of a trajectory over a number of periods.
#[derive(Clone, Debug)]
pub struct Window {
    /// The region of its stroboscopic points.
    pub region: Region,
    /// Its passages over the top.
    pub senses: Senses,
    /// Its stroboscopic points.
    pub points: Vec<State>,
    /// Net turns.
    pub turns: f64,
}

/// Division of a run into windows.
#[derive(Clone, Copy, Debug)]
pub struct WindowPlan {
    /// Windows per trajectory.
    pub windows: usize,
    /// Periods per window.
    pub length: usize,
    /// Cells of a region around the circle.
    pub side: usize,
}

/// A run, and how it ended.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its windows; if a trap captured it, those before.
    pub windows: Vec<Window>,
    /// How it ended.
    pub fate: Fate,
    /// Periods until then.
    pub periods: u32,
    /// Its last state.
    pub state: State,
}

/// The runs from `states`, until one of the `traps` captures them.
///
/// # Errors
/// [`Error::Interrupted`] if `cancel` was set.
pub fn long_runs(
    strobe: &Strobe,
    traps: &Traps,
    states: &[State],
    plan: WindowPlan,
    cancel: &AtomicBool,
) -> Result<Vec<Run>, Error> {
    let width = strobe.block_width(states.len());
    let mut all = Vec::with_capacity(states.len());
    for chunk in states.chunks(width) {
        let mut block = RunBlock::new(strobe, traps, chunk, width, plan);
        for _ in 0..plan.windows * plan.length {
            unless_cancelled(cancel)?;
            block.period();
            if block.runs.iter().all(|run| run.fate != Fate::Open) {
                break;
            }
        }
        all.extend(block.ended());
    }
    Ok(all)
}

/// The runs in a block.
struct RunBlock<'a> {
    strobe: &'a Strobe,
    test: CaptureTest<'a>,
    plan: WindowPlan,
    block: Block,
    clock: u64,
    runs: Vec<Run>,
    lanes: Vec<Lane>,
    /// The middle of the well between two upright positions that each is in, in half turns; a passage over
    /// the top changes it by two.
    middles: Vec<f64>,
}

/// What is known of the run in a lane.
#[derive(Clone, Copy, Default)]
struct Lane {
    history: CaptureHistory,
    /// Sense of the last passage.
    before: i64,
    /// Turns at the beginning of the window.
    from: f64,
}

impl<'a> RunBlock<'a> {
    fn new(
        strobe: &'a Strobe,
        traps: &'a Traps,
        states: &[State],
        width: usize,
        plan: WindowPlan,
    ) -> Self {
        let columns = States::from(states);
        let mut block = Block::new(width);
        block.fill(columns.theta(), columns.velocity(), strobe.schedule.kick);
        block.wrap(strobe.angle);
        let run = |state: &State| Run {
            windows: Vec::with_capacity(plan.windows),
            fate: Fate::Open,
            periods: 0,
            state: *state,
        };
        Self {
            strobe,
            test: CaptureTest::new(strobe, traps),
            plan,
            block,
            clock: 0,
            runs: states.iter().map(run).collect(),
            lanes: vec![Lane::default(); states.len()],
            middles: vec![0.0; states.len()],
        }
    }

    /// Begins a window of every run.
    fn open(&mut self) {
        let empty = Window {
            region: Region::new(self.plan.side, &self.strobe.pendulum),
            senses: Senses::default(),
            points: Vec::with_capacity(self.plan.length),
            turns: 0.0,
        };
        for (i, (run, lane)) in self.runs.iter_mut().zip(&mut self.lanes).enumerate() {
            lane.from = self.block.turns[i];
            if run.fate == Fate::Open {
                run.windows.push(empty.clone());
            }
        }
    }

    /// Advances all runs by a period.
    fn period(&mut self) {
        if self.clock.is_multiple_of(self.plan.length as u64) {
            self.open();
        }
        // Wrapping at the end of a period moves the well with the angle.
        for (middle, half_turns) in self.middles.iter_mut().zip(&self.block.half_turns) {
            *middle = well(*half_turns);
        }
        let Self { strobe, block, runs, lanes, middles, .. } = self;
        strobe.period_seen(block, &mut |block| {
            let all = middles.iter().zip(&block.half_turns);
            if all.fold(false, |passed, (middle, at)| passed | ((at - middle).abs() >= 1.0)) {
                passages(&block.half_turns, middles, runs, lanes);
            }
        });
        self.block.wrap(self.strobe.angle);
        self.clock += 1;
        for i in 0..self.runs.len() {
            if self.runs[i].fate == Fate::Open {
                self.record(i);
            }
        }
    }

    /// Adds the state of a run to its window, or ends it.
    fn record(&mut self, i: usize) {
        let (run, lane) = (&mut self.runs[i], &mut self.lanes[i]);
        let hit = self.test.captured(&self.block, i, self.clock, &mut lane.history);
        let mut end = hit.map(|hit| (hit.attractor, hit.clock));
        if end.is_none() && self.strobe.friction && !self.block.held_at[i].is_nan() {
            let rest = self.test.at_rest(&self.block, i, self.clock, &mut lane.history);
            end = rest.map(|rest| (rest, self.clock));
        }
        run.state = self.test.state(&self.block, i);
        run.periods = self.clock as u32;
        if let Some((attractor, at)) = end {
            run.fate = Fate::Captured(attractor);
            run.periods = at as u32;
            run.windows.truncate(at as usize / self.plan.length);
        } else if let Some(window) = run.windows.last_mut() {
            window.points.push(run.state);
            window.turns = self.block.turns[i] - lane.from;
        }
    }

    fn ended(self) -> Vec<Run> {
        let mut runs = self.runs;
        for run in &mut runs {
            if run.fate == Fate::Open {
                run.fate = fate_at_bound(run.state);
            }
            for window in &mut run.windows {
                window.region.mark(&window.points);
            }
        }
        runs
    }
}

/// Notes the passages over the top in a step that has ended at `half_turns`.
fn passages(half_turns: &[f64], middles: &mut [f64], runs: &mut [Run], lanes: &mut [Lane]) {
    for (i, run) in runs.iter_mut().enumerate() {
        let away = half_turns[i] - middles[i];
        if (-1.0..1.0).contains(&away) || away.is_nan() {
            continue;
        }
        let sense = away.signum() as i64;
        middles[i] = well(half_turns[i]);
        let Some(window) = run.windows.last_mut() else { continue };
        window.senses.passes = true;
        if lanes[i].before == sense {
            window.senses.turns[usize::from(sense > 0)] = true;
        }
        lanes[i].before = sense;
    }
}

/// The middle of the well of an angle, both in half turns.
fn well(half_turns: f64) -> f64 {
    2.0 * (0.5 * half_turns + 0.5).floor()
}
