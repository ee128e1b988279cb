//! What all starts of a basin map share: step length, attractors and bounds.
//!
//! A start's label depends on the plan and on the start alone, so starts may be labelled in any parts, on
//! any machine, and in any order.

use std::f64::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};

use super::bounds::{chaos_periods, max_periods, search_periods, settling_periods};
use super::control::Control;
use super::finite_time::{FiniteTime, finite_time};
use super::label::{Labels, UNDECIDED, label};
use super::starts::Starts;
use super::stored::{from_bytes, to_bytes};
use crate::attractor::{Attractor, Catalogue, Effort};
use crate::error::Error;
use crate::integrate::{State, Strobe, accuracy};
use crate::lanes::InstructionSet;
use crate::memory;
use crate::model::{Angle, Pendulum};

/// Number of starts used to measure the step error.
const ERROR_SAMPLE: usize = 400;
/// Number of starts of the first search for attractors.
pub(crate) const SEARCH_SAMPLE: usize = 400;
/// Number of undecided starts of a further search.
pub const FURTHER_SAMPLE: usize = 256;
/// Largest number of further searches.
const FURTHER: u32 = 6;
/// If chaos coexists with other attractors, a start is integrated for this multiple of the longest
/// settling time of the search before it is classified as chaotic.
const PATIENCE: u32 = 10;
const LEAST_BOUND: u32 = 200;
/// Memory of a start, bytes: label, settling time, turns, exponent, and their copies.
pub(crate) const EACH: usize = 32;

/// A request and its numerical choices.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The 95th percentile of the error after five periods.
    pub tol: f64,
    /// Periods after which a start is undecided.
    pub max_periods: Option<u32>,
    /// Periods of the finite-time layers.
    pub layer_periods: Option<u32>,
    /// Workers; 0 for one a processor.
    pub threads: usize,
    /// Seed that shifts the samples.
    pub seed: u64,
    /// Whether to measure what needs further starts: the share of labels that half the step or
    /// mirroring changes, and the share that changes nearby.
    pub check: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { tol: 1e-6, max_periods: None, layer_periods: None, threads: 0, seed: 0, check: true }
    }
}

/// Whether labels are meaningful for this map, and if not why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Labelling {
    /// Labels distinguish basins.
    Basins,
    /// Without damping there are no attractors.
    Conservative,
    /// One chaotic attractor attracts all starts.
    OnlyChaos,
}

/// The plan of a basin map.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The map over a period.
    pub strobe: Strobe,
    /// The attractors.
    pub catalogue: Catalogue,
    /// Numbers that belong to them.
    pub facts: Facts,
}

/// Numbers of a plan.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Facts {
    /// Whether labels are meaningful.
    pub labelling: Labelling,
    /// Steps a period.
    pub steps: usize,
    /// The reached error, as [`accuracy::error_reached`] defines it.
    pub reached_error: f64,
    /// Starts of the first search for attractors; if one chaotic attractor attracts everything, all
    /// of them end on it.
    pub searched: usize,
    /// Periods after which a start is undecided; without labels, those of the finite-time layers.
    pub bound: u32,
    /// Periods after which the caller considers a start undecided.
    given: Option<u32>,
    /// Number of further searches.
    further: u32,
}

impl Plan {
    /// The step length that `options` ask for, and the attractors found from a sample of `starts`.
    ///
    /// # Errors
    /// Those of [`super::basins::basins`], except [`Error::Memory`].
    pub fn new(
        pendulum: &Pendulum,
        starts: &Starts,
        options: &Options,
        control: &Control,
    ) -> Result<Self, Error> {
        Self::beside(None, pendulum, starts, options, control)
    }

    /// The plan of a similar pendulum: as by [`Plan::new`], but attractors that continue those of this
    /// plan are known before the search.
    ///
    /// The step, the sample of the search and the criteria are those of [`Plan::new`]. Chaos alone is
    /// confirmed by fewer runs ([`Effort::CONTINUED`]).
    ///
    /// # Errors
    /// Those of [`Plan::new`].
    pub fn continued(
        &self,
        pendulum: &Pendulum,
        starts: &Starts,
        options: &Options,
        control: &Control,
    ) -> Result<Self, Error> {
        Self::beside(Some(self), pendulum, starts, options, control)
    }

    fn beside(
        known: Option<&Self>,
        pendulum: &Pendulum,
        starts: &Starts,
        options: &Options,
        control: &Control,
    ) -> Result<Self, Error> {
        pendulum.check_mappable()?;
        let simd = InstructionSet::choose()?;
        if starts.is_empty() {
            return Err(Error::Range { name: "starts", value: 0.0, allowed: "1 or more" });
        }
        let sample = starts.sampled_states(ERROR_SAMPLE, options.seed);
        let (strobe, reached_error) = accuracy::choose(pendulum, &sample, options.tol, simd)?;
        let searched = search_periods(&strobe, options.max_periods);
        let cancel = control.flag();
        let mut catalogue = match known {
            Some(known) => known.catalogue.continued(&strobe, searched, cancel)?,
            None => Catalogue::new(&strobe, Effort::THOROUGH, cancel)?,
        };
        catalogue.progress = control.shared();
        let seeds = starts.sampled_states(SEARCH_SAMPLE, options.seed);
        let endings = catalogue.endings(&strobe, &seeds, searched, cancel)?;
        let labelling = if !pendulum.is_dissipative() {
            Labelling::Conservative
        } else if catalogue.only_chaos().is_some()
            && catalogue.holds_all(&strobe, &endings, cancel)?
        {
            Labelling::OnlyChaos
        } else {
            Labelling::Basins
        };
        let facts = Facts {
            labelling,
            steps: strobe.steps(),
            reached_error,
            searched: seeds.len(),
            bound: 0,
            given: options.max_periods,
            further: 0,
        };
        let mut plan = Self { strobe, catalogue, facts };
        plan.facts.bound = match labelling {
            Labelling::Basins => plan.settling_bound(),
            _ => options.layer_periods.unwrap_or_else(|| plan.layer_periods(starts)),
        };
        Ok(plan)
    }

    /// The plan as bytes, for [`Plan::restored`].
    #[must_use]
    pub fn stored(&self) -> Vec<u8> {
        to_bytes(&(&self.facts, &self.catalogue))
    }

    /// The plan of `pendulum` that [`Plan::stored`] has written.
    ///
    /// # Errors
    /// [`Error::Stored`] for bytes that are no plan; [`Error::Simd`].
    pub fn restored(pendulum: &Pendulum, bytes: &[u8]) -> Result<Self, Error> {
        let (facts, catalogue): (Facts, Catalogue) = from_bytes("plan of a basin map", bytes)?;
        let strobe = Strobe::new(pendulum, facts.steps, InstructionSet::choose()?);
        Ok(Self { strobe, catalogue: catalogue.restored(pendulum), facts })
    }

    /// Labels `starts`; without labels, measures their finite-time layers.
    ///
    /// # Errors
    /// [`Error::Memory`] for more starts than there is memory for; [`Error::Interrupted`] if `control`
    /// was cancelled.
    pub fn cells(
        &self,
        starts: &Starts,
        pool: &rayon::ThreadPool,
        control: &Control,
    ) -> Result<(Labels, Option<FiniteTime>), Error> {
        memory::reckon("starts", starts.len(), EACH)?;
        let Facts { labelling, bound, .. } = self.facts;
        if labelling == Labelling::Basins {
            return Ok((self.label(starts, None, pool, control)?, None));
        }
        let layers = finite_time(&self.strobe, starts, bound as usize, pool, control)?;
        let labels = Labels::unlabelled(&layers, labelling == Labelling::OnlyChaos, bound);
        Ok((labels, Some(layers)))
    }

    /// Labels all starts, or those with the indices `picks`; see [`label`].
    ///
    /// # Errors
    /// Those of [`label`].
    pub fn label(
        &self,
        starts: &Starts,
        picks: Option<&[usize]>,
        pool: &rayon::ThreadPool,
        control: &Control,
    ) -> Result<Labels, Error> {
        memory::reckon("starts", picks.map_or(starts.len(), <[usize]>::len), EACH)?;
        label(&self.strobe, &self.catalogue, starts, picks, self.facts.bound, pool, control)
    }

    /// Searches from some of the states of the open trajectories at the bound.
    ///
    /// Returns `None` if labels are final. Otherwise the open starts must be labelled again; entry `k`
    /// is the new label of what has been labelled `k + 1` before, because attractors may have moved in
    /// the sorted list.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `control` was cancelled.
    pub fn further(
        &mut self,
        open: &[State],
        control: &Control,
    ) -> Result<Option<Vec<i16>>, Error> {
        if open.is_empty() || self.facts.further == FURTHER {
            return Ok(None);
        }
        self.facts.further += 1;
        let before: Vec<[u64; 2]> = self.catalogue.attractors.iter().map(Attractor::mark).collect();
        let searched = search_periods(&self.strobe, self.facts.given);
        self.catalogue.progress = control.shared();
        if self.catalogue.search(&self.strobe, open, searched, control.flag())? {
            self.facts.bound = self.settling_bound().max(self.facts.bound);
        } else if self.facts.bound < self.most_periods() {
            // The remaining starts are integrated up to the whole bound.
            self.facts.bound = self.most_periods();
        } else {
            return Ok(None);
        }
        let place = |mark| self.catalogue.attractors.iter().position(|a| a.mark() == mark);
        let moved = before.into_iter().map(|mark| place(mark).map_or(UNDECIDED, |i| i as i16 + 1));
        Ok(Some(moved.collect()))
    }

    /// Leaves out sets at rest that no start reaches and that are further turns of those at 0 and pi; returns the new
    /// label of what has been labelled `k + 1` before. Traps are those of the old labels, so this must
    /// come last.
    pub fn drop_unreached_turns(&mut self, reached: impl Fn(i16) -> bool) -> Vec<i16> {
        let attractors = &mut self.catalogue.attractors;
        let further = |a: &Attractor| {
            let first = || (a.points[0][0] - FRAC_PI_2).abs() <= PI;
            a.is_held() && a.angle == Angle::Line && !first()
        };
        let kept: Vec<bool> =
            (1..).zip(&*attractors).map(|(label, a)| !further(a) || reached(label)).collect();
        let mut next = 0;
        let mut number = |kept: &bool| {
            next += i16::from(*kept);
            next
        };
        let moved: Vec<i16> = kept.iter().map(&mut number).collect();
        let mut old = kept.iter();
        attractors.retain(|_| old.next() == Some(&true));
        for attractor in attractors {
            attractor.twin = attractor.twin.map(|t| (moved[t] - 1) as usize);
        }
        moved
    }

    /// Periods without capture after which a trajectory is classified as chaotic.
    #[must_use]
    pub fn chaos_bound(&self) -> u32 {
        chaos_periods(&self.strobe, self.facts.given)
    }

    /// Periods after which starts that are undecided at first are so at last, with the attractors known by now.
    fn most_periods(&self) -> u32 {
        let pendulum = &self.strobe.pendulum;
        let slowest = self.catalogue.slowest();
        self.facts.given.unwrap_or_else(|| settling_periods(pendulum, slowest)).max(1)
    }

    /// Periods after which a start is undecided at first.
    fn settling_bound(&self) -> u32 {
        let most = self.facts.given.unwrap_or_else(|| max_periods(&self.strobe.pendulum)).max(1);
        if !self.catalogue.has_chaos() || self.facts.given.is_some() {
            most
        } else if self.catalogue.longest_settle == 0 {
            // There are several chaotic sets only: no settling time to derive a bound from.
            search_periods(&self.strobe, None)
        } else {
            (PATIENCE * self.catalogue.longest_settle).clamp(LEAST_BOUND, most)
        }
    }

    /// Periods after which an exponent has stretched one cell to the size of the plane: later the
    /// picture is noise. Without attractors, long enough to tell islands from the chaotic sea.
    fn layer_periods(&self, starts: &Starts) -> u32 {
        let Some(chaos) = self.catalogue.only_chaos() else { return 30 };
        let side = (starts.len() as f64).sqrt().max(2.0);
        let exponent = self.catalogue.attractors[chaos].exponent;
        let per_period = exponent * self.strobe.pendulum.period();
        (side.ln() / per_period).ceil().clamp(3.0, 60.0) as u32
    }
}
