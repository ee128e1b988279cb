//! The curves in the plane of two coordinates, from some of their points on.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use nalgebra::DVector;

use super::branch::{End, SAME};
use super::course::Course;
use super::critical::{Critical, Point};
use super::curve::{Degenerate, Met, Run};
use super::cycle::{Closure, Cycles, Type};
use super::event::Kind;
use crate::error::Error;
use crate::integrate::State;
use crate::model::Pendulum;
use crate::model::pendulum::Symmetry;

/// Largest distance of the end of a curve of folds from the point of codimension 2 that it ends at.
const MEETS: f64 = 0.05;
/// Largest distance of an end from the point of a curve where slips and sticks change that it is at.
const REACHES: f64 = 1e-4;
/// Distances along the null vector at which a curve of folds is begun, the first that succeeds.
const DISTANCES: [f64; 5] = [3e-2, 1e-2, 3e-3, 1e-3, 1e-1];

/// A curve and what happens on it.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The type of its orbits.
    pub of: Type,
    /// What happens on it.
    pub kind: Kind,
    /// Its points.
    pub points: Vec<Point>,
    /// Points of codimension 2, by their indices.
    pub degenerate: Vec<(Degenerate, usize)>,
    /// Why it ends before the first and after the last point.
    pub ends: [End; 2],
    /// The curve and its point of codimension 2 that either end is at.
    pub meets: [Option<(usize, usize)>; 2],
    /// What either end is near, as long as that point is not found.
    near: [Option<Met>; 2],
}

/// A point from which a curve is followed.
#[derive(Clone, Debug)]
pub struct Seed {
    /// The type of the orbit.
    pub of: Type,
    /// What happens there.
    pub kind: Kind,
    /// Its points, as [`Cycles::points`] has them.
    pub points: Vec<State>,
    /// The coordinates.
    pub at: [f64; 2],
    /// The coordinate that the curve moves along at first.
    pub along: usize,
}

/// Curves in a plane.
#[derive(Clone, Debug)]
pub struct Plane {
    /// The course, of two coordinates from 0 to 1.
    pub course: Course,
    /// Longest period of orbits whose curves are begun at other curves.
    pub longest: usize,
    /// The symmetry in the whole plane.
    pub symmetry: Option<Symmetry>,
    /// The curves.
    pub curves: Vec<Curve>,
}

impl Plane {
    /// No curves yet.
    ///
    /// # Errors
    /// The errors of [`Course::check`] at the corners.
    pub fn new(course: Course, longest: usize) -> Result<Self, Error> {
        for corner in [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
            course.check(&corner)?;
        }
        // What breaks the symmetry somewhere does so in the whole plane but for single curves.
        let inner = [[0.29, 0.37], [0.61, 0.83]].map(|at| course.pendulum(&at).symmetry());
        let symmetry = if inner[0] == inner[1] { inner[0] } else { None };
        Ok(Self { course, longest, symmetry, curves: Vec::new() })
    }

    /// The pendulum at two coordinates.
    #[must_use]
    pub fn pendulum(&self, at: [f64; 2]) -> Pendulum {
        self.course.pendulum(&at)
    }

    /// The orbits of one type at which this happens.
    #[must_use]
    pub fn critical(&self, of: Type, kind: Kind) -> Critical<'_> {
        let (course, symmetry) = (&self.course, self.symmetry);
        Critical { cycles: Cycles { course, of, symmetry, origin: 0.0, scale: 1.0 }, kind }
    }

    /// Whether a curve passes through a place.
    fn passes(&self, of: Type, kind: Kind, place: &DVector<f64>) -> bool {
        let own = |curve: &&Curve| curve.kind == kind && curve.of.is_like(&of);
        self.curves.iter().filter(own).any(|curve| {
            let critical = self.critical(curve.of, kind);
            curve.points.windows(2).any(|both| critical.is_between(place, &both[0], &both[1]))
        })
    }

    /// The points of a curve at which a coordinate, 0 or 1, has this value.
    #[must_use]
    pub fn points(&self, curve: &Curve, axis: usize, value: f64) -> Vec<Point> {
        let critical = self.critical(curve.of, curve.kind);
        let pairs = curve.points.windows(2);
        pairs.filter_map(|both| critical.between(&both[0], &both[1], axis, value)).collect()
    }

    /// Adds the curve through a seed, if none passes there yet, and those that begin at its points of codimension 2; whether
    /// there was a new one.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` is set.
    pub fn add(&mut self, seed: &Seed, cancel: &AtomicBool) -> Result<bool, Error> {
        let from = self.curves.len();
        self.add_alone(seed, cancel)?;
        let mut next = from;
        while next < self.curves.len() {
            self.link(next, cancel)?;
            self.grow(next, cancel)?;
            next += 1;
        }
        self.reach();
        Ok(next > from)
    }

    fn add_alone(&mut self, seed: &Seed, cancel: &AtomicBool) -> Result<(), Error> {
        let (mut of, mut points) = (seed.of, seed.points.clone());
        if seed.kind == Kind::RestBoundary {
            // The same for all orbits that it swallows.
            let centre = PI * (points[0][0] / PI).round();
            of = Type { n: 1, w: 0, closure: Closure::Rest, centre };
        }
        if of.w < 0 && self.symmetry == Some(Symmetry::AtOnce) {
            // Its mirror image.
            of.w = -of.w;
            points = points.into_iter().map(|[theta, velocity]| [-theta, -velocity]).collect();
        }
        let critical = self.critical(of, seed.kind);
        let place = critical.place(&points, seed.at);
        if self.passes(of, seed.kind, &place) {
            return Ok(());
        }
        let mut row = DVector::zeros(place.len());
        row[place.len() - 2 + seed.along] = 1.0;
        let Some(first) = critical.near(&place, &row, None) else { return Ok(()) };
        if critical.is_undriven(&first.orbit.place) {
            return Ok(());
        }
        if first.orbit.moved > SAME && self.passes(of, seed.kind, &first.orbit.place) {
            return Ok(());
        }
        let first = Point { coefficient: critical.coefficient(&first, false), ..first };
        let ahead = critical.followed(&first, cancel)?;
        let mut curve = Curve::of(of, seed.kind, ahead);
        if curve.ends[1] == End::Closed {
            curve.ends[0] = End::Closed;
        } else {
            let mut turned = first;
            turned.orbit.tangent.neg_mut();
            turned.orbit.orientation = !turned.orbit.orientation;
            curve.begins(critical.followed(&turned, cancel)?);
        }
        self.curves.push(curve);
        Ok(())
    }

    /// Finds the points of codimension 2 that a curve of folds ends at, on curves that are followed if they are not known.
    fn link(&mut self, index: usize, cancel: &AtomicBool) -> Result<(), Error> {
        for end in [0, 1] {
            let curve = &self.curves[index];
            let (of, kind) = (curve.of, curve.kind);
            if kind != Kind::Fold {
                continue;
            }
            let Some(met) = curve.near[end].clone() else { continue };
            let born = |kind: &Kind| {
                self.critical(met.of, *kind)
                    .cycles
                    .shed_type(*kind)
                    .is_some_and(|shed| shed.is_like(&of))
            };
            let kinds = [Kind::PeriodDoubling, Kind::SymmetryBreaking];
            let Some(parent) = kinds.into_iter().find(born) else { continue };
            for along in [0, 1] {
                let Met { of, ref points, at } = met;
                let seed = Seed { of, kind: parent, points: points.clone(), at, along };
                self.add_alone(&seed, cancel)?;
            }
            let on_parent = |curve: &Curve, _| curve.kind == parent;
            let Some(found) = self.nearest(met.of, met.at, MEETS, on_parent) else { continue };
            let (number, point) = found;
            let begin = self.critical(met.of, parent);
            let child = self.critical(of, kind);
            let at = &self.curves[number].points[self.curves[number].degenerate[point].1];
            let last = begin.born(at, &child);
            let curve = &mut self.curves[index];
            curve.meets[end] = Some(found);
            if let Some(last) = last {
                curve.insert(end, last);
            }
        }
        Ok(())
    }

    /// Joins ends of curves to the points of curves where slips and sticks change that they reach.
    fn reach(&mut self) {
        for index in 0..self.curves.len() {
            for end in [0, 1] {
                let curve = &self.curves[index];
                let stops = matches!(curve.ends[end], End::Lost(_) | End::Phases | End::Crossing);
                let last = if end == 0 { curve.points.first() } else { curve.points.last() };
                let Some(last) = last.filter(|_| stops) else { continue };
                let at = Critical::at(&last.orbit.place);
                let reached = Degenerate::Reached(curve.kind);
                let found = self.nearest(curve.of, at, REACHES, |_, kind| kind == reached);
                if found.is_some() {
                    let curve = &mut self.curves[index];
                    (curve.ends[end], curve.meets[end]) = (End::Phases, found);
                }
            }
        }
    }

    /// The point of codimension 2 nearest to coordinates on curves of one type, of those that are wanted.
    fn nearest(
        &self,
        of: Type,
        near: [f64; 2],
        within: f64,
        wanted: impl Fn(&Curve, Degenerate) -> bool,
    ) -> Option<(usize, usize)> {
        let mut best: Option<(f64, (usize, usize))> = None;
        for (number, curve) in self.curves.iter().enumerate().filter(|one| one.1.of.is_like(&of)) {
            for (k, (kind, index)) in curve.degenerate.iter().enumerate() {
                let at = Critical::at(&curve.points[*index].orbit.place);
                let apart = (at[0] - near[0]).hypot(at[1] - near[1]);
                if wanted(curve, *kind) && apart < best.map_or(within, |(least, _)| least) {
                    best = Some((apart, (number, k)));
                }
            }
        }
        best.map(|(_, found)| found)
    }

    /// Adds the curves of folds that begin at points of codimension 2 of a curve.
    fn grow(&mut self, index: usize, cancel: &AtomicBool) -> Result<(), Error> {
        for number in 0..self.curves[index].degenerate.len() {
            let curve = &self.curves[index];
            let critical = self.critical(curve.of, curve.kind);
            let point = &curve.points[curve.degenerate[number].1];
            let known =
                self.curves.iter().any(|other| other.meets.contains(&Some((index, number))));
            let shed = critical.cycles.shed_type(curve.kind).filter(|of| of.n <= self.longest);
            let Some(of) = shed.filter(|_| !known) else { continue };
            let child = self.critical(of, Kind::Fold);
            let Some(begin) = critical.born(point, &child) else { continue };
            let row = &begin.orbit.tangent;
            let first = DISTANCES.iter().find_map(|away| {
                let guess = &begin.orbit.place + row * *away;
                child.near(&guess, row, None)
            });
            let Some(first) = first else { continue };
            if self.passes(of, Kind::Fold, &first.orbit.place) {
                continue;
            }
            let inside = Critical::at(&first.orbit.place).iter().all(|x| (0.0..=1.0).contains(x));
            if !inside {
                continue;
            }
            let end = if curve.of.closure == Closure::Rest { End::Rest } else { End::Parent };
            let mut curve = Curve::of(of, Kind::Fold, child.followed(&first, cancel)?);
            curve.ends[0] = end;
            curve.meets[0] = Some((index, number));
            curve.insert(0, begin);
            self.curves.push(curve);
        }
        Ok(())
    }
}

impl Curve {
    fn of(of: Type, kind: Kind, Run { points, degenerate, end, met }: Run) -> Self {
        let ends = [End::Lost(f64::NAN), end];
        Self { of, kind, points, degenerate, ends, meets: [None; 2], near: [None, met] }
    }

    /// Puts what was followed from the first point in the other sense before it.
    fn begins(&mut self, run: Run) {
        let before = run.points.len() - 1;
        for (_, index) in &mut self.degenerate {
            *index += before;
        }
        let back = run.degenerate.into_iter().map(|(kind, index)| (kind, before - index));
        self.degenerate.extend(back);
        self.degenerate.sort_by_key(|(_, index)| *index);
        let turned = run.points.into_iter().skip(1).map(|mut point| {
            point.orbit.tangent.neg_mut();
            point.orbit.orientation = !point.orbit.orientation;
            point
        });
        let mut points: Vec<Point> = turned.collect();
        points.reverse();
        points.append(&mut self.points);
        self.points = points;
        self.ends[0] = run.end;
        self.near[0] = run.met;
    }

    /// Adds an end point.
    fn insert(&mut self, end: usize, point: Point) {
        self.near[end] = None;
        if end == 1 {
            self.points.push(point);
            return;
        }
        self.points.insert(0, point);
        for (_, index) in &mut self.degenerate {
            *index += 1;
        }
    }
}

impl Critical<'_> {
    /// The orbit of a point of codimension 2 as one of the type that it sheds; its tangent points to those.
    fn born(&self, point: &Point, child: &Critical<'_>) -> Option<Point> {
        let points = self.all_points(&point.orbit.place);
        let turns = std::f64::consts::TAU * self.cycles.of.w as f64;
        let lap = |k: usize| {
            let [theta, velocity] = points[k % points.len()];
            [theta + turns * (k / points.len()) as f64, velocity]
        };
        let points: Vec<State> = (0..child.cycles.count()).map(lap).collect();
        child.degenerate(&child.place(&points, Self::at(&point.orbit.place)))
    }
}
