//! Sets that keep their trajectories without closing: chaotic attractors and quasi-periodic
//! rotation, told apart from transients that have not ended yet.

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};

use super::effort::Effort;
use super::kind::Kind;
use super::trap::Band;
use crate::integrate::Strobe;
use crate::integrate::accuracy::distance;
use crate::integrate::block::Block;
use crate::integrate::stroboscopic::State;

/// Stroboscopic points that are kept as a picture of the set.
const KEPT: usize = 2000;
/// Trajectories that draw the curve of a quasi-periodic set.
const CURVES: usize = 32;
/// Trajectories that are watched so.
const FOLLOWED: usize = 16;
/// An exponent this many standard errors above zero is positive.
const SIGNIFICANCE: f64 = 4.0;
/// Points this near are the same.
const SAME: f64 = 1e-6;
/// Exponents (per period) within this of zero may belong to quasi-periodic motion.
const NEUTRAL: f64 = 2e-3;

/// A set of trajectories that share a region and stay there.
#[derive(Clone, Debug)]
pub struct ChaoticSet {
    /// Which chaos, or quasi-periodic rotation.
    pub kind: Kind,
    /// Sense of its turns: 1, -1, or 0 for both or none.
    pub sense: i64,
    /// How many of the trajectories belong to it.
    pub members: usize,
    /// Sampled stroboscopic points.
    pub points: Vec<State>,
    /// Largest Lyapunov exponent per unit of tau.
    pub exponent: f64,
    /// Its standard error over the sampled trajectories.
    pub exponent_stderr: f64,
    /// Where it lives.
    pub region: Region,
    /// For quasi-periodic motion: the band that captures.
    pub band: Option<Band>,
}

/// The cells that a set's stroboscopic points visit.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    occupied: Vec<bool>,
    side: usize,
    speed: f64,
}

impl Region {
    fn new(side: usize, speed: f64) -> Self {
        Self { occupied: vec![false; side * side], side, speed }
    }

    fn cell(&self, state: State) -> Option<usize> {
        let x = (state[0] / TAU + 0.5).rem_euclid(1.0) * self.side as f64;
        let y = (0.5 * state[1] / self.speed + 0.5) * self.side as f64;
        let inside = y >= 0.0 && y < self.side as f64;
        inside.then(|| y as usize * self.side + (x as usize).min(self.side - 1))
    }

    fn mark(&mut self, state: State) {
        if let Some(cell) = self.cell(state) {
            self.occupied[cell] = true;
        }
    }

    /// Whether a state lies in a visited cell.
    #[must_use]
    pub fn contains(&self, state: State) -> bool {
        self.cell(state).is_some_and(|cell| self.occupied[cell])
    }

    fn unite(&mut self, other: &Self) {
        for (mine, theirs) in self.occupied.iter_mut().zip(&other.occupied) {
            *mine |= theirs;
        }
    }

    /// Whether the two share a fifth of the smaller one's cells.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        self.overlap(other) > 0.2
    }

    fn overlap(&self, other: &Self) -> f64 {
        let both = self.occupied.iter().zip(&other.occupied).filter(|(a, b)| **a && **b).count();
        let count = |r: &Self| r.occupied.iter().filter(|x| **x).count();
        both as f64 / count(self).min(count(other)).max(1) as f64
    }
}

/// Sorts trajectories that nothing captured, first for `settled` periods and now for `watch`
/// more, into sets; those sets of which no member was captured in the second stretch are returned.
///
/// `states` are the trajectories after the first stretch, `lost` says which of them a trap took in
/// the second one. None are returned if `cancel` was set.
#[must_use]
pub fn sets(
    strobe: &Strobe,
    states: &[State],
    lost: &[bool],
    watch: usize,
    effort: &Effort,
    cancel: &AtomicBool,
) -> Vec<ChaoticSet> {
    let Some(walks) = walk(strobe, states, watch, effort.cells, cancel) else { return Vec::new() };
    let mut groups: Vec<(Vec<usize>, Region)> = Vec::new();
    for (i, walk) in walks.iter().enumerate() {
        if walk.closes(effort.longest_cycle) || 2 * walk.outside > watch {
            continue;
        }
        let mut joined = (vec![i], walk.region.clone());
        groups.retain_mut(|(members, region)| {
            let same = region.meets(&walk.region);
            if same {
                joined.0.append(members);
                joined.1.unite(region);
            }
            !same
        });
        groups.push(joined);
    }
    for (members, _) in &mut groups {
        members.sort_unstable();
    }
    groups.sort_by(|a, b| a.0.cmp(&b.0));
    groups
        .into_iter()
        .filter(|(members, _)| !members.iter().any(|i| lost[*i]))
        .filter_map(|(members, region)| {
            let walks: Vec<&Walk> = members.iter().map(|i| &walks[*i]).collect();
            describe(strobe, &walks, region, watch, effort)
        })
        .collect()
}

/// One trajectory's long run.
struct Walk {
    region: Region,
    points: Vec<State>,
    turns: f64,
    /// Periods that ended faster than the region reaches: a motion that is so for most of the time gains
    /// speed for ever, and rounding makes its exponent.
    outside: usize,
    /// Exponent per period over the run.
    exponent: f64,
}

impl Walk {
    /// Whether it repeats itself: a start exactly on an orbit that does not attract, such as upright
    /// or hanging rest, stays there for want of a perturbation.
    fn closes(&self, longest: usize) -> bool {
        (1..=longest).any(|n| {
            self.points.len() > 2 * n
                && self.points.iter().zip(&self.points[n..]).all(|(a, b)| distance(*a, *b) < SAME)
        })
    }
}

/// The long runs of all states; `None` if `cancel` was set.
fn walk(
    strobe: &Strobe,
    states: &[State],
    periods: usize,
    side: usize,
    cancel: &AtomicBool,
) -> Option<Vec<Walk>> {
    let count = states.len();
    let speed = 1.5 * states.iter().fold(4.0_f64, |m, s| m.max(s[1].abs()));
    let mut theta: Vec<f64> = states.iter().map(|s| s[0]).collect();
    let mut velocity: Vec<f64> = states.iter().map(|s| s[1]).collect();
    let mut turns = vec![0.0; count];
    let mut tangents = (vec![1.0; count], vec![0.0; count]);
    let mut growth = vec![0.0; count];
    let mut walks: Vec<Walk> = states
        .iter()
        .map(|_| Walk {
            region: Region::new(side, speed),
            points: Vec::new(),
            turns: 0.0,
            outside: 0,
            exponent: 0.0,
        })
        .collect();
    let align = periods / 2;
    for period in 0..periods {
        if cancel.load(Ordering::Relaxed) {
            return None;
        }
        if period == align {
            // Count from here: the tangents have turned into the direction of growth, and the shear
            // of regular motion, which grows them in proportion to time, adds no more than ln 2.
            growth.fill(0.0);
        }
        // Lengths agree, so this cannot fail.
        let _ = strobe.stretch(
            (&mut theta, &mut velocity),
            &mut turns,
            (&mut tangents.0, &mut tangents.1),
            &mut growth,
            1,
        );
        for (i, walk) in walks.iter_mut().enumerate() {
            let state = [theta[i], velocity[i]];
            walk.region.mark(state);
            walk.outside += usize::from(walk.region.cell(state).is_none());
            if walk.points.len() < KEPT {
                walk.points.push(state);
            }
        }
    }
    for (i, walk) in walks.iter_mut().enumerate() {
        walk.turns = turns[i];
        walk.exponent = growth[i] / (periods - align).max(1) as f64;
    }
    Some(walks)
}

fn describe(
    strobe: &Strobe,
    members: &[&Walk],
    region: Region,
    watch: usize,
    effort: &Effort,
) -> Option<ChaoticSet> {
    if strobe.pendulum.is_autonomous() {
        // A flow in the plane has no chaos; what is left here has not settled yet.
        return None;
    }
    let (mean, stderr) = mean_and_error(&members.iter().map(|w| w.exponent).collect::<Vec<_>>());
    let period = strobe.pendulum.period();
    let first = members[0];
    let share = KEPT / members.len().max(1) + 1;
    let mut points: Vec<State> =
        members.iter().flat_map(|m| m.points.iter().take(share).copied()).collect();
    points.truncate(KEPT);
    let turning = |w: &&Walk| w.turns.abs() > 0.02 * watch as f64;
    if mean.abs() < NEUTRAL && members.iter().all(turning) {
        // Near a resonance one trajectory takes long to fill the curve; several fill it sooner.
        let curve: Vec<State> =
            members.iter().take(CURVES).flat_map(|m| m.points.iter().copied()).collect();
        let band = Band::around(strobe, &curve, 0)?;
        return Some(ChaoticSet {
            kind: Kind::QuasiperiodicRotation,
            sense: first.turns.signum() as i64,
            members: members.len(),
            points,
            exponent: 0.0,
            exponent_stderr: stderr / period,
            region,
            band: Some(band),
        });
    }
    // A single trajectory has no spread: ask for a clearly positive value.
    let floor: f64 = if members.len() < 3 { 0.01 } else { 1e-3 };
    if mean < floor.max(SIGNIFICANCE * stderr) {
        return None;
    }
    let (kind, sense) = turns_over_the_top(strobe, members, effort.turning);
    Some(ChaoticSet {
        kind,
        sense,
        members: members.len(),
        points,
        exponent: mean / period,
        exponent_stderr: stderr / period,
        region,
        band: None,
    })
}

/// Mean and standard error of values that do not depend on one another.
pub(crate) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    if values.len() < 2 {
        return (mean, 0.0);
    }
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// Follows the members step by step: passages over the top in one sense, both, or none.
fn turns_over_the_top(strobe: &Strobe, members: &[&Walk], periods: usize) -> (Kind, i64) {
    let ends: Vec<State> = members.iter().filter_map(|m| m.points.last().copied()).collect();
    let (theta, velocity): (Vec<f64>, Vec<f64>) = ends.iter().map(|s| (s[0], s[1])).unzip();
    let width = strobe.block_width(FOLLOWED);
    let followed = width.min(theta.len()).min(FOLLOWED);
    let mut block = Block::new(width);
    block.fill(&theta[..followed], &velocity[..followed], strobe.schedule.kick);
    // The well between two upright positions; a passage over the top changes it by one.
    let well = |half_turns: f64| (0.5 * half_turns + 0.5).floor() as i64;
    let mut last: Vec<i64> = block.half_turns[..followed].iter().map(|x| well(*x)).collect();
    let mut before = vec![None::<i64>; followed];
    let mut turned = vec![[false; 2]; followed];
    for _ in 0..periods {
        for k in 0..strobe.steps() {
            strobe.step(&mut block, k);
            for i in 0..followed {
                let now = well(block.half_turns[i]);
                if now != last[i] {
                    let sense = (now - last[i]).signum();
                    // Over the top and back again at once is no turn; twice in one sense is.
                    if before[i] == Some(sense) {
                        turned[i][usize::from(sense > 0)] = true;
                    }
                    (before[i], last[i]) = (Some(sense), now);
                }
            }
        }
    }
    let restless = before.iter().zip(&turned).any(|(b, t)| b.is_some() && *t == [false; 2]);
    let backward = restless || turned.iter().any(|t| t[0]);
    let forward = restless || turned.iter().any(|t| t[1]);
    match (forward, backward) {
        (false, false) => (Kind::LibrationChaos, 0),
        (true, false) => (Kind::RotatingChaos, 1),
        (false, true) => (Kind::RotatingChaos, -1),
        (true, true) => (Kind::TumblingChaos, 0),
    }
}

/// The set whose region holds most of a trajectory's last points, if any does.
#[must_use]
pub fn member_of(sets: &[(usize, &Region)], points: &[State]) -> Option<usize> {
    let hits = |region: &Region| points.iter().filter(|p| region.contains(**p)).count();
    sets.iter()
        .map(|(index, region)| (hits(region), *index))
        .filter(|(hits, _)| *hits * 2 > points.len())
        .max_by_key(|(hits, index)| (*hits, std::cmp::Reverse(*index)))
        .map(|(_, index)| index)
}
