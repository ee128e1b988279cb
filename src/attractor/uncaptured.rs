//! Uncaptured trajectories: chaotic, or not yet settled.

use std::sync::atomic::AtomicBool;

use super::capture::{self, Fate};
use super::chaos::{self, ChaoticSet, spread};
use super::find::{Catalogue, Ending, open};
use super::kind::Kind;
use crate::error::Error;
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
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn observe(
        &mut self,
        strobe: &Strobe,
        endings: &mut [Ending],
        bound: u32,
        cancel: &AtomicBool,
    ) -> Result<(), Error> {
        let free: Vec<(usize, State)> = endings
            .iter()
            .enumerate()
            .filter_map(|(k, end)| if let Ending::Open(s) = end { Some((k, *s)) } else { None })
            .collect();
        let alone = self.attractors.iter().all(|a| a.kind.is_chaotic());
        let most = if alone { self.effort.observed_alone } else { self.effort.observed };
        let stride = free.len().div_ceil(most).max(1);
        let (places, sample): (Vec<usize>, Vec<State>) = free.into_iter().step_by(stride).unzip();
        let length = self.effort.observation * bound;
        // Nearly conservative motion takes longer than this to show where it ends.
        let duration = strobe.pendulum.period() * f64::from(bound + length);
        if sample.is_empty() || strobe.pendulum.damping_rate() * duration < LEAST_DECAY {
            return Ok(());
        }
        let mut runs = Vec::with_capacity(sample.len());
        for part in sample.chunks(OBSERVED) {
            let all = sample.len() * length as usize;
            self.progress.show(runs.len() * length as usize, all);
            let (traps, effort) = (&self.traps, &self.effort);
            runs.extend(chaos::observed(strobe, traps, part, length, effort, cancel)?);
        }
        for (place, run) in places.into_iter().zip(&runs) {
            endings[place] = self.ending(run.fate, run.state);
        }
        if runs.iter().all(|run| run.fate != Fate::Open) {
            return Ok(());
        }
        if self.find_cycles(strobe, &self.effort.map(strobe), &open(endings), cancel)? {
            // They have settled by now.
            return self.observe(strobe, endings, bound, cancel);
        }
        let new: Vec<ChaoticSet> =
            chaos::sets(strobe, &self.traps, &self.known, runs, length, &self.effort, cancel)?
                .into_iter()
                .filter(|new| !self.sets.iter().any(|old| old.same_as(new)))
                .collect();
        if new.is_empty() {
            return Ok(());
        }
        let points: Vec<State> = new.iter().flat_map(|set| set.points.iter().copied()).collect();
        if self.find_short_cycles(strobe, &points, cancel)? {
            // A trajectory classified as chaotic may end there.
            return self.observe(strobe, endings, bound, cancel);
        }
        let symmetric = strobe.pendulum.is_mirror_symmetric();
        for set in new {
            if self.sets.iter().any(|old| old.same_as(&set))
                || !self.stays(strobe, &set, length, cancel)?
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
        Ok(())
    }

    /// Quasi-periodic rotations among the sets of a similar pendulum: runs from their points, observed for twice
    /// `bound` after it.
    pub(super) fn take_over_curves(
        &mut self,
        strobe: &Strobe,
        known: &[ChaoticSet],
        bound: u32,
        cancel: &AtomicBool,
    ) -> Result<(), Error> {
        for old in known.iter().filter(|set| set.band.is_some()) {
            let starts = spread(&old.points, self.effort.proved);
            let settled = capture::outcomes(strobe, &self.traps, bound, &starts, cancel)?;
            if settled.iter().any(|o| o.fate != Fate::Open) {
                continue;
            }
            let ends: Vec<State> = settled.iter().map(|o| o.state).collect();
            let (traps, effort) = (&self.traps, &self.effort);
            let runs = chaos::observed(strobe, traps, &ends, 2 * bound, effort, cancel)?;
            let found = chaos::sets(strobe, traps, &[], runs, 2 * bound, effort, cancel)?;
            let new = |set: &ChaoticSet| {
                set.band.is_some() && !self.sets.iter().any(|other| other.same_as(set))
            };
            let new: Vec<ChaoticSet> = found.into_iter().filter(new).collect();
            self.sets.extend(new);
            self.rebuild(&strobe.pendulum);
        }
        Ok(())
    }

    /// Whether an apparent chaotic attractor coexisting with another one is not a transient to it.
    ///
    /// Such transients are long: [`STAYING`] trajectories are observed from points of the set, or until one
    /// ends.
    fn stays(
        &self,
        strobe: &Strobe,
        set: &ChaoticSet,
        length: u32,
        cancel: &AtomicBool,
    ) -> Result<bool, Error> {
        if self.attractors.iter().all(|a| a.kind.is_chaotic()) || set.band.is_some() {
            return Ok(true);
        }
        let (count, periods) = STAYING;
        let mut points = spread(&set.points, count);
        let (mut over, mut part) = (0, length.min(periods));
        while over < periods {
            let outcomes = capture::outcomes(strobe, &self.traps, part, &points, cancel)?;
            if outcomes.iter().any(|o| o.fate != Fate::Open) {
                return Ok(false);
            }
            points = outcomes.iter().map(|o| o.state).collect();
            over += part;
            part = over.min(periods - over);
        }
        Ok(true)
    }
}

impl ChaoticSet {
    fn same_as(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.sense == other.sense
            && (self.kind == Kind::QuasiperiodicRotation || self.region.meets(&other.region))
    }
}
