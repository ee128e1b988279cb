//! Branches and what they shed, from one of their orbits on.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::AtomicBool;

use super::branch::{Bounds, End, PARTED, Run};
use super::course::Course;
use super::cycle::{Closure, Cycles, Orbit, Type};
use super::event::{Event, Kind};
use super::period::Period;
use crate::error::Error;
use crate::integrate::State;
use crate::model::Pendulum;
use crate::model::pendulum::Symmetry;
use crate::orbit::PeriodicOrbit;
use crate::orbit::newton::SAME;
use crate::orbit::symmetry::Mirror;

/// Largest distance of the last orbit of a branch from the orbit that it meets.
const MEETS: f64 = 1e-3;
/// Distance from the event of a parent's branch at which the branch is begun, over the range.
const BESIDE: f64 = 1e-4;

/// Steps of the integrator over a period at most.
const MOST_STEPS: usize = 10_000;

/// A branch of orbits of one type.
#[derive(Clone, Debug)]
pub struct Branch {
    /// The type.
    pub of: Type,
    /// Its orbits and what happens on them.
    pub run: Run,
    /// Why it ends before the first and after the last orbit.
    pub ends: [End; 2],
    /// The branch and its event that either end is at, if it is one of the family.
    pub meets: [Option<(usize, usize)>; 2],
    /// The branch of the mirror images.
    pub twin: Option<usize>,
}

/// Branches along a course.
#[derive(Clone, Debug)]
pub struct Family {
    /// The course, of one coordinate.
    pub course: Course,
    /// The range of the coordinate.
    pub bounds: Bounds,
    /// Longest period of branches that are begun at doublings.
    pub longest: usize,
    /// The symmetry along the whole course.
    pub symmetry: Option<Symmetry>,
    /// The branches.
    pub branches: Vec<Branch>,
}

impl Family {
    /// No branches yet.
    ///
    /// # Errors
    /// [`Error::Range`] for a range that is not one; the errors of [`Course::check`] at its ends.
    pub fn new(course: Course, bounds: Bounds, longest: usize) -> Result<Self, Error> {
        let Bounds { low, high } = bounds;
        if !(low.is_finite() && high.is_finite() && low < high) {
            let allowed = "two finite bounds, the lower one first";
            return Err(Error::Range { name: "range", value: low, allowed });
        }
        for end in [low, high] {
            course.check(&[end])?;
            let count = Period::<3>::count(&course, &[end]);
            if count > MOST_STEPS {
                let name = "steps of a forcing period at either end of the range";
                let allowed = "10000 or fewer: a drive that is weaker or faster";
                return Err(Error::Range { name, value: count as f64, allowed });
            }
        }
        // What breaks the symmetry somewhere on the course does so on all of it but for single places.
        let inner = [0.29, 0.61].map(|part| course.pendulum(&[low + part * (high - low)]));
        let [first, second] = inner.map(|pendulum| pendulum.symmetry());
        let symmetry = if first == second { first } else { None };
        Ok(Self { course, bounds, longest, symmetry, branches: Vec::new() })
    }

    /// The pendulum at a coordinate.
    #[must_use]
    pub fn pendulum(&self, at: f64) -> Pendulum {
        self.course.pendulum(&[at])
    }

    /// The orbits of one type.
    #[must_use]
    pub fn cycles(&self, of: Type) -> Cycles<'_> {
        let Bounds { low, high } = self.bounds;
        let (course, symmetry) = (&self.course, self.symmetry);
        Cycles { course, of, symmetry, origin: low, scale: high - low }
    }

    /// Whether a branch passes through the orbit, or through its mirror image, at this coordinate.
    #[must_use]
    pub fn passes(&self, orbit: &PeriodicOrbit, at: f64) -> bool {
        let mirrored = self.symmetry == Some(Symmetry::AtOnce) && orbit.w == 0;
        let own = |branch: &&Branch| (branch.of.n, branch.of.w) == (orbit.n, orbit.w);
        self.branches.iter().filter(own).any(|branch| {
            let cycles = self.cycles(branch.of);
            branch.at(&cycles, at).iter().any(|found| {
                let points = cycles.all_points(&found.place);
                let first = points[0];
                let image = [-first[0], -first[1]];
                orbit.contains(first, SAME) || mirrored && orbit.contains(image, SAME)
            })
        })
    }

    /// Adds the branch through an orbit, and all that it sheds; whether there was one.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` is set.
    pub fn add(
        &mut self,
        orbit: &PeriodicOrbit,
        at: f64,
        cancel: &AtomicBool,
    ) -> Result<bool, Error> {
        let Some((of, points)) = self.type_of(orbit, at) else { return Ok(false) };
        let from = self.branches.len();
        let new = self.follow(of, &points, at, cancel)?;
        self.grow(from, cancel)?;
        Ok(new)
    }

    /// Adds the branch of this type through an orbit with these points, alone; whether there was one.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` is set.
    pub fn follow(
        &mut self,
        of: Type,
        points: &[State],
        at: f64,
        cancel: &AtomicBool,
    ) -> Result<bool, Error> {
        let cycles = self.cycles(of);
        let first = cycles.near(&cycles.place(points, at), &cycles.along());
        // Where friction holds the pendulum for ever, orbits are not isolated; where motions part fast, none is followed.
        let Some(first) = first.filter(|one| !one.stuck && one.norm < PARTED) else {
            return Ok(false);
        };
        let branch = cycles.both_ways(first, self.bounds, cancel)?;
        self.branches.push(branch);
        Ok(true)
    }

    /// A state at the upper end of the range of the orbit that one at the lower end leads to; none where its branch turns
    /// back or ends before.
    #[must_use]
    pub fn carried(&self, orbit: &PeriodicOrbit, cancel: &AtomicBool) -> Option<State> {
        let at = self.bounds.low;
        let (of, points) = self.type_of(orbit, at)?;
        let cycles = self.cycles(of);
        let first = cycles.near(&cycles.place(&points, at), &cycles.along())?;
        let (run, end) = cycles.followed(&first, self.bounds, cancel).ok()?;
        let folds = run.events.iter().any(|event| event.kind == Kind::Fold);
        let last = cycles.points(&run.orbits.last()?.place)[0];
        (end == End::Range && !folds).then(|| [self.course.base.angle().wrapped(last[0]), last[1]])
    }

    /// The type of an orbit and the points that [`Cycles`] has of it.
    #[must_use]
    pub fn type_of(&self, orbit: &PeriodicOrbit, at: f64) -> Option<(Type, Vec<State>)> {
        let map = Period::<3>::new(&self.course, &[at]);
        let mut points = vec![*orbit.points.first()?];
        for k in 1..orbit.n {
            points.push(map.images(&points[k - 1..k], 1.0).pop()?.state);
        }
        let mut of = Type { n: orbit.n, w: orbit.w, closure: Closure::Whole, centre: 0.0 };
        let mirror = self.symmetry.and_then(|_| Mirror::of(&self.pendulum(at)));
        let Some(mirror) = mirror.filter(|_| orbit.w == 0) else { return Some((of, points)) };
        if !orbit.contains(mirror.image(points[0]), mirror.tolerance()) {
            return Some((of, points));
        }
        let [theta, _] = points[0];
        if self.symmetry == Some(Symmetry::AtOnce) && orbit.n == 1 {
            of.closure = Closure::Rest;
            of.centre = PI * (theta / PI).round();
            return Some((of, vec![[of.centre, 0.0]]));
        }
        of.closure = Closure::Half;
        let cycles = self.cycles(of);
        let [whole, half] = cycles.parts();
        let opposite = if half > 0 {
            map.images(&points[whole..=whole], 0.5).pop()?.state
        } else {
            points[whole]
        };
        of.centre = PI * ((theta + opposite[0]) / TAU).round();
        points.truncate(cycles.count());
        Some((of, points))
    }

    /// Adds what the branches from this one on shed, the branches that they are shed by, and so on.
    fn grow(&mut self, from: usize, cancel: &AtomicBool) -> Result<(), Error> {
        let mut next = from;
        while next < self.branches.len() {
            for end in 0..2 {
                if let Some((of, first)) = self.unknown_parent(next, end) {
                    self.branches.push(self.cycles(of).both_ways(first, self.bounds, cancel)?);
                }
            }
            for number in 0..self.branches[next].run.events.len() {
                let branch = &self.branches[next];
                let event = branch.run.events[number].clone();
                let Event { kind, orbit, rises, .. } = event;
                if !branch.run.orbits[orbit].smooth {
                    continue;
                }
                let cycles = self.cycles(branch.of);
                let orbit = &branch.run.orbits[orbit];
                if kind == Kind::NeimarkSacker {
                    let supercritical = cycles.sheds_stable_curve(orbit);
                    self.branches[next].run.events[number].supercritical = supercritical;
                    continue;
                }
                let Some(of) = cycles.shed_type(kind) else { continue };
                let place = (cycles.all_points(&orbit.place), cycles.at(&orbit.place));
                // Along the coordinate, a multiplier is beyond the critical value where the test falls below 0.
                let last = orbit.tangent.len() - 1;
                let beyond = -rises * orbit.tangent[last].signum();
                // Without the mirror image at once both twins are followed.
                let both =
                    kind == Kind::SymmetryBreaking && self.symmetry != Some(Symmetry::AtOnce);
                let senses: &[f64] = if both { &[1.0, -1.0] } else { &[1.0] };
                let rest = branch.of.closure == Closure::Rest;
                let begin = if rest { End::Rest } else { End::Parent };
                let mut side = None;
                let mut new = Vec::new();
                for sense in senses {
                    let Some(shed) = cycles.shed(orbit, &event, *sense) else { continue };
                    side = Some(shed.side);
                    if self.end_at(of, &place.0, place.1).is_none() && of.n <= self.longest {
                        let cycles = self.cycles(of);
                        new.push(cycles.begun_at(&shed.orbits, begin, self.bounds, cancel)?);
                    }
                }
                while let Some((branch, end)) = self.end_at(of, &place.0, place.1) {
                    self.branches[branch].meets[end] = Some((next, number));
                }
                let event = &mut self.branches[next].run.events[number];
                event.supercritical = side.map(|side| side * beyond > 0.0);
                for mut branch in new {
                    branch.meets[0] = Some((next, number));
                    self.branches.push(branch);
                }
            }
            next += 1;
        }
        Ok(())
    }

    /// An orbit of the branch that a branch ends on, if none is known.
    fn unknown_parent(&self, branch: usize, end: usize) -> Option<(Type, Orbit)> {
        let Branch { of, run, ends, meets, .. } = &self.branches[branch];
        if !matches!(ends[end], End::Rest | End::Parent) || meets[end].is_some() {
            return None;
        }
        let orbit = if end == 0 { run.orbits.first() } else { run.orbits.last() };
        let (of, place) = self.cycles(*of).parent(orbit?)?;
        let cycles = self.cycles(of);
        // Beside the event, which lies between two orbits then.
        let [above, below] = [BESIDE, -BESIDE].map(|by| {
            let mut place = place.clone();
            let last = place.len() - 1;
            place[last] += by;
            cycles
                .near(&place, &cycles.along())
                .filter(|one| self.bounds.holds(cycles.at(&one.place)))
        });
        let first = above.or(below)?;
        let at = cycles.at(&first.place);
        let own = |branch: &&Branch| {
            (branch.of.n, branch.of.w, branch.of.closure) == (of.n, of.w, of.closure)
        };
        let passes = |branch: &Branch| {
            branch.at(&self.cycles(branch.of), at).iter().any(|found| cycles.is_same(found, &first))
        };
        let known = self.branches.iter().filter(own).any(passes);
        (!known).then_some((of, first))
    }

    /// The end of a branch of this type that meets the orbit with these points, if its parent is not known yet.
    fn end_at(&self, of: Type, points: &[State], at: f64) -> Option<(usize, usize)> {
        let angle = self.course.base.angle();
        let mirrored = self.symmetry == Some(Symmetry::AtOnce);
        for (index, branch) in self.branches.iter().enumerate() {
            if (branch.of.n, branch.of.w, branch.of.closure) != (of.n, of.w, of.closure) {
                continue;
            }
            let cycles = self.cycles(branch.of);
            let orbits = [branch.run.orbits.first(), branch.run.orbits.last()];
            for (end, orbit) in orbits.into_iter().enumerate() {
                let Some(orbit) = orbit else { continue };
                if !matches!(branch.ends[end], End::Rest | End::Parent)
                    || branch.meets[end].is_some()
                {
                    continue;
                }
                let first = cycles.points(&orbit.place)[0];
                let image = [-first[0], -first[1]];
                let near =
                    |state: State| points.iter().any(|point| angle.distance(*point, state) < MEETS);
                let beside = ((cycles.at(&orbit.place) - at) / cycles.scale).abs() < MEETS;
                if beside && (near(first) || (mirrored && near(image))) {
                    return Some((index, end));
                }
            }
        }
        None
    }

    /// Adds the mirror images of branches of asymmetric orbits, of those that turn only if `turning`.
    pub fn mirror(&mut self, turning: bool) {
        if self.symmetry != Some(Symmetry::AtOnce) {
            return;
        }
        for index in 0..self.branches.len() {
            let branch = &self.branches[index];
            let own = branch.of.closure == Closure::Whole && (branch.of.w == 0 || turning);
            if !own || branch.twin.is_some() {
                continue;
            }
            let mut image = branch.clone();
            image.of.w = -image.of.w;
            for orbit in &mut image.run.orbits {
                let last = orbit.place.len() - 1;
                orbit.place.rows_mut(0, last).neg_mut();
                orbit.tangent.rows_mut(0, last).neg_mut();
                let phases = orbit.phases.iter().map(|phase| phase.mirrored());
                orbit.phases = super::phases::round(phases);
            }
            image.twin = Some(index);
            self.branches[index].twin = Some(self.branches.len());
            self.branches.push(image);
        }
    }
}

impl Branch {
    /// The orbits at a coordinate.
    #[must_use]
    pub fn at(&self, cycles: &Cycles<'_>, at: f64) -> Vec<Orbit> {
        let pairs = self.run.orbits.windows(2);
        let side = |orbit: &Orbit| cycles.at(&orbit.place) - at;
        let crossing = pairs.filter(|both| side(&both[0]) * side(&both[1]) <= 0.0);
        crossing.filter_map(|both| cycles.between(&both[0], &both[1], at)).collect()
    }
}

impl Cycles<'_> {
    /// The branch through an orbit, in both senses.
    fn both_ways(
        &self,
        first: Orbit,
        bounds: Bounds,
        cancel: &AtomicBool,
    ) -> Result<Branch, Error> {
        let branch = |run, ends| Branch { of: self.of, run, ends, meets: [None; 2], twin: None };
        let (ahead, end) = self.followed(&first, bounds, cancel)?;
        if end == End::Closed {
            return Ok(branch(ahead, [End::Closed; 2]));
        }
        let turned = Orbit { tangent: -&first.tangent, orientation: !first.orientation, ..first };
        let (back, begin) = self.followed(&turned, bounds, cancel)?;
        Ok(branch(back.reversed().joined(ahead), [begin, end]))
    }

    /// The branch that begins at an orbit shed by another one.
    fn begun_at(
        &self,
        [old, first]: &[Orbit; 2],
        begin: End,
        bounds: Bounds,
        cancel: &AtomicBool,
    ) -> Result<Branch, Error> {
        let beyond = !(bounds.low..=bounds.high).contains(&self.at(&first.place));
        let (mut run, end) = if beyond {
            (Run { orbits: vec![first.clone()], events: Vec::new() }, End::Range)
        } else {
            self.followed(first, bounds, cancel)?
        };
        run.orbits.insert(0, old.clone());
        for event in &mut run.events {
            event.orbit += 1;
        }
        Ok(Branch { of: self.of, run, ends: [begin, end], meets: [None; 2], twin: None })
    }
}

impl Run {
    /// In the other sense.
    fn reversed(mut self) -> Self {
        self.orbits.reverse();
        self.events.reverse();
        let last = self.orbits.len() - 1;
        for orbit in &mut self.orbits {
            orbit.tangent.neg_mut();
            orbit.orientation = !orbit.orientation;
        }
        for event in &mut self.events {
            event.orbit = last - event.orbit;
            event.rises = -event.rises;
        }
        self
    }

    /// Followed by another one that begins at its last orbit.
    fn joined(mut self, other: Self) -> Self {
        let before = self.orbits.len() - 1;
        self.orbits.extend(other.orbits.into_iter().skip(1));
        let later = |event: Event| Event { orbit: event.orbit + before, ..event };
        self.events.extend(other.events.into_iter().map(later));
        self
    }
}
