//! The search for attractors: from a set of starts to a catalogue with traps.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::attracting::Alike;
use super::capture::{self, Fate, Traps};
use super::catalogue::{Attractor, arrange};
use super::chaos::{ChaoticSet, KnownChaos};
use super::effort::Effort;
use super::near_returns::{escape_speed, near_returns};
use super::rest;
use super::trap::{self, Band, Ellipse, ellipses};
use crate::error::{Error, unless_cancelled};
use crate::integrate::{State, Strobe};
use crate::model::Pendulum;
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit};
use crate::orbit::rotation::{Rotation, running_states};
use crate::orbit::symmetry::Mirror;
use crate::progress::Progress;

/// Largest distance of Newton's method from the trajectory's state.
pub(super) const REACH: f64 = 0.3;
/// Periods between two reports of progress.
const STRETCH: u32 = 4096;
/// Most starts settle within this part of a search's bound: in which damping shrinks a free motion by `exp(-10)`.
const SETTLING: u32 = 5;

/// How a start of a search ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// No trap has captured it.
    Open(State),
    /// On the attractor with this [`Attractor::mark`].
    Captured([u64; 2]),
    /// Left the range of numbers, or accelerates without bound.
    Failed,
}

/// The results of a search; stored without what [`Catalogue::restored`] derives again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Catalogue {
    /// The attractors, sorted and named.
    #[serde(skip)]
    pub attractors: Vec<Attractor>,
    /// The trapping regions; indices are those of `attractors`.
    #[serde(skip)]
    pub traps: Traps,
    /// Longest time to capture in the searches, in periods.
    pub longest_settle: u32,
    /// What a search reports, in periods.
    #[serde(skip)]
    pub progress: Arc<Progress>,
    pub(super) effort: Effort,
    pub(super) orbits: Vec<(PeriodicOrbit, Vec<Ellipse>)>,
    /// Attracting orbits that no trap was found for: they are not tried again.
    #[serde(skip)]
    pub(super) untrapped: Vec<PeriodicOrbit>,
    pub(super) rotations: Vec<(Rotation, Option<Band>)>,
    pub(super) rests: Vec<f64>,
    /// Points of the orbits 1:0 where the pendulum may stand still, stable or not.
    standing: Vec<State>,
    pub(super) sets: Vec<ChaoticSet>,
    /// Extents of the starts from which short cycles have been sought.
    #[serde(skip)]
    pub(super) sought: State,
    #[serde(skip)]
    pub(super) known: Vec<KnownChaos>,
}

impl Catalogue {
    /// The attractors known without a search: rests, or the oscillations that a drive makes of them, and the
    /// running states of an undriven pendulum.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn new(strobe: &Strobe, effort: Effort, cancel: &AtomicBool) -> Result<Self, Error> {
        let map = effort.map(strobe);
        let standing = rest::standing(strobe, &map);
        let band = |r: Rotation| {
            let band = Band::around(strobe, &r.curve, 0, &standing);
            (r, band)
        };
        let rotations = running_states(&strobe.pendulum).into_iter().map(band).collect();
        let mut empty = Self {
            attractors: Vec::new(),
            traps: Traps::default(),
            longest_settle: 0,
            progress: Arc::default(),
            effort,
            orbits: Vec::new(),
            untrapped: Vec::new(),
            rotations,
            rests: rest::centres(&strobe.pendulum),
            standing,
            sets: Vec::new(),
            sought: [0.0; 2],
            known: Vec::new(),
        };
        empty.rebuild(&strobe.pendulum);
        if strobe.pendulum.is_dissipative() {
            let rests = rest::balances(&strobe.pendulum).map(|theta| (vec![[theta, 0.0]], 1));
            empty.take_over(strobe, &rests, cancel)?;
        }
        Ok(empty)
    }

    /// Takes over what an earlier search of the same pendulum has shown of its chaos: exponents, and that there
    /// are no other short cycles.
    pub fn take_over_chaos<'a>(&mut self, attractors: impl Iterator<Item = &'a Attractor>) {
        let known = |a: &Attractor| KnownChaos {
            kind: a.kind,
            sense: a.w,
            exponent: [a.exponent, a.exponent_stderr],
        };
        self.known.extend(attractors.filter(|a| a.kind.is_chaotic()).map(known));
        if !self.known.is_empty() {
            self.sought = [f64::INFINITY; 2];
        }
    }

    /// A stored catalogue, with its attractors and traps.
    #[must_use]
    pub fn restored(mut self, pendulum: &Pendulum) -> Self {
        self.rebuild(pendulum);
        self
    }

    /// The catalogue of a similar pendulum: the orbits that Newton's method from those of this one finds and
    /// that attract, and its quasi-periodic rotations, followed for three times `bound`; without its chaos.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn continued(
        &self,
        strobe: &Strobe,
        bound: u32,
        cancel: &AtomicBool,
    ) -> Result<Self, Error> {
        let mut next = Self::new(strobe, Effort::CONTINUED, cancel)?;
        let orbits: Vec<Alike> =
            self.orbits.iter().map(|(orbit, _)| (vec![orbit.points[0]], orbit.n)).collect();
        next.take_over(strobe, &orbits, cancel)?;
        next.take_over_curves(strobe, &self.sets, bound, cancel)?;
        if next.attractors.is_empty() {
            // Beside chaos with small basins Newton's method finds more orbits than the starts reach.
            next.effort.first_round = Effort::THOROUGH.first_round;
        }
        Ok(next)
    }

    /// Searches from `starts`; see [`Catalogue::endings`]. Returns whether anything new was found.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn search(
        &mut self,
        strobe: &Strobe,
        starts: &[State],
        bound: u32,
        cancel: &AtomicBool,
    ) -> Result<bool, Error> {
        let known = self.attractors.len();
        self.endings(strobe, starts, bound, cancel)?;
        Ok(self.attractors.len() > known)
    }

    /// Searches from `starts`: every trajectory runs until a known attractor captures it, it is
    /// found to close on a new one, or `bound` periods are over.
    ///
    /// The remaining trajectories are observed for a multiple of `bound` ([`Effort::observation`]). If
    /// none of a set of them has been captured by then and their exponent is positive, the set is a
    /// chaotic attractor; else they stay undecided. Returns how each start ended.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn endings(
        &mut self,
        strobe: &Strobe,
        starts: &[State],
        bound: u32,
        cancel: &AtomicBool,
    ) -> Result<Vec<Ending>, Error> {
        let mut endings: Vec<Ending> = starts.iter().map(|s| Ending::Open(*s)).collect();
        self.settle(strobe, &mut endings, bound, cancel)?;
        self.observe(strobe, &mut endings, bound, cancel)?;
        Ok(endings)
    }

    /// The first part of [`Catalogue::endings`]: the open ones run for `bound` periods; [`Catalogue::observe`] is
    /// the second.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn settle(
        &mut self,
        strobe: &Strobe,
        endings: &mut [Ending],
        bound: u32,
        cancel: &AtomicBool,
    ) -> Result<(), Error> {
        let is_open = |e: &Ending| matches!(e, Ending::Open(_));
        let mut alive = endings.iter().any(is_open);
        if !strobe.pendulum.is_dissipative() {
            return Ok(());
        }
        let map = self.effort.map(strobe);
        let fastest = escape_speed(&strobe.pendulum);
        let (mut elapsed, mut round) = (0, self.effort.first_round);
        while elapsed < bound && alive {
            let length = round.min(bound - elapsed);
            self.run(strobe, endings, length, elapsed, bound, cancel)?;
            for ending in endings.iter_mut() {
                if matches!(ending, Ending::Open(state) if state[1].abs() > fastest) {
                    *ending = Ending::Failed;
                }
            }
            elapsed += length;
            round *= 2;
            let free = open(endings);
            if self.find_cycles(strobe, &map, &free, cancel)? {
                // Trajectories within the new traps are captured at once.
                self.run(strobe, endings, self.effort.first_round, elapsed, bound, cancel)?;
            }
            alive = endings.iter().any(is_open);
        }
        Ok(())
    }

    /// Advances the open ones of `endings` by `length` periods, after `elapsed` of `bound`.
    fn run(
        &mut self,
        strobe: &Strobe,
        endings: &mut [Ending],
        length: u32,
        elapsed: u32,
        bound: u32,
        cancel: &AtomicBool,
    ) -> Result<(), Error> {
        for begin in (0..length).step_by(STRETCH as usize) {
            let (alive, part) = (open(endings), STRETCH.min(length - begin));
            let outcomes = capture::outcomes(strobe, &self.traps, part, &alive, cancel)?;
            let free = endings.iter_mut().filter(|e| matches!(e, Ending::Open(_)));
            for (ending, outcome) in free.zip(outcomes) {
                if matches!(outcome.fate, Fate::Captured(_)) {
                    let settled = elapsed + begin + outcome.periods;
                    self.longest_settle = self.longest_settle.max(settled);
                }
                *ending = self.ending(outcome.fate, outcome.state);
            }
            self.report(endings, elapsed + begin + part, bound);
        }
        Ok(())
    }

    /// Reports a search `elapsed` periods after its beginning. Most starts settle within a part of `bound`: the time
    /// of that part is told first.
    fn report(&self, endings: &[Ending], elapsed: u32, bound: u32) {
        let soon = bound / SETTLING;
        let [from, to] = if elapsed <= soon { [0, soon] } else { [soon, bound.max(elapsed)] };
        let all = (to - from) as usize * endings.len();
        self.progress.show(all - (to - elapsed) as usize * open(endings).len(), all);
    }

    /// How a start of this fate has ended.
    pub(super) fn ending(&self, fate: Fate, state: State) -> Ending {
        match fate {
            Fate::Open => Ending::Open(state),
            Fate::Captured(attractor) => Ending::Captured(self.attractors[attractor].mark()),
            Fate::Failed => Ending::Failed,
        }
    }

    /// Tests the trajectories for convergence to cycles; returns whether a new one was found.
    ///
    /// The closest returns are tried first, a few at a time: those that have converged come before the
    /// chance returns of chaos, which end the trials.
    pub(super) fn find_cycles(
        &mut self,
        strobe: &Strobe,
        map: &PoincareMap,
        alive: &[State],
        cancel: &AtomicBool,
    ) -> Result<bool, Error> {
        let mut returns = near_returns(strobe, alive, self.effort.longest_cycle);
        let steps = PoincareMap::of_steps(strobe);
        let known = self.orbits.len();
        let mut found: Vec<Ellipse> = Vec::new();
        while !returns.is_empty() {
            unless_cancelled(cancel)?;
            let rest = returns.split_off(returns.len().min(self.effort.tries));
            let tried: Vec<_> = returns.iter().map(|(_, start, n)| (*start, *n)).collect();
            let mut traps = Vec::new();
            for orbit in newton::find_others(&steps, &tried, REACH, &[]) {
                if let Some(orbit) = self.refined(strobe, map, orbit) {
                    traps.extend(self.admit(strobe, map, orbit, cancel)?);
                }
            }
            if traps.is_empty() {
                break;
            }
            found.extend(traps);
            let held = |e: &Ellipse, start: State| {
                e.height([strobe.angle.wrapped(start[0]), start[1]]) < 1.0
            };
            returns = rest;
            returns.retain(|(_, start, _)| !found.iter().any(|e| held(e, *start)));
        }
        if self.orbits.len() > known {
            self.rebuild(&strobe.pendulum);
        }
        Ok(!found.is_empty())
    }

    /// Accepts an orbit and its mirror image if they can be trapped, and returns their traps.
    pub(super) fn admit(
        &mut self,
        strobe: &Strobe,
        map: &PoincareMap,
        orbit: PeriodicOrbit,
        cancel: &AtomicBool,
    ) -> Result<Vec<Ellipse>, Error> {
        let own = ellipses(strobe, &orbit, &self.effort.trap, cancel)?;
        // An orbit without a trap exists all the same: a brisk search lists it, and assigns
        // trajectories near it by Newton's method.
        if own.is_empty() && self.effort.precise {
            self.untrapped.push(orbit);
            return Ok(own);
        }
        let mut traps = own.clone();
        let image = Mirror::of(&strobe.pendulum).and_then(|mirror| mirror.orbit(map, &orbit));
        if let Some((image, moved)) = image.filter(|(i, _)| !orbit.is_same(i)) {
            let twins = match moved {
                Some(moved) => trap::mirrored(&own, moved),
                None => ellipses(strobe, &image, &self.effort.trap, cancel)?,
            };
            traps.extend(&twins);
            self.orbits.push((image, twins));
        }
        self.orbits.push((orbit, own));
        Ok(traps)
    }

    /// Rebuilds attractors and traps from orbits, rotations and sets.
    pub(super) fn rebuild(&mut self, pendulum: &Pendulum) {
        let mut all: Vec<Attractor> =
            self.orbits.iter().map(|(o, _)| Attractor::periodic(pendulum, o)).collect();
        all.extend(self.rotations.iter().map(|(r, _)| Attractor::running(r)));
        all.extend(self.rests.iter().map(|theta| Attractor::resting(pendulum.angle(), *theta)));
        all.extend(self.sets.iter().map(Attractor::sampled));
        let (attractors, place) = arrange(pendulum, all);
        let mut traps = Traps::default();
        traps.rests.angle = pendulum.angle();
        let mut place = place.into_iter();
        for ((_, ellipses), at) in self.orbits.iter().zip(place.by_ref()) {
            traps.ellipses.extend(ellipses.iter().map(|e| Ellipse { attractor: at, ..*e }));
        }
        for ((_, band), at) in self.rotations.iter().zip(place.by_ref()) {
            traps.bands.extend(band.iter().map(|b| Band { attractor: at, ..b.clone() }));
        }
        for (theta, at) in self.rests.iter().zip(place.by_ref()) {
            traps.rests.sets.insert(traps.rests.angle.half_turn(*theta), at);
        }
        for (set, at) in self.sets.iter().zip(place) {
            traps.bands.extend(set.band.iter().map(|b| Band { attractor: at, ..b.clone() }));
        }
        // A trap ends short of what was found after it, and of orbits that do not attract.
        let others = |at: usize| {
            let single = |a: &Attractor| a.n.is_some() && !a.is_running();
            let others = attractors.iter().enumerate().filter(move |(i, a)| *i != at && single(a));
            others.flat_map(|(_, a)| &a.points).chain(&self.standing)
        };
        for ellipse in &mut traps.ellipses {
            others(ellipse.attractor).for_each(|state| ellipse.end_short_of(*state));
        }
        for band in &mut traps.bands {
            others(band.attractor).for_each(|state| band.end_short_of(*state));
        }
        self.attractors = attractors;
        self.traps = traps;
    }
}

/// The states of uncaptured trajectories.
pub(super) fn open(endings: &[Ending]) -> Vec<State> {
    let state = |ending: &Ending| match ending {
        Ending::Open(state) => Some(*state),
        _ => None,
    };
    endings.iter().filter_map(state).collect()
}
