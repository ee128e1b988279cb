//! Reliability of labels: the shares that half the step, or mirroring, changes.

use super::basin_plan::Plan;
use super::control::Control;
use super::label::label;
use super::starts::Starts;
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::orbit::symmetry::Mirror;

/// Number of labels tested.
const SAMPLE: usize = 2000;

/// Shares of the sampled labels that change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reliability {
    /// Under half the step or mirroring.
    pub either: f64,
    /// Under half the step.
    pub half_step: f64,
    /// Under mirroring; `None` where a torque breaks the symmetry.
    pub mirror: Option<f64>,
    /// Labels sampled.
    pub sampled: usize,
}

/// Indices of the starts that are labelled again.
#[must_use]
pub fn sample(starts: &Starts, seed: u64) -> Vec<usize> {
    starts.sample(SAMPLE, seed.wrapping_add(1))
}

/// Labels a sample of the starts again with half the step, and from the mirrored start.
///
/// The arithmetic of the kernel is odd in the state, bit for bit, so a mirrored start would repeat
/// every rounding error; it is shifted by one unit in the last place, like the result of any other
/// arithmetic.
///
/// `own` are the labels of [`sample`].
///
/// # Errors
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn reliability(
    plan: &Plan,
    starts: &Starts,
    own: &[i16],
    seed: u64,
    pool: &rayon::ThreadPool,
    control: &Control,
) -> Result<Reliability, Error> {
    let Plan { strobe, catalogue, facts } = plan;
    let states: Vec<State> = sample(starts, seed).iter().map(|i| starts.get(*i)).collect();
    let again = |strobe: &Strobe, states: Vec<State>| {
        label(strobe, catalogue, &Starts::List(states), None, facts.bound, pool, control)
    };
    let halved = again(&strobe.refined(2), states.clone())?.label;
    let mirrored = if let Some(mirror) = Mirror::of(&strobe.pendulum) {
        let image = |s: &State| mirror.image(*s).map(f64::next_up);
        Some(again(strobe, states.iter().map(image).collect())?.label)
    } else {
        None
    };
    let twin = |label: i16| {
        let index = usize::try_from(label - 1).ok();
        let twin = index.and_then(|i| catalogue.attractors.get(i)).and_then(|a| a.twin);
        twin.map_or(label, |t| t as i16 + 1)
    };
    let (mut either, mut half_step, mut mirror) = (0, 0, 0);
    for (k, own) in own.iter().enumerate() {
        let by_half = halved[k] != *own;
        let by_mirror = mirrored.as_ref().is_some_and(|m| twin(m[k]) != *own);
        half_step += usize::from(by_half);
        mirror += usize::from(by_mirror);
        either += usize::from(by_half || by_mirror);
    }
    let share = |count: usize| count as f64 / own.len().max(1) as f64;
    Ok(Reliability {
        either: share(either),
        half_step: share(half_step),
        mirror: mirrored.is_some().then(|| share(mirror)),
        sampled: own.len(),
    })
}
