//! Tests of lanes against traps: whether an attractor has captured a trajectory.

use std::f64::consts::{FRAC_1_PI, PI};

use super::capture::{Fate, Traps};
use super::trap::Ellipse;
use crate::integrate::kernel::block::Block;
use crate::integrate::{State, Strobe};

/// At the edge of a set at rest a pendulum creeps into it, ever more slowly, and never arrives: if
/// it is held in two successive periods, nearer in the second, and within this part of the friction
/// of permanent sticking, it is at rest. Held states form a line, on which their map is monotone.
const CREEPING: f64 = 0.05;
/// A heavily damped pendulum without drive approaches the edge of a set at rest for ever: slower than this, and this
/// near to angles that friction holds, it is at rest.
const SLOW: f64 = 1e-7;
const AHEAD: f64 = 1e-4;

/// A hit: which attractor and point, when, and where the trajectory was.
#[derive(Clone, Copy)]
pub(super) struct Hit {
    pub(super) attractor: usize,
    point: usize,
    pub(super) clock: u64,
    pub(super) turns: f64,
    pub(super) theta: f64,
    pub(super) velocity: f64,
}

/// Hits and holds of the trajectory in a lane in earlier periods.
#[derive(Clone, Copy, Default)]
pub(super) struct CaptureHistory {
    hit: Option<Hit>,
    /// When friction last held it, and by how much the maximum load exceeds the friction.
    held: Option<(u64, f64)>,
}

/// Tests the lanes of a block against the traps, period by period.
pub(super) struct CaptureTest<'a> {
    strobe: &'a Strobe,
    traps: &'a Traps,
    /// Ellipses in the coordinates of a lane: half turns and kick.
    pub(super) scaled: Vec<Ellipse>,
}

impl<'a> CaptureTest<'a> {
    pub(super) fn new(strobe: &'a Strobe, traps: &'a Traps) -> Self {
        let scale = strobe.schedule.kick;
        let scaled = traps
            .ellipses
            .iter()
            .map(|e| Ellipse {
                centre: [e.centre[0] * FRAC_1_PI, e.centre[1] * scale],
                shape: [e.shape[0] * PI, e.shape[1] / scale, e.shape[2] / scale],
                ..*e
            })
            .collect();
        Self { strobe, traps, scaled }
    }

    /// The trap that holds `lane`, as attractor, point and length of its cycle.
    fn trap(&self, block: &Block, lane: usize) -> Option<(usize, usize, usize)> {
        let state = [block.half_turns[lane], block.kick[lane]];
        if let Some(e) = self.scaled.iter().find(|e| e.height(state) < 1.0) {
            return Some((e.attractor, e.point, e.cycle));
        }
        let state = self.state(block, lane);
        self.traps.bands.iter().find(|b| b.contains(state)).map(|b| (b.attractor, 0, 1))
    }

    /// The first of two hits of `lane` on the same attractor, one point on, in successive periods, of
    /// which the second ends at `clock`.
    pub(super) fn captured(
        &self,
        block: &Block,
        lane: usize,
        clock: u64,
        history: &mut CaptureHistory,
    ) -> Option<Hit> {
        let (attractor, point, cycle) = self.trap(block, lane)?;
        let next = |hit: &Hit| {
            let consecutive = hit.clock + 1 == clock && hit.attractor == attractor;
            consecutive && point == (hit.point + 1) % cycle
        };
        if let Some(hit) = history.hit.filter(next) {
            return Some(hit);
        }
        let [theta, velocity] = self.state(block, lane);
        let turns = block.turns[lane];
        history.hit = Some(Hit { attractor, point, clock, turns, theta, velocity });
        None
    }

    /// The set at rest in which friction holds `lane` for ever, or into which it creeps.
    pub(super) fn at_rest(
        &self,
        block: &Block,
        lane: usize,
        clock: u64,
        history: &mut CaptureHistory,
    ) -> Option<usize> {
        let theta = block.held_at[lane] * PI;
        let rest = self.traps.rests.of(theta)?;
        let equation = &self.strobe.equation;
        let excess = equation.excess(theta);
        let limit = equation.hold(theta);
        let creeps = history.held.is_some_and(|(before, more)| {
            before + 1 == clock && excess < more && excess < CREEPING * limit
        });
        history.held = Some((clock, excess));
        (equation.holds_for_ever(theta) || creeps).then_some(rest)
    }

    /// The set at rest whose edge a pendulum without drive approaches. It cannot pass through the set: the friction
    /// would stop it within a hundredth of the angles that are looked at.
    pub(super) fn approached(&self, [theta, velocity]: State) -> Option<usize> {
        let equation = &self.strobe.equation;
        if !self.strobe.friction || !equation.is_autonomous() || velocity.abs() > SLOW {
            return None;
        }
        let ahead = |distance: f64| theta + distance.copysign(velocity);
        let held = [AHEAD, 3.0 * AHEAD].iter().all(|d| equation.holds_for_ever(ahead(*d)));
        if held { self.traps.rests.of(ahead(AHEAD)) } else { None }
    }

    pub(super) fn state(&self, block: &Block, lane: usize) -> State {
        [block.half_turns[lane] * PI, block.kick[lane] / self.strobe.schedule.kick]
    }
}

/// [`Fate::Open`], or [`Fate::Failed`] of a state outside the range of numbers.
pub(super) fn fate_at_bound([theta, velocity]: State) -> Fate {
    let finite = theta.is_finite() && velocity.is_finite() && velocity.abs() < 1e6;
    if finite { Fate::Open } else { Fate::Failed }
}
