//! Long runs of uncaptured trajectories, window by window: visited regions and senses of turns.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, Ordering};

use super::kind::Kind;
use super::region::Region;
use crate::integrate::kernel::block::Block;
use crate::integrate::{State, Strobe};

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
pub struct Cut {
    /// Windows per trajectory.
    pub windows: usize,
    /// Periods per window.
    pub length: usize,
    /// Cells of a region around the circle.
    pub side: usize,
}

/// The windows of all trajectories from `states`, one list each; `None` if `cancel` was set.
#[must_use]
pub fn long_runs(
    strobe: &Strobe,
    states: &[State],
    cut: Cut,
    cancel: &AtomicBool,
) -> Option<Vec<Vec<Window>>> {
    let width = strobe.block_width(states.len());
    let mut all = Vec::with_capacity(states.len());
    for chunk in states.chunks(width) {
        all.extend(walk_block(strobe, chunk, width, cut, cancel)?);
    }
    Some(all)
}

fn walk_block(
    strobe: &Strobe,
    states: &[State],
    width: usize,
    cut: Cut,
    cancel: &AtomicBool,
) -> Option<Vec<Vec<Window>>> {
    let kick = strobe.schedule.kick;
    let (theta, velocity): (Vec<f64>, Vec<f64>) = states.iter().map(|s| (s[0], s[1])).unzip();
    let mut block = Block::new(width);
    block.fill(&theta, &velocity, kick);
    block.wrap(strobe.angle);
    // The well between two upright positions; a passage over the top changes it by one.
    let well = |block: &Block, i: usize| {
        (0.5 * block.half_turns[i] + 0.5).floor() as i64 + block.turns[i] as i64
    };
    let mut last: Vec<i64> = (0..states.len()).map(|i| well(&block, i)).collect();
    let mut before = vec![0_i64; states.len()];
    let empty = Region::new(cut.side, &strobe.pendulum);
    let mut all: Vec<Vec<Window>> = vec![Vec::with_capacity(cut.windows); states.len()];
    for _ in 0..cut.windows {
        let from: Vec<f64> = block.turns[..states.len()].to_vec();
        for windows in &mut all {
            windows.push(Window {
                region: empty.clone(),
                senses: Senses::default(),
                points: Vec::with_capacity(cut.length),
                turns: 0.0,
            });
        }
        for _ in 0..cut.length {
            if cancel.load(Ordering::Relaxed) {
                return None;
            }
            for k in 0..strobe.steps() {
                strobe.step(&mut block, k);
                for i in 0..states.len() {
                    let now = well(&block, i);
                    if now == last[i] {
                        continue;
                    }
                    let sense = (now - last[i]).signum();
                    let Some(window) = all[i].last_mut() else { continue };
                    window.senses.passes = true;
                    if before[i] == sense {
                        window.senses.turns[usize::from(sense > 0)] = true;
                    }
                    (before[i], last[i]) = (sense, now);
                }
            }
            block.wrap(strobe.angle);
            for (i, windows) in all.iter_mut().enumerate() {
                let Some(window) = windows.last_mut() else { continue };
                let state = [block.half_turns[i] * PI, block.kick[i] / kick];
                window.points.push(state);
                window.turns = block.turns[i] - from[i];
            }
        }
        for window in all.iter_mut().filter_map(|windows| windows.last_mut()) {
            window.region = empty.of(&window.points);
        }
    }
    Some(all)
}
