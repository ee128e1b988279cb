//! One pendulum among many: its attractors from a few starts, and from those of similar pendulums.

use std::collections::HashMap;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::bounds::cell_periods;
use crate::attractor::chaos::spread;
use crate::attractor::rest::balances;
use crate::attractor::{Attractor, Catalogue, Effort, Ending, Kind};
use crate::integrate::{State, Strobe};
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit};

/// Largest distance between points of corresponding orbits of similar pendulums.
const LIKE: f64 = 0.25;
/// Distance within which points belong to one orbit.
const SAME: f64 = 1e-6;
/// Largest distance of Newton's method from an orbit of a neighbour.
const REACH: f64 = 0.3;
/// Largest number of hints of a search.
const MOST_HINTS: usize = 16;
/// Points of a non-periodic attractor in a hint: after a small change one alone may be off it.
pub const HINTED: usize = 4;

/// An attractor of a cell.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Found {
    /// The attractor.
    pub attractor: Attractor,
    /// Share of the cell's starts that end on it.
    pub share: f64,
}

/// The attractors of one pendulum.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Cell {
    /// Its attractors.
    pub found: Vec<Found>,
    /// Share of uncaptured starts within the bound.
    pub open: f64,
    /// Share of the starts that left the range of numbers.
    pub failed: f64,
    /// Periods within which no trap captured its chaotic trajectories; 0 without chaos.
    pub watched: u32,
}

/// An attractor of another cell: one point of it, several if it is not periodic; its kind, period
/// and turns.
#[derive(Clone, Debug)]
pub struct Hint {
    points: Vec<State>,
    kind: Kind,
    n: Option<usize>,
    w: i64,
}

/// Settings of the search of every cell.
#[derive(Clone, Debug)]
pub struct Search {
    /// Initial conditions: each cell takes `each` of these in turn.
    pub starts: Vec<State>,
    /// Number of starts of a cell.
    pub each: usize,
    /// Periods after which a search begins to observe uncaptured trajectories; by default from the
    /// damping.
    pub bound: Option<u32>,
    /// Number of points stored of a non-periodic attractor.
    pub kept: usize,
}

impl Search {
    /// The attractors of cell `number`: rests, orbits found from `hints`, and those of its starts.
    #[must_use]
    pub fn cell(
        &self,
        number: usize,
        strobe: &Strobe,
        hints: &[Hint],
        cancel: &AtomicBool,
    ) -> Cell {
        if !strobe.pendulum.is_dissipative() {
            // Nothing attracts.
            return Cell { open: 1.0, ..Cell::default() };
        }
        let mut catalogue = Catalogue::new(strobe, Effort::BRISK);
        // A point exactly at rest stays there even if unstable: such points are no starts.
        let rests = balances(&strobe.pendulum).map(|theta| ([theta, 0.0], 1));
        catalogue.take_over(strobe, &rests, cancel);
        let cycles: Vec<(State, usize)> =
            hints.iter().filter_map(|hint| Some((hint.points[0], hint.n?))).collect();
        let mut further = catalogue.take_over(strobe, &cycles, cancel);
        further.extend(hints.iter().filter(|hint| hint.n.is_none()).flat_map(|h| &h.points));
        let first = number.wrapping_mul(self.each);
        let own = |k: usize| self.starts[(first + k) % self.starts.len()];
        let mut starts: Vec<State> = (0..self.each).map(own).collect();
        starts.extend(further);
        let bound = self.bound.unwrap_or_else(|| cell_periods(&strobe.pendulum));
        let endings = catalogue.endings(strobe, &starts, bound, cancel);
        let watched = bound * (1 + Effort::BRISK.watch);
        Cell {
            watched: if catalogue.has_chaos() { watched } else { 0 },
            ..self.told(strobe, &catalogue, &endings)
        }
    }

    /// Attractors from the `hints` that `cell` lacks: a stable orbit that Newton's method finds from a
    /// hint; from a cell `beside` it also chaos of its kind, or an orbit of that period and winding
    /// that may have changed into another.
    #[must_use]
    pub fn promising(
        &self,
        strobe: &Strobe,
        cell: &Cell,
        hints: Vec<Hint>,
        beside: bool,
    ) -> Vec<Hint> {
        let symmetric = strobe.pendulum.is_mirror_symmetric();
        let unlike =
            |hint: &Hint| !cell.found.iter().any(|f| hint.is_like(&f.attractor, symmetric));
        let hints: Vec<Hint> = hints.into_iter().filter(unlike).collect();
        if hints.is_empty() {
            return hints;
        }
        let map = PoincareMap::of_steps(strobe);
        let promises = |hint: &Hint| {
            let Some(n) = hint.n else { return beside };
            let orbit =
                newton::find(&map, hint.points[0], n, REACH).filter(PeriodicOrbit::is_stable);
            let Some(orbit) = orbit else { return beside && !cell.has(n, hint.w) };
            let has = |orbit: &PeriodicOrbit| {
                let own = |p: &State| orbit.contains(*p, SAME);
                cell.found
                    .iter()
                    .any(|f| f.attractor.n.is_some() && f.attractor.points.iter().any(own))
            };
            !has(&orbit)
        };
        hints.into_iter().filter(promises).collect()
    }

    /// Shares of the starts; attractors found only from a hint have none, nor have permanent sticks
    /// on which no start ends.
    fn told(&self, strobe: &Strobe, catalogue: &Catalogue, endings: &[Ending]) -> Cell {
        let open: Vec<State> = endings
            .iter()
            .filter_map(|e| if let Ending::Open(state) = e { Some(*state) } else { None })
            .collect();
        let mut placed = catalogue.place(strobe, &open).into_iter();
        let at: HashMap<[u64; 2], usize> =
            catalogue.attractors.iter().enumerate().map(|(i, a)| (a.mark(), i)).collect();
        let mut counts = vec![0_usize; catalogue.attractors.len()];
        let (mut undecided, mut failed) = (0, 0);
        for (k, ending) in endings.iter().enumerate() {
            let end = match ending {
                Ending::Captured(mark) => at.get(mark).copied(),
                Ending::Open(_) => placed.next().flatten(),
                Ending::Failed => None,
            };
            if k >= self.each {
                continue;
            }
            match (end, ending) {
                (Some(i), _) => counts[i] += 1,
                (None, Ending::Failed) => failed += 1,
                (None, _) => undecided += 1,
            }
        }
        let share = |count: usize| count as f64 / self.each.max(1) as f64;
        let found = catalogue
            .attractors
            .iter()
            .zip(&counts)
            .map(|(attractor, count)| {
                let mut attractor = attractor.clone();
                attractor.points.truncate(attractor.n.unwrap_or(self.kept));
                attractor.region = None;
                Found { attractor, share: share(*count) }
            })
            .collect();
        Cell { found, open: share(undecided), failed: share(failed), watched: 0 }
    }
}

impl Cell {
    /// Points of the attractors of `others`, each kind of orbit once.
    #[must_use]
    pub fn hints<'a>(others: impl Iterator<Item = &'a Self>, symmetric: bool) -> Vec<Hint> {
        let mut hints: Vec<Hint> = Vec::new();
        for found in others.flat_map(|cell| &cell.found) {
            let Some(hint) = Hint::of(&found.attractor) else { continue };
            if hints.len() < MOST_HINTS
                && !hints.iter().any(|h| h.is_like(&found.attractor, symmetric))
            {
                hints.push(hint);
            }
        }
        hints
    }

    /// Whether it has an attractor that `other` has not.
    #[must_use]
    pub fn has_more_than(&self, other: &Self, symmetric: bool) -> bool {
        let lacks =
            |hint: &Hint| !other.found.iter().any(|f| hint.is_like(&f.attractor, symmetric));
        self.found.iter().filter_map(|f| Hint::of(&f.attractor)).any(|hint| lacks(&hint))
    }

    /// Whether it has an orbit of that period and winding, in either sense.
    fn has(&self, n: usize, w: i64) -> bool {
        let alike = |a: &Attractor| a.n == Some(n) && a.w.map(i64::abs) == Some(w.abs());
        self.found.iter().any(|f| alike(&f.attractor))
    }
}

impl Hint {
    /// None from a rest, which every search includes.
    fn of(attractor: &Attractor) -> Option<Self> {
        if matches!(attractor.kind, Kind::Rest | Kind::InvertedRest) {
            return None;
        }
        let most = if attractor.n.is_some() { 1 } else { HINTED };
        let points = spread(&attractor.points, most);
        let (kind, w) = (attractor.kind, attractor.w.unwrap_or(attractor.sense));
        (!points.is_empty()).then_some(Self { points, kind, n: attractor.n, w })
    }

    /// Whether an attractor is similar to its origin, or to its mirror image if it has one.
    fn is_like(&self, attractor: &Attractor, symmetric: bool) -> bool {
        let w = attractor.w.unwrap_or(attractor.sense);
        let image = [-self.points[0][0], -self.points[0][1]];
        let near = |point: State| attractor.passes(point, LIKE);
        let either =
            |sign: i64, point: State| w == sign * self.w && (self.n.is_none() || near(point));
        (self.kind, self.n) == (attractor.kind, attractor.n)
            && (either(1, self.points[0]) || (symmetric && either(-1, image)))
    }
}
