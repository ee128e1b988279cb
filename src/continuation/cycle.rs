//! Closed orbits as zeros of a system over their points, one a period (multiple shooting).
//!
//! An orbit `n:w` closes after `n` periods: `P(x_i) = x_(i+1)`, `P(x_(n-1)) = x_0 + (2 pi w, 0)`. No long product of
//! derivatives is formed, so no digits are lost with its norm.
//!
//! **Symmetry.** Where `S(theta, v) = (-theta, -v)` maps motions to motions at the same phase (vertical drive, no
//! torque), `S P = P S`. An orbit that is its own mirror image has `S x = P^k x` for some `k`; applied twice,
//! `P^(2k) x = x`, where the turns cancel. So `2k` is a multiple of `n`, and `w = 0`. Either `k = n/2` with `n` even:
//! then `x` is a fixed point of the half map `H = S P^(n/2)`. Or `k = 0`, `S x = x` up to a turn: rest, hanging or inverted.
//! Symmetric orbits with odd `n`, or with turns, do not exist otherwise. The half map has `H^2 = P^n`: multipliers of the
//! orbit are squares of its own, so they pass 1 where one of `H` passes 1, a fold, or -1, a symmetry breaking, and never
//! both; without a negative product they cannot pass -1, and symmetric orbits do not double (Swift & Wiesenfeld 1984,
//! Phys. Rev. Lett. 52, 705).
//!
//! Where the mirrored motion needs half a period (a direct drive), `S P_half` takes the place of `S`: then symmetric orbits
//! have odd `n`, and the half map is `S` after `n/2` periods, which ends with half a one.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, Dyn, LU, Matrix2};

pub use super::closure::{Closure, Type};
use super::course::Course;
use super::event::Kind;
use super::period::{Image, Period};
use super::phases::{Phase, round};
use crate::integrate::State;
use crate::model::pendulum::Symmetry;
use crate::orbit::floquet::multipliers;
use crate::orbit::kink::PRECISE;
use crate::orbit::{KinkedRest, Multipliers};

/// Newton's steps at most, and the part of the step before that a step may have.
const ITERATIONS: usize = 8;
const CONTRACTION: f64 = 0.3;
/// The step that the first one contracts from: a long one leads to motions far beyond the branch.
pub(super) const FARTHEST: f64 = 10.0;
/// A gap of this many units of rounding is none.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Within this many times as much steps that do not shrink are those of rounding.
const NOISE: f64 = 100.0;
/// A gap that is none where steps of the integrator are long.
const ROUGH: f64 = 1e-10;
/// A step below this is one of rounding.
const SETTLED: f64 = 1e-13;
/// Under friction a velocity below this is 0.
const STILL: f64 = 1e-12;

/// Orbits of one type along a course of one coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Cycles<'a> {
    /// The course.
    pub course: &'a Course,
    /// The type.
    pub of: Type,
    /// The symmetry along the whole course.
    pub symmetry: Option<Symmetry>,
    /// Origin and unit of the coordinate in which distances along a branch are measured: the start of the range and its
    /// length.
    pub origin: f64,
    /// See `origin`.
    pub scale: f64,
}

/// A closed orbit, and what is known of its neighbours.
#[derive(Clone, Debug)]
pub struct Orbit {
    /// Points, one a period, angles not wrapped, over the root of their number; last the coordinate in its unit.
    pub place: DVector<f64>,
    /// Unit vector along the branch.
    pub tangent: DVector<f64>,
    /// Whether the determinant of the system bordered by the tangent is positive: it keeps its sign along a branch without a
    /// branching point.
    pub orientation: bool,
    /// `det(M - 1)` and `det(M + 1)` of the derivative `M` of the map that closes.
    pub tests: [f64; 2],
    /// The determinant of `M`, and whether it follows from a law.
    pub product: (f64, bool),
    /// Derivative of each part of the motion.
    pub parts: Vec<Matrix2<f64>>,
    /// Phases under friction, see [`round`].
    pub phases: Vec<Phase>,
    /// The phase at each of its points: where it changes, so does the derivative by the points.
    pub section: Vec<Phase>,
    /// Whether friction holds it for ever, or will: without a turn, slips of one sense alone do not close, they fade.
    pub stuck: bool,
    /// Distance from where Newton's method began.
    pub moved: f64,
    /// Largest norm of a derivative.
    pub norm: f64,
    /// Whether the map is differentiable there: not at rest on a kink of the load.
    pub smooth: bool,
}

impl Orbit {
    /// Whether the map is smooth from this orbit to the other: slips and sticks are the same.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        self.phases == other.phases && self.section == other.section
    }
}

/// The system at one place.
pub(super) struct System {
    pub(super) gap: DVector<f64>,
    /// Its derivatives by the place.
    pub(super) matrix: DMatrix<f64>,
    pub(super) images: Vec<Image>,
    /// Largest norm of a derivative.
    pub(super) norm: f64,
}

impl Cycles<'_> {
    /// The numbers of whole periods, and of half ones at the end, of the motion that closes.
    #[must_use]
    pub fn parts(&self) -> [usize; 2] {
        match (self.of.closure, self.symmetry) {
            (Closure::Half, Some(Symmetry::HalfPeriod)) => [self.of.n / 2, 1],
            (Closure::Half, _) => [self.of.n / 2, 0],
            _ => [self.of.n, 0],
        }
    }

    /// The number of points.
    #[must_use]
    pub fn count(&self) -> usize {
        self.parts().iter().sum()
    }

    pub(super) fn root(&self) -> f64 {
        (self.count() as f64).sqrt()
    }

    /// The place of an orbit through these points.
    #[must_use]
    pub fn place(&self, points: &[State], at: f64) -> DVector<f64> {
        let root = self.root();
        let numbers = points.iter().flatten().map(|x| x / root).chain([self.along_range(at)]);
        DVector::from_iterator(2 * points.len() + 1, numbers)
    }

    /// The points of a place.
    #[must_use]
    pub fn points(&self, place: &DVector<f64>) -> Vec<State> {
        let root = self.root();
        (0..self.count()).map(|i| [place[2 * i] * root, place[2 * i + 1] * root]).collect()
    }

    /// The coordinate of a place.
    #[must_use]
    pub fn at(&self, place: &DVector<f64>) -> f64 {
        self.origin + place[place.len() - 1] * self.scale
    }

    /// A coordinate from the origin on, in the unit.
    #[must_use]
    pub fn along_range(&self, at: f64) -> f64 {
        (at - self.origin) / self.scale
    }

    /// All coordinates of a place.
    #[must_use]
    pub fn coordinates(&self, place: &DVector<f64>) -> Vec<f64> {
        let first = place.len() - self.course.axes.len();
        place.iter().skip(first).map(|x| self.origin + x * self.scale).collect()
    }

    /// The unit vector along the coordinate.
    #[must_use]
    pub fn along(&self) -> DVector<f64> {
        let mut unit = DVector::zeros(2 * self.count() + 1);
        unit[2 * self.count()] = 1.0;
        unit
    }

    /// The sign of the closing map, and its shift.
    pub(super) fn closing(&self) -> (f64, f64) {
        match self.of.closure {
            Closure::Whole | Closure::Rest => (1.0, -TAU * self.of.w as f64),
            Closure::Half => (-1.0, 2.0 * self.of.centre),
        }
    }

    fn system(&self, place: &DVector<f64>, count: usize) -> Option<System> {
        let at = self.at(place);
        let map = Period::<3>::new(self.course, &[at]).by(count);
        let mut points = self.points(place);
        if map.rubs() {
            for point in points.iter_mut().filter(|point| point[1].abs() < STILL) {
                point[1] = 0.0;
            }
        }
        let [whole, half] = self.parts();
        let mut images = map.images(&points[..whole], 1.0);
        if half > 0 {
            images.extend(map.images(&points[whole..], 0.5));
        }
        let count = points.len();
        let mut gap = DVector::zeros(2 * count);
        let mut matrix = DMatrix::zeros(2 * count, 2 * count + 1);
        let mut norm = 0.0_f64;
        for (i, image) in images.iter().enumerate() {
            let factor = if i + 1 == count { self.closing().0 } else { 1.0 };
            self.close((i, image), &points, &mut gap, &mut matrix);
            for row in 0..2 {
                matrix[(2 * i + row, 2 * count)] = factor * self.scale * image.by_course[0][row];
            }
            norm = norm.max(image.by_state.norm());
        }
        let finite = gap.iter().chain(matrix.iter()).all(|x| x.is_finite());
        finite.then_some(System { gap, matrix, images, norm })
    }

    /// Adds to a system that an image is the next point: its gap, and the derivatives by the points.
    pub(super) fn close(
        &self,
        (i, image): (usize, &Image),
        points: &[State],
        gap: &mut DVector<f64>,
        matrix: &mut DMatrix<f64>,
    ) {
        let (count, root) = (points.len(), self.root());
        let last = i + 1 == count;
        let (sign, shift) = if last { self.closing() } else { (1.0, 0.0) };
        let next = points[(i + 1) % count];
        for row in 0..2 {
            let moved = if row == 0 { shift } else { 0.0 };
            gap[2 * i + row] = sign * image.state[row] + moved - next[row];
            for column in 0..2 {
                matrix[(2 * i + row, 2 * i + column)] +=
                    sign * root * image.by_state[(row, column)];
            }
            matrix[(2 * i + row, (2 * i + 2 + row) % (2 * count))] -= root;
        }
    }

    /// The orbit near `guess` in the plane through it across `row`, by Newton's method; its tangent has the sense
    /// of `row`.
    #[must_use]
    pub fn near(&self, guess: &DVector<f64>, row: &DVector<f64>) -> Option<Orbit> {
        let steps = self.steps(guess);
        if self.of.closure == Closure::Rest {
            let system = self.system(guess, steps)?;
            return self.complete(guess.clone(), &system, row, 0.0);
        }
        let mut place = guess.clone();
        let mut before = FARTHEST;
        for _ in 0..ITERATIONS {
            let system = self.system(&place, steps)?;
            let size = place.amax().max(1.0);
            let rounding = ROUNDING * (1.0 + system.norm) * size;
            let rounding = if self.course.is_rough() { rounding.max(ROUGH) } else { rounding };
            let gap = system.gap.amax();
            if gap <= rounding && self.course.is_rough() {
                let moved = (&place - guess).norm();
                return self.complete(place, &system, row, moved);
            }
            let count = system.gap.len();
            let mut right = system.gap.clone().insert_row(count, 0.0);
            right[count] = row.dot(&(&place - guess));
            let step = bordered(&system.matrix, row).solve(&right)?;
            let length = step.norm();
            // At the level of rounding steps no longer shrink.
            let stalls = gap <= NOISE * rounding && length > CONTRACTION * before;
            if gap <= rounding || stalls || before < SETTLED * size {
                let moved = (&place - guess).norm();
                return self.complete(place, &system, row, moved);
            }
            if !length.is_finite() || length > CONTRACTION * before {
                return None;
            }
            before = length;
            place -= step;
        }
        None
    }

    /// What the system is at a place where it does not close, with the direction of its kernel.
    pub(super) fn open(&self, place: &DVector<f64>, row: &DVector<f64>) -> Option<Orbit> {
        self.complete(place.clone(), &self.system(place, self.steps(place))?, row, 0.0)
    }

    /// The orbit at a place where it closes, without its direction along a branch.
    #[must_use]
    pub fn unfollowed(&self, place: &DVector<f64>) -> Option<Orbit> {
        let system = self.system(place, self.steps(place))?;
        Some(self.finished(place.clone(), &system, self.along(), true, 0.0))
    }

    /// Equal steps of a period there.
    fn steps(&self, place: &DVector<f64>) -> usize {
        Period::<3>::count(self.course, &[self.at(place)])
    }

    fn complete(
        &self,
        place: DVector<f64>,
        system: &System,
        row: &DVector<f64>,
        moved: f64,
    ) -> Option<Orbit> {
        let count = system.gap.len();
        let (tangent, orientation) = if self.of.closure == Closure::Rest {
            (row.clone(), row[count] > 0.0)
        } else {
            let factors = bordered(&system.matrix, row);
            let mut last = DVector::zeros(count + 1);
            last[count] = 1.0;
            let tangent = factors.solve(&last)?.normalize();
            (tangent, factors.determinant() > 0.0)
        };
        Some(self.finished(place, system, tangent, orientation, moved))
    }

    pub(super) fn finished(
        &self,
        place: DVector<f64>,
        system: &System,
        tangent: DVector<f64>,
        orientation: bool,
        moved: f64,
    ) -> Orbit {
        let parts: Vec<Matrix2<f64>> = system.images.iter().map(|image| image.by_state).collect();
        let kinked = self.kinked(&place);
        let tests = [1.0, -1.0].map(|m| match kinked {
            Some([sum, product]) => 1.0 - m * sum + product,
            None => self.weak(&parts, m).lu().determinant(),
        });
        let law: Option<f64> = system.images.iter().map(|image| image.product).product();
        let own = parts.iter().map(Matrix2::determinant).product();
        let phases = system.images.iter().flat_map(|image| image.phases.iter().copied());
        let phases: Vec<Phase> = match self.of.closure {
            Closure::Half => {
                let half: Vec<Phase> = phases.collect();
                round(half.iter().copied().chain(half.iter().map(|phase| phase.mirrored())))
            }
            _ => round(phases),
        };
        let section =
            system.images.iter().filter_map(|image| image.phases.first().copied()).collect();
        let held = system.images.iter().any(|image| image.held[1]);
        let both = [Phase::Forward, Phase::Backward].iter().all(|sense| phases.contains(sense));
        let stuck = held || self.of.w == 0 && !phases.is_empty() && !both;
        let product = match kinked {
            Some([_, product]) => (product, false),
            None => law.map_or((own, false), |law| (law, true)),
        };
        let norm = system.norm;
        Orbit {
            place,
            tangent,
            orientation,
            tests,
            product,
            parts,
            phases,
            section,
            stuck,
            moved,
            norm,
            smooth: kinked.is_none(),
        }
    }

    /// Sum and product of the multipliers of a rest on a kink of the load, see [`KinkedRest`].
    fn kinked(&self, place: &DVector<f64>) -> Option<[f64; 2]> {
        let [[theta, velocity]] = self.points(place)[..] else { return None };
        if velocity.abs() > STILL {
            return None;
        }
        let rest = KinkedRest::of(&self.course.pendulum(&self.coordinates(place)), theta)?;
        let Multipliers([a, b]) = rest.multipliers(PRECISE);
        Some([(a + b).re, (a * b).re])
    }

    /// The matrix whose determinant is `det(M - m)` and whose kernel holds the eigenvector at each point, if `m` is
    /// a multiplier of the closing map.
    #[must_use]
    pub fn weak(&self, parts: &[Matrix2<f64>], m: f64) -> DMatrix<f64> {
        let (count, sign) = (parts.len(), self.closing().0);
        let mut matrix = DMatrix::zeros(2 * count, 2 * count);
        for (i, part) in parts.iter().enumerate() {
            let last = i + 1 == count;
            let factor = if last { sign } else { 1.0 };
            for row in 0..2 {
                for column in 0..2 {
                    matrix[(2 * i + row, 2 * i + column)] += factor * part[(row, column)];
                }
                matrix[(2 * i + row, (2 * i + 2 + row) % (2 * count))] -=
                    if last { m } else { 1.0 };
            }
        }
        matrix
    }

    /// The eigenvector of the closing map for the multiplier `m`, at each point, of length 1 as a whole.
    #[must_use]
    pub fn eigenvector(&self, orbit: &Orbit, m: f64) -> Option<DVector<f64>> {
        let svd = self.weak(&orbit.parts, m).svd(false, true);
        let least = svd.singular_values.imin();
        Some(svd.v_t?.row(least).transpose())
    }

    /// What happens where the closing map has the multiplier -1.
    pub(super) fn at_minus_one(&self) -> Kind {
        if self.of.closure == Closure::Half { Kind::SymmetryBreaking } else { Kind::PeriodDoubling }
    }

    /// Multipliers of the orbit.
    #[must_use]
    pub fn multipliers(&self, orbit: &Orbit) -> Multipliers {
        let [plus, minus] = orbit.tests;
        let half = Matrix2::identity() * (0.25 * (minus - plus));
        let own = multipliers(&half, orbit.product.0);
        match self.of.closure {
            Closure::Half => Multipliers(own.0.map(|m| m * m)),
            _ => own,
        }
    }

    /// The points of the whole orbit, angles not wrapped.
    #[must_use]
    pub fn all_points(&self, place: &DVector<f64>) -> Vec<State> {
        let mut points = self.points(place);
        if self.of.closure != Closure::Half {
            return points;
        }
        let [whole, half] = self.parts();
        let centre = self.of.centre;
        let image = |state: State| [2.0 * centre - state[0], -state[1]];
        if half == 0 {
            points.extend(points.clone().into_iter().map(image));
            return points;
        }
        // The second half passes the section half a period after the mirrored points of the first.
        let map = Period::<3>::new(self.course, &self.coordinates(place));
        let first = map.images(&points[..whole], 0.5);
        points.extend(first.into_iter().map(|between| image(between.state)));
        points
    }
}

/// The factors of a system with one more row.
pub(super) fn bordered(matrix: &DMatrix<f64>, row: &DVector<f64>) -> LU<f64, Dyn, Dyn> {
    let count = matrix.nrows();
    let mut whole = matrix.clone().insert_row(count, 0.0);
    whole.row_mut(count).copy_from(&row.transpose());
    whole.lu()
}
