//! What the trajectories are that nothing has captured: chaos, or not yet settled.

use std::sync::atomic::AtomicBool;

use super::capture::{self, Fate};
use super::chaos::{self, ChaoticSet};
use super::find::Catalogue;
use super::kind::Kind;
use crate::integrate::{State, Strobe};

/// Damping must shrink a motion by this power of e, were it not driven, before what is left can be
/// called chaos.
const LEAST_DECAY: f64 = 20.0;

/// Periods for which chaos is watched where friction could end it.
const LONG: u32 = 5000;

impl Catalogue {
    /// Decides what the trajectories that nothing captured are.
    pub(super) fn watch(
        &mut self,
        strobe: &Strobe,
        alive: &[State],
        bound: u32,
        cancel: &AtomicBool,
    ) {
        let stride = alive.len().div_ceil(self.effort.watched);
        let sample: Vec<State> = alive.iter().step_by(stride).copied().collect();
        let length = self.effort.watch * bound;
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
        let new: Vec<ChaoticSet> =
            chaos::sets(strobe, &sample, &lost, length as usize, &self.effort, cancel)
                .into_iter()
                .filter(|new| !self.sets.iter().any(|old| old.same_as(new)))
                .filter(|new| self.stays(strobe, new, length, cancel))
                .collect();
        if !new.is_empty() {
            self.sets.extend(new);
            self.rebuild(&strobe.pendulum);
        }
    }

    /// Whether a set of few trajectories is more than a transient that happens to last.
    ///
    /// Where friction holds rest for ever, chaos that stops once is over, and such transients are long:
    /// they are watched for [`LONG`] periods, or until one ends.
    fn stays(&self, strobe: &Strobe, set: &ChaoticSet, length: u32, cancel: &AtomicBool) -> bool {
        let proved = self.effort.proved;
        if proved == 0 || set.band.is_some() {
            return true;
        }
        let holds = !self.rests.is_empty();
        if set.members >= proved && !holds {
            return true;
        }
        let stride = set.points.len().div_ceil(proved).max(1);
        let mut points: Vec<State> = set.points.iter().step_by(stride).copied().collect();
        let (mut over, mut part) = (0, length);
        loop {
            let found = capture::outcomes(strobe, &self.traps, part, &points, cancel);
            let Some(outcomes) = found.filter(|all| all.iter().all(|o| o.fate == Fate::Open))
            else {
                return false;
            };
            over += part;
            if !holds || over >= LONG {
                return true;
            }
            points = outcomes.iter().map(|o| o.state).collect();
            part = over.min(LONG - over);
        }
    }
}

impl ChaoticSet {
    fn same_as(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.sense == other.sense
            && (self.kind == Kind::QuasiperiodicRotation || self.region.meets(&other.region))
    }
}
