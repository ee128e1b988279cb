//! Basins of attraction: attractors from a coarse set of starts, then every start to capture.

use super::basin_entropy::{Texture, texture};
use super::basin_plan::{EACH, FURTHER_SAMPLE};
pub use super::basin_plan::{Labelling, Options, Plan};
use super::boundary_distance::Thinned;
use super::control::{Control, pool};
use super::finite_time::FiniteTime;
use super::label::Labels;
use super::reliability::{Reliability, reliability, sample};
use super::starts::Starts;
use super::uncertainty::{Uncertainty, uncertainty};
use crate::attractor::Attractor;
use crate::error::Error;
use crate::integrate::State;
use crate::lanes::InstructionSet;
use crate::memory;
use crate::model::Pendulum;

/// Number of cells from which a map's uncertainty exponent justifies its 50,000 starts.
pub const LEAST_CELLS: usize = 10_000;

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
    /// The reached error, as [`error_reached`](crate::integrate::accuracy::error_reached) defines it.
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

    /// Mean number of periods integrated for a start.
    #[must_use]
    pub fn mean_periods(&self) -> f64 {
        self.labels.work as f64 / self.labels.label.len().max(1) as f64
    }
}

/// The labels of all starts, or their layers, after as many further searches as `plan` requires.
///
/// # Errors
/// Those of [`Plan::cells`].
pub fn ends(
    plan: &mut Plan,
    starts: &Starts,
    pool: &rayon::ThreadPool,
    control: &Control,
) -> Result<(Labels, Option<FiniteTime>), Error> {
    let (mut labels, layers) = plan.cells(starts, pool, control)?;
    loop {
        let stride = labels.open.len().div_ceil(FURTHER_SAMPLE).max(1);
        let states: Vec<State> = labels.open.iter().step_by(stride).map(|(_, s)| *s).collect();
        let Some(moved) = plan.further(&states, control)? else { break };
        labels.rename(&moved);
        let mut picks = Vec::new();
        memory::room("starts", &mut picks, labels.open.len())?;
        picks.extend(labels.open.iter().map(|(i, _)| *i));
        let again = plan.label(starts, Some(&picks), pool, control)?;
        labels.replace(&picks, again);
    }
    Ok((labels, layers))
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
    memory::reckon("starts", starts.len(), EACH)?;
    let pool = pool(options.threads)?;
    let mut plan = Plan::new(pendulum, starts, options, control)?;
    let (labels, layers) = ends(&mut plan, starts, &pool, control)?;
    let labelled = layers.is_none();
    let mut map = BasinMap {
        attractors: Vec::new(),
        layers,
        labelling: plan.facts.labelling,
        layer_periods: if labelled { 0 } else { plan.facts.bound },
        searched: plan.facts.searched,
        fractions: Vec::new(),
        uncertainty: None,
        texture: match starts {
            Starts::Grid { theta, .. } if labelled => texture(&labels.label, theta.count, &pool),
            Starts::List(_) if labelled => Texture::of_list(),
            _ => Texture::plain(),
        },
        reliability: Reliability::default(),
        steps: plan.facts.steps,
        reached_error: plan.facts.reached_error,
        bound: plan.facts.bound,
        chaos_bound: plan.chaos_bound(),
        simd: plan.strobe.simd,
        labels,
    };
    if labelled && options.check {
        let label = &map.labels.label;
        let own: Vec<i16> = sample(starts, options.seed).into_iter().map(|i| label[i]).collect();
        map.reliability = reliability(&plan, starts, &own, options.seed, &pool, control)?;
        if let (true, Starts::Grid { theta, velocity }) = (starts.len() >= LEAST_CELLS, starts) {
            map.uncertainty = Some(uncertainty(
                [theta, velocity],
                &Thinned::new(label, theta.count),
                options.seed,
                |states| Ok(plan.label(&Starts::List(states), None, &pool, control)?.label),
            )?);
        }
    }
    let moved = plan.drop_unreached_turns(|label| map.share(label) > 0.0);
    map.labels.rename(&moved);
    map.attractors = plan.catalogue.attractors;
    map.fractions = (0..map.attractors.len()).map(|i| map.share(i as i16 + 1)).collect();
    Ok(map)
}
