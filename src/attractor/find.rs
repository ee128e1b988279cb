//! The search for attractors: from a set of starts to a catalogue with traps.

use std::sync::atomic::{AtomicBool, Ordering};

use super::capture::{self, Fate, Traps};
use super::catalogue::{Attractor, arrange};
use super::chaos::{self, ChaoticSet, Region};
use super::kind::Kind;
use super::rest;
use super::trap::{self, Band, Ellipse, ellipses};
use crate::integrate::accuracy::{distance, wrapped};
use crate::integrate::{State, Strobe};
use crate::model::effects::Action;
use crate::model::{Effect, Pendulum};
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit};
use crate::orbit::rotation::{Rotation, running_states};

/// Longest cycle that is looked for, in forcing periods.
pub const LONGEST_CYCLE: usize = 32;
/// Stroboscopic points that come back this near are taken to Newton's method.
const NEAR: f64 = 0.03;
/// Newton's method may not wander further than this from where the trajectory was.
const REACH: f64 = 0.3;
/// Failures of Newton's method after which a round gives up.
const TRIES: usize = 24;
/// Periods before the first cycle test; each later round is twice as long as the one before.
const FIRST_ROUND: u32 = 32;
/// Trajectories that nothing has captured are watched for this many times the first bound more.
pub const WATCH: u32 = 4;
/// Damping must shrink a motion by this power of e, were it not driven, before what is left can be
/// called chaos.
const LEAST_DECAY: f64 = 20.0;
/// So many times faster than the drive and gravity no resonance with either can hold a rotation.
const ESCAPE: f64 = 10.0;
/// Of the trajectories left over, so many are watched.
const WATCHED: usize = 256;

/// What a search has found so far.
#[derive(Clone, Debug)]
pub struct Catalogue {
    /// The attractors, sorted and named.
    pub attractors: Vec<Attractor>,
    /// The regions that capture; indices are those of `attractors`.
    pub traps: Traps,
    /// Regions of the attractors that have no trap: index and cells.
    pub regions: Vec<(usize, Region)>,
    /// Longest time to capture that the searches saw, in periods.
    pub longest_settle: u32,
    orbits: Vec<(PeriodicOrbit, Vec<Ellipse>)>,
    rotations: Vec<(Rotation, Option<Band>)>,
    rests: Vec<f64>,
    sets: Vec<ChaoticSet>,
}

impl Catalogue {
    /// What is known without a search: the running states of an undriven pendulum.
    #[must_use]
    pub fn new(strobe: &Strobe) -> Self {
        let band = |r: &Rotation| Band::around(strobe, &r.curve, 0);
        let rotations = running_states(&strobe.pendulum);
        let mut empty = Self {
            attractors: Vec::new(),
            traps: Traps::default(),
            regions: Vec::new(),
            longest_settle: 0,
            orbits: Vec::new(),
            rotations: rotations.into_iter().map(|r| (r.clone(), band(&r))).collect(),
            rests: rest::centres(&strobe.pendulum),
            sets: Vec::new(),
        };
        empty.rebuild(&strobe.pendulum);
        empty
    }

    /// Searches from `starts`: every trajectory runs until a known attractor captures it, it is
    /// found to close on a new one, or `bound` periods are over.
    ///
    /// Those left over are watched for four times as long again. If then still none of a
    /// set of them has been captured and their exponent is positive, the set is a chaotic attractor;
    /// else they stay undecided. Returns whether anything new was found.
    pub fn search(
        &mut self,
        strobe: &Strobe,
        starts: &[State],
        bound: u32,
        cancel: &AtomicBool,
    ) -> bool {
        if !strobe.pendulum.is_dissipative() {
            return false;
        }
        let known = self.attractors.len();
        let map = PoincareMap::new(&strobe.pendulum);
        let mut alive: Vec<State> = starts.to_vec();
        let fastest = escape_speed(&strobe.pendulum);
        let (mut elapsed, mut round) = (0, FIRST_ROUND);
        while elapsed < bound && !alive.is_empty() && !cancel.load(Ordering::Relaxed) {
            let length = round.min(bound - elapsed);
            alive = self.run(strobe, &alive, length, elapsed, cancel);
            alive.retain(|state| state[1].abs() <= fastest);
            elapsed += length;
            round *= 2;
            if self.find_cycles(strobe, &map, &alive, cancel) {
                // What the new traps hold is captured at once.
                alive = self.run(strobe, &alive, FIRST_ROUND, elapsed, cancel);
            }
        }
        if !alive.is_empty() && !cancel.load(Ordering::Relaxed) {
            self.watch(strobe, &alive, bound, cancel);
        }
        self.attractors.len() > known
    }

    /// Advances `alive` by `length` periods; those still free come back.
    fn run(
        &mut self,
        strobe: &Strobe,
        alive: &[State],
        length: u32,
        elapsed: u32,
        cancel: &AtomicBool,
    ) -> Vec<State> {
        let outcomes =
            capture::outcomes(strobe, &self.traps, length, alive, cancel).unwrap_or_default();
        let mut free = Vec::new();
        for outcome in outcomes {
            match outcome.fate {
                Fate::Open => free.push(outcome.state),
                Fate::Captured(_) => {
                    self.longest_settle = self.longest_settle.max(elapsed + outcome.periods);
                }
                Fate::Failed => {}
            }
        }
        free
    }

    /// Looks for cycles that the trajectories close in on; whether a new one was found.
    ///
    /// The closest returns are tried first: those that have converged come before the chance
    /// returns of chaos, of which only a few are tried.
    fn find_cycles(
        &mut self,
        strobe: &Strobe,
        map: &PoincareMap,
        alive: &[State],
        cancel: &AtomicBool,
    ) -> bool {
        let mut returns: Vec<(f64, State, usize)> = Vec::new();
        for track in tracks(strobe, alive) {
            if strobe.friction && track.iter().all(|state| state[1] == 0.0) {
                // Held at every period's end: no orbit, and every n would fit.
                continue;
            }
            let near = (1..=LONGEST_CYCLE)
                .map(|n| (distance(track[n], track[0]), track[0], n))
                .filter(|r| r.0 < NEAR);
            returns.extend(near);
        }
        returns.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        let (mut found, mut tries) = (Vec::new(), 0);
        for (_, start, n) in returns {
            let held = |e: &Ellipse| e.height([wrapped(start[0]), start[1]]) < 1.0;
            if tries == TRIES || cancel.load(Ordering::Relaxed) {
                break;
            }
            if found.iter().any(held) {
                continue;
            }
            tries += 1;
            let Some(orbit) = newton::find(map, start, n, REACH) else { continue };
            let held = |p: &State| p[1] == 0.0 && strobe.equation.holds_for_ever(p[0]);
            if !orbit.is_stable()
                || (strobe.friction && orbit.points.iter().any(held))
                || self.orbits.iter().any(|(o, _)| o.contains(orbit.points[0], 1e-6))
            {
                continue;
            }
            let traps = self.admit(strobe, orbit, cancel);
            if !traps.is_empty() {
                tries = 0;
            }
            found.extend(traps);
        }
        if !found.is_empty() {
            self.rebuild(&strobe.pendulum);
        }
        !found.is_empty()
    }

    /// Takes an orbit and its mirror image, if they can be trapped, and returns their traps.
    fn admit(
        &mut self,
        strobe: &Strobe,
        orbit: PeriodicOrbit,
        cancel: &AtomicBool,
    ) -> Vec<Ellipse> {
        let own = ellipses(strobe, &orbit, cancel);
        if own.is_empty() {
            return own;
        }
        let mut traps = own.clone();
        let (image, moved) = orbit.mirrored();
        let symmetric = strobe.pendulum.is_mirror_symmetric();
        if symmetric && !orbit.contains(image.points[0], 1e-6) {
            let twins = trap::mirrored(&own, moved);
            traps.extend(&twins);
            self.orbits.push((image, twins));
        }
        self.orbits.push((orbit, own));
        traps
    }

    /// Decides what the trajectories that nothing captured are.
    fn watch(&mut self, strobe: &Strobe, alive: &[State], bound: u32, cancel: &AtomicBool) {
        let stride = alive.len().div_ceil(WATCHED);
        let sample: Vec<State> = alive.iter().step_by(stride).copied().collect();
        let length = WATCH * bound;
        // Nearly conservative motion takes longer than this to show where it ends.
        let watched = strobe.pendulum.period() * f64::from(bound + length);
        if strobe.pendulum.damping_rate() * watched < LEAST_DECAY {
            return;
        }
        let Some(outcomes) = capture::outcomes(strobe, &self.traps, length, &sample, cancel) else {
            return;
        };
        let lost: Vec<bool> = outcomes.iter().map(|o| !matches!(o.fate, Fate::Open)).collect();
        if lost.iter().all(|l| *l) {
            return;
        }
        let new: Vec<ChaoticSet> = chaos::sets(strobe, &sample, &lost, length as usize, cancel)
            .into_iter()
            .filter(|new| !self.sets.iter().any(|old| old.same_as(new)))
            .collect();
        if !new.is_empty() {
            self.sets.extend(new);
            self.rebuild(&strobe.pendulum);
        }
    }

    /// Attractors, traps and regions anew from orbits, rotations and sets.
    fn rebuild(&mut self, pendulum: &Pendulum) {
        let mut all: Vec<Attractor> =
            self.orbits.iter().map(|(o, _)| Attractor::periodic(pendulum, o)).collect();
        all.extend(self.rotations.iter().map(|(r, _)| Attractor::running(r)));
        all.extend(self.rests.iter().map(|theta| Attractor::resting(*theta)));
        all.extend(self.sets.iter().map(Attractor::sampled));
        let (attractors, place) = arrange(pendulum, all);
        let mut traps = Traps::default();
        let mut regions = Vec::new();
        let mut place = place.into_iter();
        for ((_, ellipses), at) in self.orbits.iter().zip(place.by_ref()) {
            traps.ellipses.extend(ellipses.iter().map(|e| Ellipse { attractor: at, ..*e }));
        }
        for ((_, band), at) in self.rotations.iter().zip(place.by_ref()) {
            traps.bands.extend(band.iter().map(|b| Band { attractor: at, ..b.clone() }));
        }
        for (theta, at) in self.rests.iter().zip(place.by_ref()) {
            traps.rests.0[usize::from(theta.cos() < 0.0)] = Some(at);
        }
        for (set, at) in self.sets.iter().zip(place) {
            match &set.band {
                Some(band) => traps.bands.push(Band { attractor: at, ..band.clone() }),
                None => regions.push((at, set.region.clone())),
            }
        }
        self.attractors = attractors;
        self.traps = traps;
        self.regions = regions;
    }

    /// The index of the one chaotic attractor, if there is no other attractor at all.
    #[must_use]
    pub fn only_chaos(&self) -> Option<usize> {
        match self.attractors.as_slice() {
            [one] if one.kind.is_chaotic() => Some(0),
            _ => None,
        }
    }

    /// Whether some attractor can be told only by where its trajectories stay.
    #[must_use]
    pub fn has_chaos(&self) -> bool {
        self.attractors.iter().any(|a| a.kind.is_chaotic())
    }

    /// The attractor without trap in whose region a trajectory's last points lie.
    #[must_use]
    pub fn region_of(&self, points: &[State]) -> Option<usize> {
        let regions: Vec<(usize, &Region)> = self.regions.iter().map(|(i, r)| (*i, r)).collect();
        chaos::member_of(&regions, points)
    }
}

impl ChaoticSet {
    fn same_as(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.sense == other.sense
            && (self.kind == Kind::QuasiperiodicRotation || self.region.meets(&other.region))
    }
}

/// The speed at which nothing holds a rotation back any more: where the torque is greater than all
/// friction and nothing grows with the velocity, faster motions gain speed for ever. Infinite
/// otherwise.
fn escape_speed(pendulum: &Pendulum) -> f64 {
    let constant = |e: &Effect| {
        !e.is(&[Action::Velocity, Action::Kinked, Action::SlidingFriction, Action::LoadedFriction])
    };
    let held = pendulum.gamma > 0.0
        || !pendulum.effects.iter().all(constant)
        || pendulum.torque.abs() <= pendulum.equation().hold(0.0);
    if held {
        return f64::INFINITY;
    }
    ESCAPE * (pendulum.motion().omega + pendulum.greatest_pull().sqrt())
}

/// The next stroboscopic points of each trajectory, its own first.
fn tracks(strobe: &Strobe, states: &[State]) -> Vec<Vec<State>> {
    let mut theta: Vec<f64> = states.iter().map(|s| s[0]).collect();
    let mut velocity: Vec<f64> = states.iter().map(|s| s[1]).collect();
    let mut turns = vec![0.0; states.len()];
    let mut tracks: Vec<Vec<State>> = states.iter().map(|s| vec![*s]).collect();
    for _ in 0..LONGEST_CYCLE {
        // Lengths agree, so this cannot fail.
        let _ = strobe.advance(&mut theta, &mut velocity, &mut turns, 1);
        for (track, (a, b)) in tracks.iter_mut().zip(theta.iter().zip(&velocity)) {
            track.push([*a, *b]);
        }
    }
    tracks
}
