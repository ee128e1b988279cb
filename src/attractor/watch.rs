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
    fn stays(&self, strobe: &Strobe, set: &ChaoticSet, length: u32, cancel: &AtomicBool) -> bool {
        let proved = self.effort.proved;
        if set.members >= proved || set.band.is_some() {
            return true;
        }
        let stride = set.points.len().div_ceil(proved).max(1);
        let points: Vec<State> = set.points.iter().step_by(stride).copied().collect();
        capture::outcomes(strobe, &self.traps, length, &points, cancel)
            .is_some_and(|outcomes| outcomes.iter().all(|o| matches!(o.fate, Fate::Open)))
    }
}

impl ChaoticSet {
    fn same_as(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.sense == other.sense
            && (self.kind == Kind::QuasiperiodicRotation || self.region.meets(&other.region))
    }
}
