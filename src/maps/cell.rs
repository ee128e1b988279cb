//! One pendulum among many: its attractors from a few starts, and from those of similar pendulums.

use std::collections::HashMap;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::bounds::cell_periods;
use crate::attractor::attracting::{Alike, attracting};
use crate::attractor::chaos::spread;
use crate::attractor::{Attractor, Catalogue, Effort, Ending, Kind};
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::orbit::PoincareMap;

/// Largest distance between points of corresponding orbits of similar pendulums.
pub(super) const LIKE: f64 = 0.25;
/// Largest number of hints of a search.
const MOST_HINTS: usize = 16;
/// Points of a non-periodic attractor in a hint: after a small change one alone may be off it.
pub const HINTED: usize = 7;

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
    pub observed: u32,
    /// How each of its starts ended.
    ends: Vec<End>,
}

/// How a start of a cell ended.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum End {
    /// In a trap of the attractor of this index.
    Captured(usize),
    /// In no trap, up to this state.
    Open(State),
    /// Outside the range of numbers.
    Failed,
}

/// Attractors of other cells that are alike: their kind, period and turns.
#[derive(Clone, Debug)]
pub struct Hint {
    /// A point of each, the nearest cell's first; several of the first one if that is not periodic.
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
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn cell(
        &self,
        number: usize,
        strobe: &Strobe,
        hints: &[Hint],
        cancel: &AtomicBool,
    ) -> Result<Cell, Error> {
        if !strobe.pendulum.is_dissipative() {
            // Nothing attracts.
            return Ok(Cell { open: 1.0, ..Cell::default() });
        }
        let mut catalogue = Catalogue::new(strobe, Effort::BRISK, cancel)?;
        let further = followed(&mut catalogue, strobe, hints, cancel)?;
        let mut starts: Vec<State> = self.starts_of(number).collect();
        starts.extend(further);
        let endings = catalogue.endings(strobe, &starts, self.bound_of(strobe), cancel)?;
        self.told(number, strobe, &catalogue, &endings, cancel)
    }

    /// `cell` again, with further `hints`: starts that its orbits have captured stay there, the others go
    /// on from where they were. `None` if no orbit is new, and what starts from the hints is captured by known
    /// ones or joins chaos that is known.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn again(
        &self,
        number: usize,
        strobe: &Strobe,
        cell: &Cell,
        hints: &[Hint],
        cancel: &AtomicBool,
    ) -> Result<Option<Cell>, Error> {
        if !strobe.pendulum.is_dissipative() {
            return Ok(None);
        }
        let mut catalogue = Catalogue::new(strobe, Effort::BRISK, cancel)?;
        catalogue.take_over_chaos(cell.found.iter().map(|f| &f.attractor));
        let own: Vec<Hint> = cell.found.iter().filter_map(|f| Hint::of(&f.attractor)).collect();
        let restarts = followed(&mut catalogue, strobe, &own, cancel)?;
        let known = catalogue.attractors.len();
        let open = |states: Vec<State>| states.into_iter().map(Ending::Open).collect();
        let mut further: Vec<Ending> = open(followed(&mut catalogue, strobe, hints, cancel)?);
        let bound = self.bound_of(strobe);
        catalogue.settle(strobe, &mut further, bound, cancel)?;
        let gained = catalogue.attractors.len() > known;
        let ended = further.iter().all(|ending| !matches!(ending, Ending::Open(_)));
        let joined = cell.observed > 0 && hints.iter().all(|hint| hint.n.is_some());
        if !gained && (ended || joined) {
            return Ok(None);
        }
        let ending = |(end, start): (&End, State)| match end {
            End::Captured(old) => {
                let old = &cell.found[*old].attractor;
                let new = catalogue.attractors.iter().find(|new| new.is_orbit(&old.points));
                new.map_or(Ending::Open(start), |new| Ending::Captured(new.mark()))
            }
            End::Open(state) => Ending::Open(*state),
            End::Failed => Ending::Failed,
        };
        let mut endings: Vec<Ending> =
            cell.ends.iter().zip(self.starts_of(number)).map(ending).collect();
        endings.extend(open(restarts));
        if gained {
            catalogue.settle(strobe, &mut endings, bound, cancel)?;
        }
        endings.extend(further);
        catalogue.observe(strobe, &mut endings, bound, cancel)?;
        self.told(number, strobe, &catalogue, &endings, cancel).map(Some)
    }

    /// The starts of cell `number`.
    fn starts_of(&self, number: usize) -> impl Iterator<Item = State> {
        let first = number.wrapping_mul(self.each);
        (0..self.each).map(move |k| self.starts[(first + k) % self.starts.len()])
    }

    fn bound_of(&self, strobe: &Strobe) -> u32 {
        self.bound.unwrap_or_else(|| cell_periods(&strobe.pendulum))
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
        let has = |points: &[State]| cell.found.iter().any(|f| f.attractor.is_orbit(points));
        let mut orbits = attracting(strobe, &map, &cycles(&hints)).into_iter();
        let promises = |hint: &Hint| {
            let Some(n) = hint.n else { return beside };
            match orbits.next().flatten() {
                Some(orbit) => !has(&orbit.points),
                None => beside && !cell.has(n, hint.w),
            }
        };
        hints.into_iter().filter(promises).collect()
    }

    /// Shares of the starts; attractors found only from a hint have none, nor have permanent sticks
    /// on which no start ends.
    fn told(
        &self,
        number: usize,
        strobe: &Strobe,
        catalogue: &Catalogue,
        endings: &[Ending],
        cancel: &AtomicBool,
    ) -> Result<Cell, Error> {
        let endings = &endings[..self.each];
        let open: Vec<State> = endings
            .iter()
            .filter_map(|e| if let Ending::Open(state) = e { Some(*state) } else { None })
            .collect();
        let mut placed = catalogue.place(strobe, &open, cancel)?.into_iter();
        let at: HashMap<[u64; 2], usize> =
            catalogue.attractors.iter().enumerate().map(|(i, a)| (a.mark(), i)).collect();
        let mut counts = vec![0_usize; catalogue.attractors.len()];
        let (mut undecided, mut failed) = (0, 0);
        let mut ends = Vec::with_capacity(self.each);
        for (ending, start) in endings.iter().zip(self.starts_of(number)) {
            let (on, end) = match ending {
                Ending::Captured(mark) => {
                    let on = at.get(mark).copied();
                    (on, on.map_or(End::Open(start), End::Captured))
                }
                Ending::Open(state) => (placed.next().flatten(), End::Open(*state)),
                Ending::Failed => (None, End::Failed),
            };
            match (on, end) {
                (Some(i), _) => counts[i] += 1,
                (None, End::Failed) => failed += 1,
                (None, _) => undecided += 1,
            }
            ends.push(end);
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
        let observed = self.bound_of(strobe) * (1 + Effort::BRISK.observation);
        let observed = if catalogue.has_chaos() { observed } else { 0 };
        Ok(Cell { found, open: share(undecided), failed: share(failed), observed, ends })
    }
}

/// Adds the orbits that Newton's method finds from `hints`; returns the points of the others.
fn followed(
    catalogue: &mut Catalogue,
    strobe: &Strobe,
    hints: &[Hint],
    cancel: &AtomicBool,
) -> Result<Vec<State>, Error> {
    let mut further = catalogue.take_over(strobe, &cycles(hints), cancel)?;
    further.extend(hints.iter().filter(|hint| hint.n.is_none()).flat_map(|h| &h.points));
    Ok(further)
}

/// The points and periods of the periodic ones.
fn cycles(hints: &[Hint]) -> Vec<Alike> {
    hints.iter().filter_map(|hint| Some((hint.points.clone(), hint.n?))).collect()
}

impl Cell {
    /// The attractors of `others`, those that are alike in one hint.
    #[must_use]
    pub fn hints<'a>(others: impl Iterator<Item = &'a Self>, symmetric: bool) -> Vec<Hint> {
        let mut hints: Vec<Hint> = Vec::new();
        for cell in others {
            let mut seen = vec![false; hints.len()];
            for found in &cell.found {
                let Some(hint) = Hint::of(&found.attractor) else { continue };
                let alike = hints.iter().position(|h| h.is_like(&found.attractor, symmetric));
                match alike {
                    // Of mirror images one is sufficient.
                    Some(at) if hint.n.is_some() && seen.get(at) == Some(&false) => {
                        seen[at] = true;
                        hints[at].points.extend(hint.points);
                    }
                    None if hints.len() < MOST_HINTS => hints.push(hint),
                    _ => {}
                }
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
        let alike = |a: &Attractor| a.n == Some(n) && a.w.abs() == w.abs();
        self.found.iter().any(|f| alike(&f.attractor))
    }
}

impl Hint {
    /// None from a rest, which every search includes.
    fn of(attractor: &Attractor) -> Option<Self> {
        if attractor.kind.is_rest() {
            return None;
        }
        let most = if attractor.n.is_some() { 1 } else { HINTED };
        let points = spread(&attractor.points, most);
        let (kind, w) = (attractor.kind, attractor.w);
        (!points.is_empty()).then_some(Self { points, kind, n: attractor.n, w })
    }

    /// Whether an attractor is similar to its origin, or to its mirror image if it has one.
    fn is_like(&self, attractor: &Attractor, symmetric: bool) -> bool {
        let image = [-self.points[0][0], -self.points[0][1]];
        let near = |point: State| attractor.passes(point, LIKE);
        let either = |sign: i64, point: State| {
            attractor.w == sign * self.w && (self.n.is_none() || near(point))
        };
        (self.kind, self.n) == (attractor.kind, attractor.n)
            && (either(1, self.points[0]) || (symmetric && either(-1, image)))
    }
}
