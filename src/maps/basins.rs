//! Basins of attraction: attractors from a coarse set of starts, then every start to capture.

use super::basin_entropy::{Texture, texture};
use super::bounds::{chaos_periods, max_periods, search_periods};
use super::control::{Control, pool};
use super::finite_time::{FiniteTime, finite_time};
use super::label::{FAILED, Labels, UNDECIDED, label};
use super::reliability::{Reliability, reliability};
use super::starts::Starts;
use super::uncertainty::{Uncertainty, uncertainty};
use crate::attractor::{Attractor, Catalogue, Effort};
use crate::error::Error;
use crate::integrate::{State, Strobe, accuracy};
use crate::lanes::InstructionSet;
use crate::memory;
use crate::model::Pendulum;

/// Number of starts used to measure the step error.
const ERROR_SAMPLE: usize = 400;
/// Number of starts of the first search for attractors.
pub(crate) const SEARCH_SAMPLE: usize = 400;
/// Number of undecided starts of a further search.
const FURTHER_SAMPLE: usize = 256;
/// Largest number of further searches.
const FURTHER: usize = 6;
/// If chaos coexists with other attractors, a start is integrated for this multiple of the longest
/// settling time of the search before it is classified as chaotic.
const PATIENCE: u32 = 10;
const LEAST_BOUND: u32 = 200;
/// Number of cells from which a map's uncertainty exponent justifies its 50,000 starts.
const LEAST_CELLS: usize = 10_000;
/// Memory of a start, bytes: label, settling time, turns, exponent, and their copies.
const EACH: usize = 32;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Labelling {
    /// Labels distinguish basins.
    Basins,
    /// Without damping there are no attractors.
    Conservative,
    /// One chaotic attractor attracts all starts.
    OnlyChaos,
}

/// A basin map.
#[derive(Debug)]
pub struct BasinMap {
    /// The attractors; label 1 is the first.
    pub attractors: Vec<Attractor>,
    /// Labels, settling times and turns.
    pub labels: Labels,
    /// Turns and exponents over a fixed time, if labels are not meaningful.
    pub layers: Option<FiniteTime>,
    /// Whether the labels are meaningful.
    pub labelling: Labelling,
    /// Periods of the finite-time layers.
    pub layer_periods: u32,
    /// Starts of the first search for attractors; if one chaotic attractor attracts everything, all
    /// of them end on it.
    pub searched: usize,
    /// Share of the starts of each attractor.
    pub fractions: Vec<f64>,
    /// Starts whose label changes nearby; `None` for a list, and if not requested.
    pub uncertainty: Option<Uncertainty>,
    /// Texture of the labels.
    pub texture: Texture,
    /// Shares of labels that half the step and mirroring change.
    pub reliability: Reliability,
    /// Steps a period.
    pub steps: usize,
    /// The reached error, as [`accuracy::error_reached`] defines it.
    pub reached_error: f64,
    /// Bound after which a start was classified as undecided or, near chaos, as chaotic.
    pub bound: u32,
    /// Periods without capture after which a trajectory is classified as chaotic.
    pub chaos_bound: u32,
    /// The instruction set.
    pub simd: InstructionSet,
}

impl BasinMap {
    /// Share of starts with this label.
    #[must_use]
    pub fn share(&self, label: i16) -> f64 {
        let count = self.labels.label.iter().filter(|l| **l == label).count();
        count as f64 / self.labels.label.len().max(1) as f64
    }

    /// Sets at rest are known beforehand; those that no start reaches are left out.
    fn drop_unreached_rests(&mut self) {
        let reached = |i: usize, a: &Attractor| !a.is_held() || self.share(i as i16 + 1) > 0.0;
        let kept: Vec<bool> =
            self.attractors.iter().enumerate().map(|(i, a)| reached(i, a)).collect();
        let mut moved = vec![0_i16; kept.len()];
        let mut next = 0;
        for (to, kept) in moved.iter_mut().zip(&kept) {
            next += i16::from(*kept);
            *to = next;
        }
        for label in self.labels.label.iter_mut().filter(|l| **l > 0) {
            *label = moved[*label as usize - 1];
        }
        let mut old = kept.iter();
        self.attractors.retain(|_| old.next() == Some(&true));
        for attractor in &mut self.attractors {
            attractor.twin = attractor.twin.map(|t| (moved[t] - 1) as usize);
        }
    }

    /// Mean number of periods integrated for a start.
    #[must_use]
    pub fn mean_periods(&self) -> f64 {
        self.labels.work as f64 / self.labels.label.len().max(1) as f64
    }
}

/// The basins of attraction of `pendulum` over `starts`.
///
/// # Errors
/// [`Error::NotMappable`] for effects that a map cannot have,
/// [`Error::Range`] and [`Error::Tolerance`] for requests that cannot be met,
/// [`Error::Memory`] for more starts than there is memory for,
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn basins(
    pendulum: &Pendulum,
    starts: &Starts,
    options: &Options,
    control: &Control,
) -> Result<BasinMap, Error> {
    pendulum.check_mappable()?;
    let simd = InstructionSet::choose()?;
    if starts.is_empty() {
        return Err(Error::Range { name: "starts", value: 0.0, allowed: "1 or more" });
    }
    memory::reckon("starts", starts.len(), EACH)?;
    let pool = pool(options.threads)?;
    let sample = starts.sampled_states(ERROR_SAMPLE, options.seed);
    let (strobe, reached_error) = accuracy::choose(pendulum, &sample, options.tol, simd)?;
    let mut catalogue = Catalogue::new(&strobe, Effort::THOROUGH);
    let max_periods = options.max_periods.unwrap_or_else(|| max_periods(pendulum)).max(1);
    let seeds = starts.sampled_states(SEARCH_SAMPLE, options.seed);
    let endings = catalogue.endings(&strobe, &seeds, search_periods(pendulum), control.flag());
    control.check()?;

    let labelling = if !pendulum.is_dissipative() {
        Labelling::Conservative
    } else if catalogue.only_chaos().is_some() && catalogue.holds_all(&strobe, &endings) {
        Labelling::OnlyChaos
    } else {
        Labelling::Basins
    };
    let mut map = BasinMap {
        attractors: Vec::new(),
        labels: Labels::empty(),
        layers: None,
        labelling,
        layer_periods: 0,
        searched: seeds.len(),
        fractions: Vec::new(),
        uncertainty: None,
        texture: Texture::plain(),
        reliability: Reliability::default(),
        steps: strobe.steps(),
        reached_error,
        bound: max_periods,
        chaos_bound: chaos_periods(pendulum),
        simd,
    };
    if labelling == Labelling::Basins {
        let (labels, bound) = to_capture(&strobe, &mut catalogue, starts, options, &pool, control)?;
        map.texture = texture(&labels, starts, &pool);
        map.bound = bound;
        if options.check {
            map.reliability = reliability(
                &strobe,
                &catalogue,
                starts,
                &labels,
                bound,
                options.seed,
                &pool,
                control,
            )?;
        }
        let enough = options.check && starts.len() >= LEAST_CELLS;
        if let (true, Starts::Grid { theta, velocity }) = (enough, starts) {
            let again = |states: Vec<State>| {
                let states = Starts::List(states);
                Ok(label(&strobe, &catalogue, &states, None, bound, &pool, control)?.label)
            };
            map.uncertainty =
                Some(uncertainty([theta, velocity], &labels.label, options.seed, again)?);
        }
        map.labels = labels;
    } else {
        let periods =
            options.layer_periods.unwrap_or_else(|| layer_periods(&catalogue, pendulum, starts));
        let layers = finite_time(&strobe, starts, periods as usize, &pool, control)?;
        map.labels = Labels::unlabelled(&layers, labelling == Labelling::OnlyChaos, periods);
        map.layers = Some(layers);
        map.layer_periods = periods;
        map.bound = periods;
    }
    map.attractors = catalogue.attractors;
    map.drop_unreached_rests();
    map.fractions = (0..map.attractors.len()).map(|i| map.share(i as i16 + 1)).collect();
    Ok(map)
}

/// Labels all starts; those that meet no known attractor begin new searches.
fn to_capture(
    strobe: &Strobe,
    catalogue: &mut Catalogue,
    starts: &Starts,
    options: &Options,
    pool: &rayon::ThreadPool,
    control: &Control,
) -> Result<(Labels, u32), Error> {
    let searched = search_periods(&strobe.pendulum);
    let max_periods = options.max_periods.unwrap_or_else(|| max_periods(&strobe.pendulum)).max(1);
    let bound = |catalogue: &Catalogue| {
        if catalogue.has_chaos() && catalogue.longest_settle == 0 && options.max_periods.is_none() {
            // There are several chaotic sets only: no settling time to derive a bound from.
            searched
        } else if catalogue.has_chaos() && options.max_periods.is_none() {
            (PATIENCE * catalogue.longest_settle).clamp(LEAST_BOUND, max_periods)
        } else {
            max_periods
        }
    };
    let mut now = bound(catalogue);
    let mut labels = label(strobe, catalogue, starts, None, now, pool, control)?;
    for _ in 0..FURTHER {
        if labels.open.is_empty() {
            break;
        }
        let stride = labels.open.len().div_ceil(FURTHER_SAMPLE);
        let states: Vec<State> = labels.open.iter().step_by(stride).map(|(_, s)| *s).collect();
        let keys: Vec<[u64; 2]> = catalogue.attractors.iter().map(Attractor::mark).collect();
        if catalogue.search(strobe, &states, searched, control.flag()) {
            // Attractors may have moved in the sorted list: the labels move with them.
            let moved: Vec<i16> = keys
                .iter()
                .map(|old| catalogue.attractors.iter().position(|a| a.mark() == *old))
                .map(|at| at.map_or(UNDECIDED, |i| i as i16 + 1))
                .collect();
            for label in labels.label.iter_mut().filter(|l| **l > 0) {
                *label = moved[*label as usize - 1];
            }
            now = bound(catalogue).max(now);
        } else if now < max_periods {
            // The remaining starts are integrated up to the whole bound.
            now = max_periods;
        } else {
            break;
        }
        control.check()?;
        let mut picks = Vec::new();
        memory::room("starts", &mut picks, labels.open.len())?;
        picks.extend(labels.open.iter().map(|(i, _)| *i));
        memory::reckon("starts", picks.len(), EACH)?;
        let again = label(strobe, catalogue, starts, Some(&picks), now, pool, control)?;
        labels.replace(&picks, again);
    }
    Ok((labels, now))
}

/// Periods after which an exponent has stretched one cell to the size of the plane: later the
/// picture is noise. Without attractors, long enough to tell islands from the chaotic sea.
fn layer_periods(catalogue: &Catalogue, pendulum: &Pendulum, starts: &Starts) -> u32 {
    let Some(chaos) = catalogue.only_chaos() else { return 30 };
    let side = (starts.len() as f64).sqrt().max(2.0);
    let per_period = catalogue.attractors[chaos].exponent * pendulum.period();
    (side.ln() / per_period).ceil().clamp(3.0, 60.0) as u32
}

impl Labels {
    fn empty() -> Self {
        Self { label: Vec::new(), settle: Vec::new(), turns: Vec::new(), open: Vec::new(), work: 0 }
    }

    /// The labels of a plane without basins: all chaotic, or all undecided.
    fn unlabelled(layers: &FiniteTime, chaotic: bool, periods: u32) -> Self {
        let count = layers.turns.len();
        let label = layers
            .exponent
            .iter()
            .map(|e| if e.is_finite() { i16::from(chaotic) } else { FAILED })
            .collect();
        Self {
            label,
            settle: vec![super::label::NEVER; count],
            turns: layers.turns.clone(),
            open: Vec::new(),
            work: count as u64 * u64::from(periods),
        }
    }

    /// Puts the results for `picks` in their places.
    fn replace(&mut self, picks: &[usize], again: Self) {
        for (k, index) in picks.iter().enumerate() {
            self.label[*index] = again.label[k];
            self.settle[*index] = again.settle[k];
            self.turns[*index] = again.turns[k];
        }
        self.open = again.open.into_iter().map(|(k, s)| (picks[k], s)).collect();
        self.work += again.work;
    }
}
