//! Invariant sets that are not periodic: chaotic attractors and quasi-periodic rotation,
//! distinguished from transients that have not ended yet.
//!
//! Each long run is divided into windows, and these form groups; see `groups.rs`. Groups between which
//! trajectories move, without leaving them, are one set.

use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::capture::{Fate, Traps};
use super::effort::Effort;
use super::groups::Groups;
use super::kind::Kind;
use super::long_runs::{Run, Senses, Window, WindowPlan, long_runs};
use super::region::Region;
use super::rest::standing;
use super::trap::Band;
use crate::error::{Error, unless_cancelled};
use crate::integrate::{State, Strobe, TangentStates};
use crate::model::Angle;
use crate::orbit::PoincareMap;
use crate::orbit::newton::SAME;

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
/// Multiple of the trajectories that measure an exponent again which these do not show to be positive.
const MORE: usize = 4;
/// Least exponent, per period, that is accepted as positive.
const LEAST_EXPONENT: f64 = 1e-3;
/// Exponents (per period) within this of zero may belong to quasi-periodic motion.
const NEUTRAL: f64 = 2e-3;
/// Least number of turns of such motion, per period.
const LEAST_TURNS: f64 = 0.02;

/// Chaos that an earlier search of the same pendulum has found.
#[derive(Clone, Copy, Debug)]
pub struct KnownChaos {
    /// Kind of chaos.
    pub kind: Kind,
    /// Sense of its turns.
    pub sense: i64,
    /// Largest Lyapunov exponent per unit of tau, and its standard error.
    pub exponent: [f64; 2],
}

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

/// Observes trajectories from `states` for `periods`, as [`sets`] needs it.
///
/// # Errors
/// [`Error::Interrupted`] if `cancel` was set.
pub fn observed(
    strobe: &Strobe,
    traps: &Traps,
    states: &[State],
    periods: u32,
    effort: &Effort,
    cancel: &AtomicBool,
) -> Result<Vec<Run>, Error> {
    long_runs(strobe, traps, states, window_plan(periods, effort), cancel)
}

fn window_plan(periods: u32, effort: &Effort) -> WindowPlan {
    let length = (periods as usize / WINDOWS).max(1);
    WindowPlan { windows: WINDOWS, length, side: effort.cells }
}

/// Sorts trajectories that have been [`observed`] for `periods` into the sets that none of them leaves.
///
/// Chaos of the kind and sense of one `known` has its exponent.
///
/// # Errors
/// [`Error::Interrupted`] if `cancel` was set.
pub fn sets(
    strobe: &Strobe,
    traps: &Traps,
    known: &[KnownChaos],
    observed: Vec<Run>,
    periods: u32,
    effort: &Effort,
    cancel: &AtomicBool,
) -> Result<Vec<ChaoticSet>, Error> {
    let plan = window_plan(periods, effort);
    let mut runs = Runs {
        strobe,
        traps,
        known,
        plan,
        effort,
        cancel,
        windows: Vec::new(),
        captured: Vec::new(),
    };
    runs.sets(observed)
}

/// Trajectories observed window by window.
struct Runs<'a> {
    strobe: &'a Strobe,
    traps: &'a Traps,
    known: &'a [KnownChaos],
    plan: WindowPlan,
    effort: &'a Effort,
    cancel: &'a AtomicBool,
    /// The windows of each before its capture.
    windows: Vec<Vec<Window>>,
    /// Whether a trap captured it.
    captured: Vec<bool>,
}

impl Runs<'_> {
    /// The sets of the runs observed and of as many further ones as a decision requires.
    ///
    /// A run whose last group no window follows goes on for a window. A set of fewer than
    /// [`Effort::proved`] runs gets that many more from its own points. Sets that this does not settle within
    /// [`ROUNDS`] are left out.
    fn sets(&mut self, observed: Vec<Run>) -> Result<Vec<ChaoticSet>, Error> {
        self.add(observed);
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
            let further = long_runs(self.strobe, self.traps, &few, self.plan, self.cancel)?;
            self.add(further);
            groups = Groups::new(&self.windows, &self.captured);
        }
        let mut found = Vec::new();
        for class in groups.classes() {
            let windows = groups.windows(&self.windows, &class);
            let set = self.describe(&windows)?;
            let proved = groups.members(&class) >= self.effort.proved;
            found.extend(set.filter(|set| proved || set.band.is_some()));
        }
        Ok(found)
    }

    /// Adds runs; one that repeats itself, as from a start exactly on an orbit that does not attract, shows no
    /// set.
    fn add(&mut self, runs: Vec<Run>) {
        for Run { mut windows, fate, .. } in runs {
            if closes(self.strobe.angle, &windows, self.effort.longest_cycle) {
                windows.clear();
            }
            self.windows.push(windows);
            self.captured.push(fate != Fate::Open);
        }
    }

    /// Observes these runs for another window.
    fn go_on(&mut self, runs: &[usize]) -> Result<(), Error> {
        let last = |run: &usize| self.windows[*run].last()?.points.last().copied();
        let ends: Vec<State> = runs.iter().filter_map(last).collect();
        let plan = WindowPlan { windows: 1, ..self.plan };
        let further = long_runs(self.strobe, self.traps, &ends, plan, self.cancel)?;
        for (run, Run { windows, fate, .. }) in runs.iter().zip(further) {
            self.captured[*run] = fate != Fate::Open;
            if fate == Fate::Open {
                self.windows[*run].extend(windows);
            }
        }
        Ok(())
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

impl Runs<'_> {
    /// The attractor of a set of windows; `None` if it is neither chaotic nor quasi-periodic.
    fn describe(&self, windows: &[&Window]) -> Result<Option<ChaoticSet>, Error> {
        let Self { strobe, effort, .. } = self;
        if strobe.pendulum.is_autonomous() {
            // A flow in the plane has no chaos: the remaining trajectories have not settled yet.
            return Ok(None);
        }
        let mut region = Region::new(effort.cells, &strobe.pendulum);
        for window in windows {
            region.unite(&window.region);
        }
        let every = points(windows);
        let found = |kind: Kind, sense: i64, [exponent, exponent_stderr]: [f64; 2], band| {
            let points = spread(&every, KEPT);
            Some(ChaoticSet { kind, sense, points, exponent, exponent_stderr, region, band })
        };
        let (kind, sense) =
            windows.iter().fold(Senses::default(), |all, window| all.with(window.senses)).kind();
        let known = self.known.iter().find(|known| (known.kind, known.sense) == (kind, sense));
        if let Some(known) = known {
            return Ok(found(kind, sense, known.exponent, None));
        }
        let length = self.plan.length;
        let measured = |count: usize| {
            let all = exponents(strobe, &spread(&every, count), length, self.cancel)?;
            Ok::<_, Error>(mean_and_error(&all))
        };
        let (mut mean, mut stderr) = measured(effort.exponents)?;
        if mean > LEAST_EXPONENT && mean < SIGNIFICANCE * stderr {
            (mean, stderr) = measured(MORE * effort.exponents)?;
        }
        let turning = |w: &&Window| w.turns.abs() > LEAST_TURNS * length as f64;
        if mean.abs() < NEUTRAL && windows.iter().all(turning) {
            // Near a resonance one trajectory fills the curve slowly; several fill it sooner.
            let curve: Vec<State> =
                windows.iter().take(CURVES).flat_map(|m| m.points.iter().copied()).collect();
            let mut apart = standing(strobe, &PoincareMap::of_steps(strobe));
            apart.extend(self.traps.ellipses.iter().map(|trap| trap.centre));
            let Some(band) = Band::around(strobe, &curve, 0, &apart) else { return Ok(None) };
            let sense = windows[0].turns.signum() as i64;
            let stderr = stderr / strobe.pendulum.period();
            return Ok(found(Kind::QuasiperiodicRotation, sense, [0.0, stderr], Some(band)));
        }
        if mean < LEAST_EXPONENT.max(SIGNIFICANCE * stderr) {
            return Ok(None);
        }
        let per_time = [mean, stderr].map(|x| x / strobe.pendulum.period());
        Ok(found(kind, sense, per_time, None))
    }
}

/// At most `most` of the points, equally spaced in their list.
pub(crate) fn spread(points: &[State], most: usize) -> Vec<State> {
    let count = most.min(points.len());
    (0..count).map(|k| points[k * points.len() / count]).collect()
}

/// The growth of a tangent along each trajectory, per period, over `periods` after as many others: by then it
/// has turned into the direction of growth, and the shear of regular motion, which grows it in
/// proportion to time, adds no more than ln 2.
fn exponents(
    strobe: &Strobe,
    states: &[State],
    periods: usize,
    cancel: &AtomicBool,
) -> Result<Vec<f64>, Error> {
    let mut all = TangentStates::along(states, [1.0, 0.0]);
    for period in 0..2 * periods {
        unless_cancelled(cancel)?;
        if period == periods {
            all.reset_growth();
        }
        strobe.stretch(&mut all, 1);
    }
    Ok(all.growth().iter().map(|g| g / periods.max(1) as f64).collect())
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
