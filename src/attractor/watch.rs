//! What the trajectories are that nothing has captured: chaos, or not yet settled.

use std::sync::atomic::AtomicBool;

use super::capture::{self, Fate};
use super::chaos::{self, ChaoticSet, spread};
use super::find::{Catalogue, Ending};
use super::kind::Kind;
use crate::integrate::{State, Strobe};

/// Damping must shrink a motion by this power of e, were it not driven, before what is left can be
/// called chaos.
const LEAST_DECAY: f64 = 20.0;

/// Periods for which chaos is watched where friction could end it.
const LONG: u32 = 5000;

impl Catalogue {
    /// Decides what the trajectories that nothing captured are.
    ///
    /// Those that are watched end where that takes them.
    pub(super) fn watch(
        &mut self,
        strobe: &Strobe,
        endings: &mut [Ending],
        bound: u32,
        cancel: &AtomicBool,
    ) {
        let open: Vec<(usize, State)> = endings
            .iter()
            .enumerate()
            .filter_map(|(k, end)| if let Ending::Open(s) = end { Some((k, *s)) } else { None })
            .collect();
        let stride = open.len().div_ceil(self.effort.watched).max(1);
        let (places, sample): (Vec<usize>, Vec<State>) = open.into_iter().step_by(stride).unzip();
        let length = self.effort.watch * bound;
        // Nearly conservative motion takes longer than this to show where it ends.
        let watched = strobe.pendulum.period() * f64::from(bound + length);
        if sample.is_empty() || strobe.pendulum.damping_rate() * watched < LEAST_DECAY {
            return;
        }
        let Some(outcomes) = capture::outcomes(strobe, &self.traps, length, &sample, cancel) else {
            return;
        };
        for (place, outcome) in places.into_iter().zip(&outcomes) {
            endings[place] = self.ending(outcome);
        }
        if outcomes.iter().all(|o| o.fate != Fate::Open) {
            return;
        }
        let captured: Vec<Option<u32>> =
            outcomes.iter().map(|o| (o.fate != Fate::Open).then_some(o.periods)).collect();
        let new: Vec<ChaoticSet> =
            chaos::sets(strobe, &sample, &captured, length as usize, &self.effort, cancel)
                .into_iter()
                .filter(|new| !self.sets.iter().any(|old| old.same_as(new)))
                .collect();
        if new.is_empty() {
            return;
        }
        let points: Vec<State> = new.iter().flat_map(|set| set.points.iter().copied()).collect();
        if self.find_short_cycles(strobe, &points, cancel) {
            // What was taken for chaos may end there.
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
        let mut points = spread(&set.points, proved);
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
