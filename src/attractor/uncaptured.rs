//! Uncaptured trajectories: chaotic, or not yet settled.

use std::sync::atomic::AtomicBool;

use super::capture::{self, Fate};
use super::chaos::{self, ChaoticSet, spread};
use super::find::{Catalogue, Ending, open};
use super::kind::Kind;
use crate::integrate::{State, Strobe};

/// Power of e by which damping must shrink a free motion before uncaptured trajectories can be
/// classified as chaotic.
const LEAST_DECAY: f64 = 20.0;

/// Trajectories that are observed between two reports of progress.
const OBSERVED: usize = 64;

/// Observation of chaos that another attractor could end: trajectories, and periods of each. A transient
/// ends at a constant rate, so that only their product counts.
const STAYING: (usize, u32) = (32, 2500);

impl Catalogue {
    /// Decides which trajectories uncaptured after `bound` periods are chaotic.
    ///
    /// Observed trajectories are set to their final states.
    pub fn watch(
        &mut self,
        strobe: &Strobe,
        endings: &mut [Ending],
        bound: u32,
        cancel: &AtomicBool,
    ) {
        let free: Vec<(usize, State)> = endings
            .iter()
            .enumerate()
            .filter_map(|(k, end)| if let Ending::Open(s) = end { Some((k, *s)) } else { None })
            .collect();
        let alone = self.attractors.iter().all(|a| a.kind.is_chaotic());
        let most = if alone { self.effort.watched_alone } else { self.effort.watched };
        let stride = free.len().div_ceil(most).max(1);
        let (places, sample): (Vec<usize>, Vec<State>) = free.into_iter().step_by(stride).unzip();
        let length = self.effort.watch * bound;
        // Nearly conservative motion takes longer than this to show where it ends.
        let watched = strobe.pendulum.period() * f64::from(bound + length);
        if sample.is_empty() || strobe.pendulum.damping_rate() * watched < LEAST_DECAY {
            return;
        }
        let mut runs = Vec::with_capacity(sample.len());
        for part in sample.chunks(OBSERVED) {
            let all = sample.len() * length as usize;
            self.progress.show(runs.len() * length as usize, all);
            let observed = chaos::observed(strobe, &self.traps, part, length, &self.effort, cancel);
            let Some(observed) = observed else { return };
            runs.extend(observed);
        }
        for (place, run) in places.into_iter().zip(&runs) {
            endings[place] = self.ending(run.fate, run.state);
        }
        if runs.iter().all(|run| run.fate != Fate::Open) {
            return;
        }
        if self.find_cycles(strobe, &self.effort.map(strobe), &open(endings), cancel) {
            // They have settled by now.
            return self.watch(strobe, endings, bound, cancel);
        }
        let new: Vec<ChaoticSet> =
            chaos::sets(strobe, &self.traps, &self.known, runs, length, &self.effort, cancel)
                .into_iter()
                .filter(|new| !self.sets.iter().any(|old| old.same_as(new)))
                .collect();
        if new.is_empty() {
            return;
        }
        let points: Vec<State> = new.iter().flat_map(|set| set.points.iter().copied()).collect();
        if self.find_short_cycles(strobe, &points, cancel) {
            // A trajectory classified as chaotic may end there.
            return self.watch(strobe, endings, bound, cancel);
        }
        let symmetric = strobe.pendulum.is_mirror_symmetric();
        for set in new {
            if self.sets.iter().any(|old| old.same_as(&set))
                || !self.stays(strobe, &set, length, cancel)
            {
                continue;
            }
            let image = set.mirrored();
            if symmetric && !set.same_as(&image) {
                self.sets.push(image);
            }
            self.sets.push(set);
        }
        self.rebuild(&strobe.pendulum);
    }

    /// Quasi-periodic rotations among the sets of a similar pendulum: runs from their points, observed for twice
    /// `bound` after it.
    pub(super) fn take_over_curves(
        &mut self,
        strobe: &Strobe,
        known: &[ChaoticSet],
        bound: u32,
        cancel: &AtomicBool,
    ) {
        for old in known.iter().filter(|set| set.band.is_some()) {
            let starts = spread(&old.points, self.effort.proved);
            let settled = capture::outcomes(strobe, &self.traps, bound, &starts, cancel);
            let ends: Vec<State> = settled.iter().flatten().map(|o| o.state).collect();
            let open = settled.is_some_and(|all| all.iter().all(|o| o.fate == Fate::Open));
            if !open {
                continue;
            }
            let (traps, effort) = (&self.traps, &self.effort);
            let runs = chaos::observed(strobe, traps, &ends, 2 * bound, effort, cancel);
            let found = chaos::sets(
                strobe,
                traps,
                &[],
                runs.unwrap_or_default(),
                2 * bound,
                effort,
                cancel,
            );
            let new = |set: &ChaoticSet| {
                set.band.is_some() && !self.sets.iter().any(|other| other.same_as(set))
            };
            let new: Vec<ChaoticSet> = found.into_iter().filter(new).collect();
            self.sets.extend(new);
            self.rebuild(&strobe.pendulum);
        }
    }

    /// Whether an apparent chaotic attractor coexisting with another one is not a transient to it.
    ///
    /// Such transients are long: [`STAYING`] trajectories are observed from points of the set, or until one
    /// ends.
    fn stays(&self, strobe: &Strobe, set: &ChaoticSet, length: u32, cancel: &AtomicBool) -> bool {
        if self.attractors.iter().all(|a| a.kind.is_chaotic()) || set.band.is_some() {
            return true;
        }
        let (count, periods) = STAYING;
        let mut points = spread(&set.points, count);
        let (mut over, mut part) = (0, length.min(periods));
        while over < periods {
            let found = capture::outcomes(strobe, &self.traps, part, &points, cancel);
            let Some(outcomes) = found.filter(|all| all.iter().all(|o| o.fate == Fate::Open))
            else {
                return false;
            };
            points = outcomes.iter().map(|o| o.state).collect();
            over += part;
            part = over.min(periods - over);
        }
        true
    }
}

impl ChaoticSet {
    fn same_as(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.sense == other.sense
            && (self.kind == Kind::QuasiperiodicRotation || self.region.meets(&other.region))
    }
}
