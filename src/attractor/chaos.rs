//! Sets that keep their trajectories without closing: chaotic attractors and quasi-periodic
//! rotation, told apart from transients that have not ended yet.
//!
//! Each long run is cut into windows. Windows that turn alike and whose regions meet form a group. Groups that
//! trajectories leave for one another are one set; a set that a trajectory leaves for good, for
//! another group or for a trap, is a transient.

use std::sync::atomic::{AtomicBool, Ordering};

use super::effort::Effort;
use super::kind::Kind;
use super::region::Region;
use super::trap::Band;
use super::walk::{Cut, Senses, Window, walk};
use crate::integrate::Strobe;
use crate::integrate::accuracy::distance;
use crate::integrate::stroboscopic::State;

/// Stroboscopic points that are kept as a picture of the set.
const KEPT: usize = 2000;
/// Windows of a run.
const WINDOWS: usize = 4;
/// Windows that draw the curve of a quasi-periodic set.
const CURVES: usize = 128;
/// An exponent this many standard errors above zero is positive ...
const SIGNIFICANCE: f64 = 4.0;
/// ... if it is greater than this, per period.
const LEAST_EXPONENT: f64 = 1e-3;
/// Points this near are the same.
const SAME: f64 = 1e-6;
/// Exponents (per period) within this of zero may belong to quasi-periodic motion.
const NEUTRAL: f64 = 2e-3;
/// Such motion turns this often per period at least.
const LEAST_TURNS: f64 = 0.02;

/// A set of trajectories that share a region and stay there.
#[derive(Clone, Debug)]
pub struct ChaoticSet {
    /// Which chaos, or quasi-periodic rotation.
    pub kind: Kind,
    /// Sense of its turns: 1, -1, or 0 for both or none.
    pub sense: i64,
    /// How many of the trajectories belong to it.
    pub members: usize,
    /// Sampled stroboscopic points.
    pub points: Vec<State>,
    /// Largest Lyapunov exponent per unit of tau.
    pub exponent: f64,
    /// Its standard error over the sampled trajectories.
    pub exponent_stderr: f64,
    /// Where it lives.
    pub region: Region,
    /// For quasi-periodic motion: the band that captures.
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

/// Sorts trajectories that nothing has captured, watched from `states` on for `periods` more, into the sets
/// that none of them leaves.
///
/// `captured` says after how many of these periods a trap took each, if one did. No set is returned if
/// `cancel` was set.
#[must_use]
pub fn sets(
    strobe: &Strobe,
    states: &[State],
    captured: &[Option<u32>],
    periods: usize,
    effort: &Effort,
    cancel: &AtomicBool,
) -> Vec<ChaoticSet> {
    let length = periods / WINDOWS;
    let cut = Cut { windows: WINDOWS, length, side: effort.cells };
    let Some(mut walks) = walk(strobe, states, cut, cancel) else { return Vec::new() };
    for (windows, captured) in walks.iter_mut().zip(captured) {
        windows.truncate(captured.map_or(WINDOWS, |at| at as usize / length.max(1)));
        if closes(windows, effort.longest_cycle) {
            windows.clear();
        }
    }
    let groups = Groups::new(&walks, captured);
    let describe = |class: Vec<usize>| {
        let windows: Vec<&Window> = groups.windows(&walks, &class);
        let members = groups.members(&class);
        describe(strobe, &windows, members, length, effort, cancel)
    };
    groups.classes().into_iter().filter_map(describe).collect()
}

/// Whether it repeats itself: a start exactly on an orbit that does not attract, such as upright or
/// hanging rest, stays there for want of a perturbation.
fn closes(windows: &[Window], longest: usize) -> bool {
    let Some(points) = windows.last().map(|window| &window.points) else { return false };
    (1..=longest).any(|n| {
        points.len() > 2 * n
            && points.iter().zip(&points[n..]).all(|(a, b)| distance(*a, *b) < SAME)
    })
}

/// Windows that turn alike in regions that meet, and where trajectories go from them.
struct Groups {
    /// The group of every window of every walk.
    of: Vec<Vec<usize>>,
    /// The groups that the next windows belong to; `None` is a trap.
    next: Vec<Vec<Option<usize>>>,
}

impl Groups {
    fn new(walks: &[Vec<Window>], captured: &[Option<u32>]) -> Self {
        // Groups that a window joins become one: `parent` leads to it.
        let mut found: Vec<(Senses, Region)> = Vec::new();
        let mut parent: Vec<usize> = Vec::new();
        let mut of: Vec<Vec<usize>> = Vec::with_capacity(walks.len());
        for windows in walks {
            let mut own = Vec::with_capacity(windows.len());
            for window in windows {
                let (senses, mut region) = (window.senses, window.region.clone());
                let place = found.len();
                for k in 0..place {
                    if parent[k] == k && found[k].0 == senses && found[k].1.meets(&window.region) {
                        region.unite(&found[k].1);
                        parent[k] = place;
                    }
                }
                found.push((senses, region));
                parent.push(place);
                own.push(place);
            }
            of.push(own);
        }
        let root = |mut k: usize| {
            while parent[k] != k {
                k = parent[k];
            }
            k
        };
        for group in of.iter_mut().flatten() {
            *group = root(*group);
        }
        let mut next = vec![Vec::new(); found.len()];
        for (own, captured) in of.iter().zip(captured) {
            for pair in own.windows(2) {
                next[pair[0]].push(Some(pair[1]));
            }
            if let (Some(last), Some(_)) = (own.last(), captured) {
                next[*last].push(None);
            }
        }
        Self { of, next }
    }

    /// The groups that trajectories leave for one another only, and stay in.
    fn classes(&self) -> Vec<Vec<usize>> {
        let mut classes: Vec<Vec<usize>> = Vec::new();
        let mut used: Vec<usize> = self.of.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        for group in used {
            let Some(reached) = self.reached(group) else { continue };
            let back = |k: &usize| self.reached(*k).is_some_and(|others| others.contains(&group));
            if !reached.is_empty() && reached.iter().all(back) && !classes.contains(&reached) {
                classes.push(reached);
            }
        }
        classes
    }

    /// The groups that trajectories come to from this one, sorted; `None` if a trap is among them.
    fn reached(&self, group: usize) -> Option<Vec<usize>> {
        let mut reached: Vec<usize> = Vec::new();
        let mut from = vec![group];
        while let Some(group) = from.pop() {
            for next in &self.next[group] {
                let next = (*next)?;
                if !reached.contains(&next) {
                    reached.push(next);
                    from.push(next);
                }
            }
        }
        reached.sort_unstable();
        Some(reached)
    }

    fn windows<'a>(&self, walks: &'a [Vec<Window>], class: &[usize]) -> Vec<&'a Window> {
        let all = walks.iter().flatten().zip(self.of.iter().flatten());
        all.filter(|(_, group)| class.contains(group)).map(|(window, _)| window).collect()
    }

    fn members(&self, class: &[usize]) -> usize {
        let ends = |own: &&Vec<usize>| own.last().is_some_and(|group| class.contains(group));
        self.of.iter().filter(ends).count()
    }
}

/// What a set of windows is; `None` where it is neither chaos nor quasi-periodic.
fn describe(
    strobe: &Strobe,
    windows: &[&Window],
    members: usize,
    length: usize,
    effort: &Effort,
    cancel: &AtomicBool,
) -> Option<ChaoticSet> {
    if strobe.pendulum.is_autonomous() {
        // A flow in the plane has no chaos; what is left here has not settled yet.
        return None;
    }
    let mut region = Region::new(effort.cells, &strobe.pendulum);
    for window in windows {
        region.unite(&window.region);
    }
    let every: Vec<State> = windows.iter().flat_map(|w| w.points.iter().copied()).collect();
    let points = spread(&every, KEPT);
    let exponents = exponents(strobe, &spread(&every, effort.watched), length, cancel)?;
    let (mean, stderr) = mean_and_error(&exponents);
    let period = strobe.pendulum.period();
    let turning = |w: &&Window| w.turns.abs() > LEAST_TURNS * length as f64;
    let found = |kind: Kind, sense: i64, mean: f64, band: Option<Band>| ChaoticSet {
        kind,
        sense,
        members,
        points,
        exponent: mean / period,
        exponent_stderr: stderr / period,
        region,
        band,
    };
    if mean.abs() < NEUTRAL && windows.iter().all(turning) {
        // Near a resonance one trajectory takes long to fill the curve; several fill it sooner.
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

/// `most` of the points at equal distances in their list, or all.
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

/// Mean and standard error of values that do not depend on one another.
pub(crate) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    if values.len() < 2 {
        return (mean, 0.0);
    }
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}
