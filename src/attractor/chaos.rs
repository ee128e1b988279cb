//! Invariant sets that are not periodic: chaotic attractors and quasi-periodic rotation,
//! distinguished from transients that have not ended yet.
//!
//! Each long run is cut into windows, and these form groups; see `groups.rs`. Groups between which
//! trajectories move, without leaving them, are one set.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::capture::{self, Outcome, Traps};
use super::effort::Effort;
use super::groups::Groups;
use super::kind::Kind;
use super::long_runs::{Cut, Senses, Window, long_runs};
use super::region::Region;
use super::trap::Band;
use crate::integrate::Strobe;
use crate::integrate::kernel::stroboscopic::State;
use crate::model::Angle;

/// Number of stroboscopic points stored as a sample of the set.
const KEPT: usize = 2000;
/// Number of windows of a run.
const WINDOWS: usize = 4;
/// How often runs may be extended, or further ones added, before undecided ones are left out.
const ROUNDS: usize = 16;
/// Number of windows that trace the curve of a quasi-periodic set.
const CURVES: usize = 128;
/// An exponent is positive if it is at least this many standard errors above zero.
const SIGNIFICANCE: f64 = 4.0;
/// Least exponent, per period, that is accepted as positive.
const LEAST_EXPONENT: f64 = 1e-3;
/// Distance within which points are identical.
const SAME: f64 = 1e-6;
/// Exponents (per period) within this of zero may belong to quasi-periodic motion.
const NEUTRAL: f64 = 2e-3;
/// Least number of turns of such motion, per period.
const LEAST_TURNS: f64 = 0.02;

/// A set of trajectories that share a region and never leave it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ChaoticSet {
    /// Kind of chaos, or quasi-periodic rotation.
    pub kind: Kind,
    /// Sense of its turns: 1, -1, or 0 for both or none.
    pub sense: i64,
    /// Sampled stroboscopic points.
    pub points: Vec<State>,
    /// Largest Lyapunov exponent per unit of tau.
    pub exponent: f64,
    /// Its standard error over the sampled trajectories.
    pub exponent_stderr: f64,
    /// Topology of its angle.
    pub region: Region,
    /// For quasi-periodic motion: the trapping band.
    pub band: Option<Band>,
}

impl ChaoticSet {
    /// Its image under `(th, v) -> (-th, -v)`.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self {
            sense: -self.sense,
            points: self.points.iter().map(|p| [-p[0], -p[1]]).collect(),
            region: self.region.mirrored(),
            band: self.band.as_ref().map(Band::mirrored),
            ..self.clone()
        }
    }
}

/// Sorts trajectories into the sets that none of them leaves: they are observed from `states` on
/// for `periods` more.
///
/// `captured` gives the number of these periods after which one of the `traps` captured each, if
/// any did. Returns no set if `cancel` was set.
#[must_use]
pub fn sets(
    strobe: &Strobe,
    traps: &Traps,
    states: &[State],
    captured: &[Option<u32>],
    periods: u32,
    effort: &Effort,
    cancel: &AtomicBool,
) -> Vec<ChaoticSet> {
    let length = (periods / WINDOWS as u32).max(1);
    let mut runs =
        Runs { strobe, traps, length, effort, cancel, windows: Vec::new(), captured: Vec::new() };
    runs.sets(states, captured).unwrap_or_default()
}

/// Trajectories observed window by window.
struct Runs<'a> {
    strobe: &'a Strobe,
    traps: &'a Traps,
    /// Periods of a window.
    length: u32,
    effort: &'a Effort,
    cancel: &'a AtomicBool,
    /// The windows of each before its capture.
    windows: Vec<Vec<Window>>,
    /// Whether a trap captured it.
    captured: Vec<bool>,
}

impl Runs<'_> {
    /// The sets of the runs from `states` and of as many further ones as a decision requires.
    ///
    /// A run whose last group no window follows goes on for a window. A set of fewer than
    /// [`Effort::proved`] runs gets that many more from its own points. Sets that this does not settle within
    /// [`ROUNDS`] are left out. `None` if the search was cancelled.
    fn sets(&mut self, states: &[State], captured: &[Option<u32>]) -> Option<Vec<ChaoticSet>> {
        self.add(states, captured)?;
        let mut groups = Groups::new(&self.windows, &self.captured);
        for _ in 0..ROUNDS {
            let unknown = groups.without_next();
            let few: Vec<State> = match unknown.as_slice() {
                [] => self.points_of_small_classes(&groups),
                _ => Vec::new(),
            };
            if unknown.is_empty() && few.is_empty() {
                break;
            }
            self.go_on(&unknown)?;
            let ends = self.captures(&few, self.length * WINDOWS as u32)?;
            self.add(&few, &ends)?;
            groups = Groups::new(&self.windows, &self.captured);
        }
        let mut found = Vec::new();
        for class in groups.classes() {
            let windows = groups.windows(&self.windows, &class);
            let set =
                describe(self.strobe, &windows, self.length as usize, self.effort, self.cancel);
            let proved = groups.members(&class) >= self.effort.proved;
            found.extend(set.filter(|set| proved || set.band.is_some()));
        }
        (!self.cancel.load(Ordering::Relaxed)).then_some(found)
    }

    /// Watches from `states`; a run that repeats itself, as from a start exactly on an orbit that does not
    /// attract, shows no set.
    fn add(&mut self, states: &[State], captured: &[Option<u32>]) -> Option<()> {
        for (mut windows, captured) in self.long_runs(states, WINDOWS)?.into_iter().zip(captured) {
            windows.truncate(captured.map_or(WINDOWS, |at| (at / self.length) as usize));
            if closes(self.strobe.angle, &windows, self.effort.longest_cycle) {
                windows.clear();
            }
            self.windows.push(windows);
            self.captured.push(captured.is_some());
        }
        Some(())
    }

    /// Observes these runs for another window.
    fn go_on(&mut self, runs: &[usize]) -> Option<()> {
        let last = |run: &usize| self.windows[*run].last()?.points.last().copied();
        let ends: Vec<State> = runs.iter().filter_map(last).collect();
        let captured = self.captures(&ends, self.length)?;
        for ((run, windows), at) in runs.iter().zip(self.long_runs(&ends, 1)?).zip(captured) {
            self.captured[*run] = at.is_some();
            if at.is_none() {
                self.windows[*run].extend(windows);
            }
        }
        Some(())
    }

    fn long_runs(&self, states: &[State], windows: usize) -> Option<Vec<Vec<Window>>> {
        let cut = Cut { windows, length: self.length as usize, side: self.effort.cells };
        long_runs(self.strobe, states, cut, self.cancel)
    }

    fn captures(&self, states: &[State], periods: u32) -> Option<Vec<Option<u32>>> {
        let outcomes = capture::outcomes(self.strobe, self.traps, periods, states, self.cancel)?;
        Some(outcomes.iter().map(Outcome::end).collect())
    }

    fn points_of_small_classes(&self, groups: &Groups) -> Vec<State> {
        let proved = self.effort.proved;
        let small = groups.classes().into_iter().filter(|class| groups.members(class) < proved);
        let points =
            |class: Vec<usize>| spread(&points(&groups.windows(&self.windows, &class)), proved);
        small.flat_map(points).collect()
    }
}

fn points(windows: &[&Window]) -> Vec<State> {
    windows.iter().flat_map(|window| window.points.iter().copied()).collect()
}

/// Whether it repeats itself: a start exactly on an orbit that does not attract, such as upright or
/// hanging rest, stays there for want of a perturbation.
fn closes(angle: Angle, windows: &[Window], longest: usize) -> bool {
    let Some(points) = windows.last().map(|window| &window.points) else { return false };
    (1..=longest).any(|n| {
        points.len() > 2 * n
            && points.iter().zip(&points[n..]).all(|(a, b)| angle.distance(*a, *b) < SAME)
    })
}

/// The attractor of a set of windows; `None` if it is neither chaotic nor quasi-periodic.
fn describe(
    strobe: &Strobe,
    windows: &[&Window],
    length: usize,
    effort: &Effort,
    cancel: &AtomicBool,
) -> Option<ChaoticSet> {
    if strobe.pendulum.is_autonomous() {
        // A flow in the plane has no chaos: the remaining trajectories have not settled yet.
        return None;
    }
    let mut region = Region::new(effort.cells, &strobe.pendulum);
    for window in windows {
        region.unite(&window.region);
    }
    let every = points(windows);
    let exponents = exponents(strobe, &spread(&every, effort.watched_alone), length, cancel)?;
    let (mean, stderr) = mean_and_error(&exponents);
    let period = strobe.pendulum.period();
    let turning = |w: &&Window| w.turns.abs() > LEAST_TURNS * length as f64;
    let found = |kind: Kind, sense: i64, mean: f64, band: Option<Band>| ChaoticSet {
        kind,
        sense,
        points: spread(&every, KEPT),
        exponent: mean / period,
        exponent_stderr: stderr / period,
        region,
        band,
    };
    if mean.abs() < NEUTRAL && windows.iter().all(turning) {
        // Near a resonance one trajectory fills the curve slowly; several fill it sooner.
        let curve: Vec<State> =
            windows.iter().take(CURVES).flat_map(|m| m.points.iter().copied()).collect();
        let band = Band::around(strobe, &curve, 0)?;
        let sense = windows[0].turns.signum() as i64;
        return Some(found(Kind::QuasiperiodicRotation, sense, 0.0, Some(band)));
    }
    if mean < LEAST_EXPONENT.max(SIGNIFICANCE * stderr) {
        return None;
    }
    let (kind, sense) =
        windows.iter().fold(Senses::default(), |all, window| all.with(window.senses)).kind();
    Some(found(kind, sense, mean, None))
}

/// At most `most` of the points, equally spaced in their list.
pub(crate) fn spread(points: &[State], most: usize) -> Vec<State> {
    let count = most.min(points.len());
    (0..count).map(|k| points[k * points.len() / count]).collect()
}

/// The growth of a tangent along each trajectory, per period, over `periods` after as many others: by then it
/// has turned into the direction of growth, and the shear of regular motion, which grows it in
/// proportion to time, adds no more than ln 2.
///
/// `None` if `cancel` was set.
fn exponents(
    strobe: &Strobe,
    states: &[State],
    periods: usize,
    cancel: &AtomicBool,
) -> Option<Vec<f64>> {
    let mut theta: Vec<f64> = states.iter().map(|s| s[0]).collect();
    let mut velocity: Vec<f64> = states.iter().map(|s| s[1]).collect();
    let count = states.len();
    let (mut turns, mut growth) = (vec![0.0; count], vec![0.0; count]);
    let mut tangents = (vec![1.0; count], vec![0.0; count]);
    for period in 0..2 * periods {
        if cancel.load(Ordering::Relaxed) {
            return None;
        }
        if period == periods {
            growth.fill(0.0);
        }
        // Lengths agree, so this cannot fail.
        let _ = strobe.stretch(
            (&mut theta, &mut velocity),
            &mut turns,
            (&mut tangents.0, &mut tangents.1),
            &mut growth,
            1,
        );
    }
    Some(growth.iter().map(|g| g / periods.max(1) as f64).collect())
}

/// Mean and standard error of independent values.
pub(crate) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    if values.len() < 2 {
        return (mean, 0.0);
    }
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}
