//! A curve of orbits at which something happens, followed by pseudo-arclength in the plane of two coordinates.
//!
//! As [`super::branch`] follows orbits along one coordinate. Points of codimension
//! 2 are zeros of the coefficient of the normal form: of the square at a cusp, where the curve itself is smooth and passes
//! through; of the cube where a doubling or a symmetry breaking changes between super- and subcritical, and a curve
//! of folds of the new orbits begins (Kuznetsov 2004, Elements of Applied Bifurcation Theory, sections 9.2 and 9.3). Where slips and
//! sticks change they are zeros of the tests on either side: a curve of folds or doublings reaches the curve there, and the
//! multiplier begins or ceases to jump over the critical value.

use std::sync::atomic::AtomicBool;

use nalgebra::DVector;

use super::branch::{End, SAME, interpolated, predicted};
use super::critical::{Critical, Point};
use super::cycle::Type;
use super::event::{EXACT, Kind, REFINEMENTS};
use crate::error::{Error, unless_cancelled};
use crate::integrate::State;
use crate::model::Parameter;
use crate::model::pendulum::Symmetry;

/// The first, the longest and the shortest step.
const FIRST: f64 = 0.01;
const LONGEST: f64 = 0.12;
const SHORTEST: f64 = 1e-8;
/// Change of the tangent and of the prediction by Newton's method over the step that a step aims at; it is refused
/// at [`MOST`] times as much.
const TURN: f64 = 0.2;
const MOVED: f64 = 0.04;
const MOST: f64 = 2.5;
/// Ratios of successive steps.
const CHANGE: [f64; 2] = [0.25, 2.0];
/// Points of a curve at most, and the fastest motion of an orbit.
const POINTS: usize = 5_000;
const FASTEST: f64 = 1e3;
/// A step this short, and so many of them in a row that the curve runs along another one, too near to be told apart.
const SHORT: f64 = 1e-3;
const CRAWLS: usize = 60;
/// An interpolated place between two points is this near to the curve, in parts of their distance.
const CLOSE: f64 = 0.1;
/// A multiplier this far from the critical one is not critical.
const VAGUE: f64 = 1e-5;
/// A drive below this is none.
const STILL: f64 = 1e-9;
/// A coefficient that vanishes is at most this part of those beside it.
const ZERO: f64 = 1e-4;

/// What a point of codimension 2 is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Degenerate {
    /// Two curves of folds meet in a tip.
    Cusp,
    /// The doubling changes between super- and subcritical.
    GeneralisedDoubling,
    /// The symmetry breaking does.
    SymmetryBreaking,
    /// A curve of folds, doublings or symmetry breakings reaches one where slips and sticks change.
    Reached(Kind),
}

impl Degenerate {
    /// Its name.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Cusp => "cusp",
            Self::GeneralisedDoubling => "generalised_doubling",
            Self::SymmetryBreaking => "degenerate_symmetry_breaking",
            Self::Reached(Kind::Fold) => "fold_at_event",
            Self::Reached(Kind::PeriodDoubling) => "period_doubling_at_event",
            Self::Reached(_) => "symmetry_breaking_at_event",
        }
    }
}

/// The orbit of which another one is born, near the end of a curve.
#[derive(Clone, Debug)]
pub struct Met {
    /// Its type.
    pub of: Type,
    /// Its points.
    pub points: Vec<State>,
    /// The coordinates.
    pub at: [f64; 2],
}

/// Points in the order of the curve, those of codimension 2 among them, and the end after the last one.
#[derive(Clone, Debug)]
pub struct Run {
    /// The points.
    pub points: Vec<Point>,
    /// Points of codimension 2, by their indices.
    pub degenerate: Vec<(Degenerate, usize)>,
    /// Why the curve ends.
    pub end: End,
    /// What it ends on.
    pub met: Option<Met>,
}

impl Critical<'_> {
    /// The curve from `first` on in the sense of its tangent.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` is set.
    pub fn followed(&self, first: &Point, cancel: &AtomicBool) -> Result<Run, Error> {
        let end = End::Lost(first.orbit.norm);
        let mut run = Run { points: vec![first.clone()], degenerate: Vec::new(), end, met: None };
        let (mut length, mut refused) = (FIRST, None);
        let mut crawled = 0;
        while run.points.len() < POINTS {
            unless_cancelled(cancel)?;
            let here = run.points[run.points.len() - 1].clone();
            if length < SHORTEST {
                run.end = refused.unwrap_or(End::Lost(here.orbit.norm));
                break;
            }
            let (next, factor) = match self.step(&run.points, length, &mut refused) {
                Ok(found) => found,
                Err(factor) => {
                    length *= factor;
                    continue;
                }
            };
            if let Some((end, met)) = self.meets(&here, &next) {
                (run.end, run.met) = (end, Some(met));
                break;
            }
            if self.is_vague(&next) {
                run.end = End::Lost(next.orbit.norm);
                break;
            }
            if self.is_undriven(&next.orbit.place) {
                run.end = End::Undriven;
                break;
            }
            if next.orbit.place.amax() > FASTEST {
                run.end = End::Fast;
                break;
            }
            if !Self::at(&next.orbit.place).iter().all(|x| (0.0..=1.0).contains(x)) {
                let Some(last) = self.edge(&here, &next) else {
                    length *= CHANGE[0];
                    continue;
                };
                let coefficient = self.coefficient(&last, false);
                let p = self.cycles.course.pendulum(&Self::at(&last.orbit.place)).drive.p;
                self.add(&mut run, &here, Point { coefficient, ..last });
                run.end = if p.abs() > f64::MIN_POSITIVE { End::Range } else { End::Undriven };
                break;
            }
            let closes = run.points.len() > 2 && self.is_between(&first.orbit.place, &here, &next);
            let last = if closes { Point { orbit: first.orbit.clone(), ..next } } else { next };
            self.add(&mut run, &here, last);
            if closes {
                run.end = End::Closed;
                break;
            }
            crawled = if length < SHORT { crawled + 1 } else { 0 };
            if crawled > CRAWLS {
                run.end = End::Lost(here.orbit.norm);
                break;
            }
            length = (length * factor).min(LONGEST);
        }
        Ok(run)
    }

    /// The next point with the part of the step that the following one may have; otherwise the part of it to try again.
    /// `refused` keeps why the last one was.
    fn step(
        &self,
        points: &[Point],
        length: f64,
        refused: &mut Option<End>,
    ) -> Result<(Point, f64), f64> {
        let here = &points[points.len() - 1];
        let before = points.len().checked_sub(2).map(|k| &points[k].orbit);
        let guess = predicted(before, &here.orbit, length);
        let found = self.near(&guess, &here.orbit.tangent, Some(&here.border));
        let Some(mut next) = found else {
            *refused = None;
            return Err(CHANGE[0]);
        };
        let alike = next.orbit.phases == here.orbit.phases && next.orbit.stuck == here.orbit.stuck;
        if !alike && self.kind != Kind::RestBoundary {
            // The curve has a kink there, and goes on if the shortest step leads to it.
            if !next.orbit.stuck && length * CHANGE[0] < SHORTEST && next.orbit.moved < length {
                next.coefficient = self.coefficient(&next, false);
                return Ok((next, CHANGE[1]));
            }
            *refused = Some(if next.orbit.stuck { End::Sticks } else { End::Phases });
            return Err(CHANGE[0]);
        }
        let turn = here.orbit.tangent.dot(&next.orbit.tangent).clamp(-1.0, 1.0).acos();
        let worst = (turn / TURN).max(next.orbit.moved / (MOVED * length));
        if worst > MOST {
            *refused = None;
            return Err((0.9 / worst).clamp(CHANGE[0], 0.5));
        }
        if next.orbit.orientation != here.orbit.orientation {
            *refused = Some(End::Crossing);
            return Err(CHANGE[0]);
        }
        next.coefficient = self.coefficient(&next, false);
        Ok((next, (1.0 / worst).clamp(0.5, CHANGE[1])))
    }

    /// Whether rounding hides that a multiplier is critical.
    fn is_vague(&self, point: &Point) -> bool {
        if self.kind.is_of_friction() {
            return false;
        }
        // The product of the distances of both multipliers from it, and about that of the other one.
        let tests = point.orbit.tests;
        let test = tests[usize::from(self.multiplier() < 0.0)];
        let other = 1.0 + 0.5 * (tests[1] - tests[0]).abs();
        test.abs() > VAGUE * other
    }

    /// Whether nothing drives the pendulum there: without damping all rotations at one velocity have the multiplier 1.
    pub(super) fn is_undriven(&self, place: &DVector<f64>) -> bool {
        let mut still = self.cycles.course.pendulum(&Self::at(place));
        let weak = still.drive.p.abs() < STILL;
        still.set(Parameter::P, 0.0);
        weak && still.is_autonomous()
    }

    /// The coefficient of the normal form, precise or to some digits; not a number where it is not known.
    pub(super) fn coefficient(&self, point: &Point, precise: bool) -> f64 {
        if self.kind == Kind::Fold || self.kind.is_of_friction() {
            return point.coefficient;
        }
        self.cubic(point, precise).unwrap_or(f64::NAN)
    }

    /// What a curve ends on between two points where no multiplier says so: orbits with half the period or more symmetry.
    fn meets(&self, here: &Point, next: &Point) -> Option<(End, Met)> {
        if !(self.kind == Kind::Fold || self.kind.is_of_friction()) {
            return None;
        }
        let (of, _, part) = self.cycles.met_type(&here.orbit, &next.orbit)?;
        let place = interpolated(&here.orbit, &next.orbit, part);
        let rest = of.closure == super::cycle::Closure::Rest;
        let points = if rest { vec![[of.centre, 0.0]] } else { self.points(&place) };
        let end = if rest { End::Rest } else { End::Parent };
        Some((end, Met { of, points, at: Self::at(&place) }))
    }

    /// A place with this coordinate between two points, by Hermite's cubic.
    fn guess(a: &Point, b: &Point, axis: usize, goal: f64) -> Option<DVector<f64>> {
        let entry = a.orbit.place.len() - 2 + axis;
        let [low, high] = [a, b].map(|one| one.orbit.place[entry]);
        let part = (goal - low) / (high - low);
        if !(0.0..=1.0).contains(&part) {
            return None;
        }
        let mut guess = interpolated(&a.orbit, &b.orbit, part);
        guess[entry] = goal;
        Some(guess)
    }

    /// The point with this coordinate between two.
    pub(super) fn between(&self, a: &Point, b: &Point, axis: usize, goal: f64) -> Option<Point> {
        let guess = Self::guess(a, b, axis, goal)?;
        let entry = guess.len() - 2 + axis;
        let mut row = DVector::zeros(guess.len());
        row[entry] = (b.orbit.place[entry] - a.orbit.place[entry]).signum();
        let mut found = self.near(&guess, &row, Some(&a.border))?;
        found.orbit.place[entry] = goal;
        let strayed = found.orbit.moved > (&b.orbit.place - &a.orbit.place).norm();
        (!strayed && found.orbit.tangent.dot(&a.orbit.tangent) > 0.0).then_some(found)
    }

    /// The point on the edge of the plane between two.
    fn edge(&self, here: &Point, next: &Point) -> Option<Point> {
        let [from, to] = [here, next].map(|point| Self::at(&point.orbit.place));
        let passed = |axis: usize| {
            let goal = if to[axis] < 0.0 { 0.0 } else { 1.0 };
            let part = (goal - from[axis]) / (to[axis] - from[axis]);
            (!(0.0..=1.0).contains(&to[axis])).then_some((part, axis, goal))
        };
        let first = [0, 1].into_iter().filter_map(passed).min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, axis, goal) = first?;
        self.between(here, next, axis, goal)
    }

    /// Whether an orbit of this type with both coordinates, or its mirror image, is on the curve between two points.
    #[must_use]
    pub fn is_between(&self, place: &DVector<f64>, a: &Point, b: &Point) -> bool {
        let at = Self::at(place);
        let near = CLOSE * (&b.orbit.place - &a.orbit.place).norm();
        [0, 1].into_iter().any(|axis| {
            let same = |found: &DVector<f64>, within: f64| {
                let apart = Self::at(found)[1 - axis] - at[1 - axis];
                apart.abs() < within && self.is_same(found, place, within)
            };
            Self::guess(a, b, axis, at[axis]).is_some_and(|guess| same(&guess, near.max(SAME)))
                && self
                    .between(a, b, axis, at[axis])
                    .is_some_and(|found| same(&found.orbit.place, SAME))
        })
    }

    /// Whether two places have the same orbit, or mirror images.
    fn is_same(&self, a: &DVector<f64>, b: &DVector<f64>, within: f64) -> bool {
        let angle = self.cycles.course.base.angle();
        let mirrored = self.cycles.symmetry == Some(Symmetry::AtOnce) && self.cycles.of.w == 0;
        let within = within * self.cycles.root();
        let first = self.points(b)[0];
        let image = [-first[0], -first[1]];
        self.all_points(a).into_iter().any(|point| {
            let near = |state: State| angle.distance(point, state) < within;
            near(first) || mirrored && near(image)
        })
    }

    /// The numbers whose zeros are points of codimension 2: of which side and which test; none for the coefficient.
    fn numbers(&self) -> Vec<(Degenerate, Option<[usize; 2]>)> {
        let of_side = |side: usize| {
            let kinds = [Kind::Fold, self.cycles.at_minus_one()].into_iter().enumerate();
            kinds.map(move |(test, kind)| (Degenerate::Reached(kind), Some([side, test])))
        };
        match self.kind {
            Kind::Fold => vec![(Degenerate::Cusp, None)],
            Kind::PeriodDoubling => vec![(Degenerate::GeneralisedDoubling, None)],
            Kind::SymmetryBreaking => vec![(Degenerate::SymmetryBreaking, None)],
            // A turn that becomes a stick reverses ever more slowly: multipliers are continuous.
            Kind::StickOnset => of_side(0).collect(),
            Kind::Grazing => (0..2).flat_map(of_side).collect(),
            _ => Vec::new(),
        }
    }

    /// Adds a point, and before it those of codimension 2.
    fn add(&self, run: &mut Run, here: &Point, next: Point) {
        let mut all: Vec<(f64, Degenerate, Point)> = Vec::new();
        for (kind, of) in self.numbers() {
            if here.number(of) * next.number(of) < 0.0
                && let Some(point) = self.zero(here, &next, of)
            {
                let along = here.orbit.tangent.dot(&(&point.orbit.place - &here.orbit.place));
                all.push((along, kind, point));
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, kind, point) in all {
            run.degenerate.push((kind, run.points.len()));
            run.points.push(point);
        }
        run.points.push(next);
    }

    /// The point between two at which a number vanishes, by false position with the value at an end that is kept
    /// twice halved (the Illinois variant).
    fn zero(&self, a: &Point, b: &Point, of: Option<[usize; 2]>) -> Option<Point> {
        let mut ends = [(0.0, a.number(of)), (1.0, b.number(of))];
        let (mut best, mut stayed): (Option<Point>, _) = (None, None);
        for _ in 0..REFINEMENTS {
            let [(low, at_low), (high, at_high)] = ends;
            let part = (low * at_high - high * at_low) / (at_high - at_low);
            let guess = interpolated(&a.orbit, &b.orbit, part);
            let mut point = self.near(&guess, &a.orbit.tangent, Some(&a.border))?;
            point.coefficient = self.coefficient(&point, true);
            let value = point.number(of);
            let side = usize::from(value.signum() != at_low.signum());
            let known = (part - ends[side].0).abs() < EXACT || high - low < EXACT;
            ends[side] = (part, value);
            if stayed == Some(side) {
                ends[1 - side].1 *= 0.5;
            }
            stayed = Some(side);
            if best.as_ref().is_none_or(|least| value.abs() <= least.number(of).abs()) {
                best = Some(point);
            }
            if value == 0.0 || known || value.is_nan() {
                break;
            }
        }
        // The signs at the ends are those of some digits alone.
        let least = ZERO * a.number(of).abs().max(b.number(of).abs());
        best.filter(|point| point.number(of).abs() < least)
    }

    /// What a jump of a multiplier does at a point where slips and sticks change: over 1 the branch turns back, over -1 an
    /// orbit of twice the period or a pair of asymmetric ones is born.
    #[must_use]
    pub fn jumped(&self, point: &Point) -> Option<Kind> {
        let [one, other] = point.beside;
        if one[0] * other[0] < 0.0 {
            Some(Kind::Fold)
        } else {
            (one[1] * other[1] < 0.0).then(|| self.cycles.at_minus_one())
        }
    }
}

impl Point {
    /// A test on one side where slips and sticks change, or the coefficient.
    fn number(&self, of: Option<[usize; 2]>) -> f64 {
        of.map_or(self.coefficient, |[side, test]| self.beside[side][test])
    }
}
