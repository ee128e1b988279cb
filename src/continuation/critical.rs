//! Orbits at which something happens, in the plane of two coordinates: zeros of the closing system and of one number more.
//!
//! Where slips and sticks change that number is one of [`super::edge`], and for the boundary of rest the excess of the load
//! where it is least. Otherwise a multiplier is critical. The matrix `W` of [`Cycles::weak`] is singular where `m` is a multiplier. Bordered by two vectors,
//! `W v + b g = 0`, `c v = 1`, it is regular there, and `g = 0` says that `W` is singular (minimally augmented system;
//! Govaerts 2000, Numerical Methods for Bifurcations of Dynamical Equilibria, chapter 4). With `w` of the transposed
//! system, `dg = -w dW v`. `dW v` is the derivative of the map's first derivatives along `v`: a difference of exact ones, whose
//! error changes the steps of Newton's method alone, not where they end.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::cycle::{Closure, Cycles, FARTHEST, Orbit, System, bordered};
use super::event::Kind;
use super::period::{Image, Period};
use crate::attractor::rest::balances;
use crate::integrate::State;

/// Newton's steps at most and the part of the step before that a step may have, from beside the curve and from afar; a
/// step of rounding.
const ITERATIONS: [usize; 2] = [9, 16];
const CONTRACTION: [f64; 2] = [0.3, 0.9];
const SETTLED: f64 = 1e-12;
/// Where steps no longer shrink, a gap below this is one of rounding.
const STALLED: f64 = 1e-11;
/// A gap of this many units of rounding is none.
const ROUNDING: f64 = 256.0 * f64::EPSILON;
/// Displacement along `v` of the difference for a second derivative, near the cube root of rounding.
const BESIDE: f64 = 6e-6;
/// The number of a change of slips and sticks at which orbits beside it are looked at.
const ACROSS: f64 = 1e-9;
/// Displacement of the difference for a derivative of the least load.
const APART: f64 = 1e-6;

/// Orbits of one type at which something happens. The two coordinates of the course run from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct Critical<'a> {
    /// The orbits.
    pub cycles: Cycles<'a>,
    /// What happens on the curve.
    pub kind: Kind,
}

/// The vectors that border the matrix: left and right; empty where no multiplier is critical.
#[derive(Clone, Debug)]
pub struct Border([DVector<f64>; 2]);

/// A point of a curve.
#[derive(Clone, Debug)]
pub struct Point {
    /// The orbit; its place ends with both coordinates, its tangent is that of the curve.
    pub orbit: Orbit,
    /// Left and right null vectors, of length 1, which turn continuously along the curve.
    pub border: Border,
    /// At a fold the coefficient of the square along the null vector, which vanishes at a cusp; else that of the cube
    /// ([`Critical::cubic`]), not a number where it is not known. Both have the signs of the null vectors.
    pub coefficient: f64,
    /// Where slips and sticks change: [`Orbit::tests`] on both sides, that of fewer sticks first.
    pub beside: [[f64; 2]; 2],
}

/// One more equation: its value, its derivatives by the place, the null vectors, the coefficient of the square.
type Condition = (f64, DVector<f64>, Border, f64);

impl Critical<'_> {
    /// The multiplier of the map that closes.
    #[must_use]
    pub fn multiplier(&self) -> f64 {
        match (self.kind, self.cycles.of.closure) {
            (Kind::Fold, _) | (Kind::SymmetryBreaking, Closure::Rest) => 1.0,
            _ => -1.0,
        }
    }

    /// The number of coordinates of orbits; rest has none.
    fn moving(&self) -> usize {
        if self.cycles.of.closure == Closure::Rest { 0 } else { 2 * self.cycles.count() }
    }

    /// The place of an orbit through these points.
    #[must_use]
    pub fn place(&self, points: &[State], at: [f64; 2]) -> DVector<f64> {
        let root = self.cycles.root();
        let numbers = points.iter().flatten().map(|x| x / root).take(self.moving()).chain(at);
        DVector::from_iterator(self.moving() + 2, numbers)
    }

    /// The two coordinates of a place.
    #[must_use]
    pub fn at(place: &DVector<f64>) -> [f64; 2] {
        let count = place.len();
        [place[count - 2], place[count - 1]]
    }

    /// The points of a place.
    #[must_use]
    pub fn points(&self, place: &DVector<f64>) -> Vec<State> {
        if self.kind == Kind::RestBoundary {
            let sides = balances(&self.cycles.course.pendulum(&Self::at(place)));
            vec![[sides[usize::from(self.cycles.of.centre.cos() < 0.0)], 0.0]]
        } else if self.moving() == 0 {
            vec![[self.cycles.of.centre, 0.0]]
        } else {
            self.cycles.points(place)
        }
    }

    /// The points of the whole orbit, angles not wrapped.
    #[must_use]
    pub fn all_points(&self, place: &DVector<f64>) -> Vec<State> {
        if self.moving() == 0 { self.points(place) } else { self.cycles.all_points(place) }
    }

    /// Images of the parts of several laps.
    pub(super) fn images(&self, map: &Period<'_, 4>, laps: &[Vec<State>]) -> Vec<Vec<Image>> {
        let [whole, half] = self.cycles.parts();
        let some = |from: usize, to: usize, part: f64| {
            let states: Vec<State> = laps.iter().flat_map(|lap| &lap[from..to]).copied().collect();
            map.images(&states, part).into_iter()
        };
        let (mut first, mut last) = (some(0, whole, 1.0), some(whole, whole + half, 0.5));
        let lap = |_| first.by_ref().take(whole).chain(last.by_ref().take(half)).collect();
        laps.iter().map(lap).collect()
    }

    /// Points displaced along a vector.
    pub(super) fn beside(points: &[State], along: &DVector<f64>, by: f64) -> Vec<State> {
        let moved = |(i, point): (usize, &State)| {
            [point[0] + by * along[2 * i], point[1] + by * along[2 * i + 1]]
        };
        points.iter().enumerate().map(moved).collect()
    }

    /// The sign of the map at each part: that of the closing map at the last.
    pub(super) fn factors(&self) -> Vec<f64> {
        let mut factors = vec![1.0; self.cycles.count()];
        if let Some(last) = factors.last_mut() {
            *last = self.cycles.closing().0;
        }
        factors
    }

    /// The border at orbits whose derivatives these are, of which one has nearly the multiplier.
    fn border(&self, parts: &[Matrix2<f64>]) -> Option<Border> {
        let svd = self.cycles.weak(parts, self.multiplier()).svd(true, true);
        let least = svd.singular_values.imin();
        Some(Border([svd.u?.column(least).into(), svd.v_t?.row(least).transpose()]))
    }

    /// The system at a place, the null vectors and the coefficient of the square.
    fn system(
        &self,
        place: &DVector<f64>,
        border: Option<&Border>,
        steps: usize,
    ) -> Option<(System, Border, f64)> {
        let at = Self::at(place);
        let map = Period::<4>::new(self.cycles.course, &at).by(steps).watching(self.kind);
        let points = self.points(place);
        let (count, moving) = (points.len(), self.moving());
        let images = self.images(&map, std::slice::from_ref(&points)).pop()?;
        let (g, row, border, bend) = match self.kind {
            Kind::RestBoundary => self.held(place),
            Kind::StickOnset | Kind::Grazing => self.touching(&images)?,
            _ => self.singular(&map, &points, &images, border)?,
        };
        let mut gap = DVector::zeros(moving + 1);
        let mut matrix = DMatrix::zeros(moving + 1, moving + 2);
        gap[moving] = g;
        matrix.row_mut(moving).copy_from(&row.transpose());
        let factors = self.factors();
        for (i, image) in images.iter().enumerate().take(if moving == 0 { 0 } else { count }) {
            self.cycles.close((i, image), &points, &mut gap, &mut matrix);
            for row in 0..2 {
                for k in 0..2 {
                    matrix[(2 * i + row, moving + k)] = factors[i] * image.by_course[k][row];
                }
            }
        }
        let norm = images.iter().map(|image| image.by_state.norm()).fold(0.0, f64::max);
        let finite = gap.iter().chain(matrix.iter()).all(|x| x.is_finite());
        finite.then_some((System { gap, matrix, images, norm }, border, bend))
    }

    /// That friction holds rest for ever at one angle alone.
    fn held(&self, place: &DVector<f64>) -> Condition {
        let excess = |axis: usize, by: f64| {
            let mut beside = place.clone();
            beside[axis] += by;
            let [[theta, _]] = self.points(&beside)[..] else { return f64::NAN };
            self.cycles.course.pendulum(&Self::at(&beside)).equation().excess(theta)
        };
        let slope = |axis, _| (excess(axis, APART) - excess(axis, -APART)) / (2.0 * APART);
        (excess(0, 0.0), DVector::from_fn(2, slope), Border::none(), f64::NAN)
    }

    /// That the number along the motion which is nearest to 0 vanishes.
    fn touching(&self, images: &[Image]) -> Option<Condition> {
        let numbers = images.iter().enumerate();
        let all = numbers.flat_map(|(i, image)| image.edges.iter().map(move |edge| (i, edge)));
        let (i, (value, slope)) = all.min_by(|a, b| a.1.0.abs().total_cmp(&b.1.0.abs()))?;
        let (moving, root) = (self.moving(), self.cycles.root());
        let mut row = DVector::zeros(moving + 2);
        for k in 0..2 {
            row[2 * i + k] = root * slope[k];
            row[moving + k] = slope[2 + k];
        }
        Some((*value, row, Border::none(), f64::NAN))
    }

    /// That the multiplier is critical.
    fn singular(
        &self,
        map: &Period<'_, 4>,
        points: &[State],
        images: &[Image],
        border: Option<&Border>,
    ) -> Option<Condition> {
        let (moving, root) = (self.moving(), self.cycles.root());
        let parts: Vec<Matrix2<f64>> = images.iter().map(|image| image.by_state).collect();
        let own;
        let border = if let Some(border) = border {
            border
        } else {
            own = self.border(&parts)?;
            &own
        };
        let (weak, Border([b, c])) = (self.cycles.weak(&parts, self.multiplier()), border);
        let (right, g) = null_vector(&weak, b, c)?;
        let (left, _) = null_vector(&weak.transpose(), c, b)?;
        let sides = [BESIDE, -BESIDE].map(|by| Self::beside(points, &right, by / right.norm()));
        let sides = self.images(map, &sides);
        let per_unit = right.norm() / (2.0 * BESIDE);

        let factors = self.factors();
        let mut by_place = DVector::zeros(moving + 2);
        let mut square = 0.0;
        for (i, factor) in factors.iter().enumerate() {
            let w = Vector2::new(left[2 * i], left[2 * i + 1]) * *factor;
            let turned = (sides[0][i].by_state - sides[1][i].by_state) * per_unit;
            let along = Vector2::new(right[2 * i], right[2 * i + 1]);
            square += w.dot(&(turned * along));
            for k in 0..2 {
                let moved = (sides[0][i].by_course[k] - sides[1][i].by_course[k]) * per_unit;
                by_place[moving + k] -= w.dot(&moved);
                if moving > 0 {
                    by_place[2 * i + k] = -root * w.dot(&turned.column(k));
                }
            }
        }
        // Without the lengths of the vectors.
        let sizes = [left.norm(), right.norm()];
        let bend = square / (sizes[0] * sizes[1] * sizes[1]);
        let border = Border([left / sizes[0], right / sizes[1]]);
        Some((g, by_place, border, bend))
    }

    /// Equal steps of a period there.
    fn steps(&self, place: &DVector<f64>) -> usize {
        Period::<4>::count(self.cycles.course, &Self::at(place))
    }

    /// The point of the curve near `guess` in the plane through it across `row`, by Newton's method; its tangent has the sense
    /// of `row`. `border` is that of a neighbour; none from afar.
    #[must_use]
    pub fn near(
        &self,
        guess: &DVector<f64>,
        row: &DVector<f64>,
        border: Option<&Border>,
    ) -> Option<Point> {
        let steps = self.steps(guess);
        let mut place = guess.clone();
        let mut before = FARTHEST;
        let mut kept = border.cloned();
        let far = usize::from(border.is_none());
        for _ in 0..ITERATIONS[far] {
            let (system, vectors, bend) = self.system(&place, kept.as_ref(), steps)?;
            let size = place.amax().max(1.0);
            let rounding = ROUNDING * (1.0 + system.norm) * size;
            let gap = system.gap.amax();
            if gap <= rounding || (before < SETTLED * size && gap < rounding.sqrt()) {
                return self.complete(&place, guess, &system, row, vectors, bend);
            }
            let count = system.gap.len();
            let mut right = system.gap.clone().insert_row(count, 0.0);
            right[count] = row.dot(&(&place - guess));
            let step = bordered(&system.matrix, row).solve(&right)?;
            let length = step.norm();
            let grows = length > CONTRACTION[far] * before && length > SETTLED * size;
            if grows && gap < STALLED * (1.0 + system.norm) * size {
                // No more than rounding is left.
                return self.complete(&place, guess, &system, row, vectors, bend);
            }
            if !length.is_finite() || grows {
                return None;
            }
            kept = kept.or(Some(vectors));
            before = length;
            place -= step;
        }
        None
    }

    /// The point at a place where the curve is not alone, with the null vector for a tangent.
    pub(super) fn degenerate(&self, place: &DVector<f64>) -> Option<Point> {
        let (system, border, coefficient) = self.system(place, None, self.steps(place))?;
        let [_, right] = border.vectors();
        let tangent = right.clone().resize_vertically(place.len(), 0.0);
        let orbit = self.cycles.finished(place.clone(), &system, tangent, true, 0.0);
        Some(Point { orbit, border, coefficient, beside: [[f64::NAN; 2]; 2] })
    }

    fn complete(
        &self,
        place: &DVector<f64>,
        guess: &DVector<f64>,
        system: &System,
        row: &DVector<f64>,
        border: Border,
        bend: f64,
    ) -> Option<Point> {
        let factors = bordered(&system.matrix, row);
        let count = system.gap.len();
        let mut last = DVector::zeros(count + 1);
        last[count] = 1.0;
        let tangent = factors.solve(&last)?.normalize();
        let orientation = factors.determinant() > 0.0;
        let moved = (place - guess).norm();
        let seen = |system: &System| {
            self.cycles.finished(place.clone(), system, tangent.clone(), orientation, moved)
        };
        if !matches!(self.kind, Kind::StickOnset | Kind::Grazing) {
            let beside = [[f64::NAN; 2]; 2];
            return Some(Point { orbit: seen(system), border, coefficient: bend, beside });
        }
        let slope = system.matrix.row(count - 1).transpose();
        let across = &slope * (ACROSS / slope.norm_squared());
        let side =
            |by: f64| Some(seen(&self.system(&(place + &across * by), None, self.steps(place))?.0));
        let (orbit, near, far) = (side(1.0)?, side(-1.0)?, side(-4.0)?);
        // Where a stick appears derivatives change with the root of the distance, otherwise with the distance.
        let other = std::array::from_fn(|k| 2.0 * near.tests[k] - far.tests[k]);
        let beside = [orbit.tests, other];
        Some(Point { orbit, border, coefficient: bend, beside })
    }
}

impl Border {
    /// None.
    fn none() -> Self {
        Self([DVector::zeros(0), DVector::zeros(0)])
    }

    /// The left and the right vector.
    #[must_use]
    pub fn vectors(&self) -> [&DVector<f64>; 2] {
        let Self([left, right]) = self;
        [left, right]
    }

    /// The product of both at the section, over which coefficients are those of the map that closes.
    #[must_use]
    pub fn scalar(&self) -> f64 {
        let [left, right] = self.vectors();
        left.rows(left.len() - 2, 2).dot(&right.rows(0, 2))
    }
}

/// The solution of `W v + b g = 0`, `c v = 1`.
fn null_vector(
    weak: &DMatrix<f64>,
    b: &DVector<f64>,
    c: &DVector<f64>,
) -> Option<(DVector<f64>, f64)> {
    let count = weak.nrows();
    let mut whole = weak.clone().resize(count + 1, count + 1, 0.0);
    whole.view_mut((0, count), (count, 1)).copy_from(b);
    whole.view_mut((count, 0), (1, count)).copy_from(&c.transpose());
    let mut last = DVector::zeros(count + 1);
    last[count] = 1.0;
    let solved = whole.lu().solve(&last)?;
    let g = solved[count];
    Some((solved.rows(0, count).into(), g))
}
