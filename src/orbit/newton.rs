//! Periodic orbits of the stroboscopic map by Newton's method.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use super::floquet::{Multipliers, multipliers};
use super::kink::{KinkedRest, PRECISE};
use super::poincare::{Image, PoincareMap};
use crate::integrate::State;
use crate::model::Angle;

/// Largest `|P^n(x) - x|` of a converged orbit, if rounding allows it.
pub const RESIDUAL: f64 = 1e-12;
/// Rounding error of a point, times the derivative: the least residual that rounding allows.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// Largest relative deviation of a period's contraction of area from the exact product.
pub const PRODUCT: f64 = 1e-9;
const ITERATIONS: usize = 16;
/// By this iteration the gap must have fallen tenfold, or the start was too far.
const PROMISING: usize = 5;
/// Points closer than this are one point of the orbit.
const SAME_POINT: f64 = 1e-8;
/// Distance within which points belong to one orbit.
pub const SAME: f64 = 1e-6;

/// A periodic orbit of the stroboscopic map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PeriodicOrbit {
    /// Smallest period, in forcing periods, modulo a turn.
    pub n: usize,
    /// Net turns over those periods.
    pub w: i64,
    /// The orbit's points in their order, the first with the lowest angle.
    pub points: Vec<State>,
    /// `|P^n(x) - x|`.
    pub residual: f64,
    /// Eigenvalues of the derivative of `P^n`; at a rest on a kink those of [`KinkedRest::multipliers`].
    pub multipliers: Multipliers,
    /// Derivative of `P^n` at each point.
    pub monodromy: Vec<Matrix2<f64>>,
    /// Topology of the angle.
    pub angle: Angle,
}

impl PeriodicOrbit {
    /// Whether both multipliers lie inside the unit circle.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.multipliers.largest() < 1.0
    }

    /// Its image under `(th, v) -> (-th, -v)`, and the number of places that the points have moved:
    /// point `i` of this orbit is point `i - moved` (modulo n) of the image.
    ///
    /// An orbit of the same pendulum where that has the symmetry; the derivatives are the same.
    #[must_use]
    pub fn mirrored(&self) -> (Self, usize) {
        let mut image = self.clone();
        for point in &mut image.points {
            *point = [-point[0], -point[1]];
        }
        image.w = -self.w;
        let moved = lowest(&image.points);
        image.points.rotate_left(moved);
        image.monodromy.rotate_left(moved);
        (image, moved)
    }

    /// Whether `state` is one of its points, within `tolerance`.
    #[must_use]
    pub fn contains(&self, state: State, tolerance: f64) -> bool {
        self.points.iter().any(|p| self.angle.distance(*p, state) < tolerance)
    }

    /// Whether the other is this orbit: its first point is one of the points of this one.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.contains(other.points[0], SAME)
    }
}

/// Newton's method on `P^n(x) - x` from `start`; then the smallest period that divides `n`.
///
/// `None` if it does not converge to a residual below [`RESIDUAL`], or below what rounding leaves where
/// the derivative of `P^n` is large, wanders further than `reach`, or if phase area does not shrink by
/// the product that the damping and the turns give it.
#[must_use]
pub fn find(map: &PoincareMap, start: State, n: usize, reach: f64) -> Option<PeriodicOrbit> {
    find_other(map, start, n, reach, &[])
}

/// A periodic orbit near `start` that has none of the points `known`; see [`find_others`].
#[must_use]
pub fn find_other(
    map: &PoincareMap,
    start: State,
    n: usize,
    reach: f64,
    known: &[State],
) -> Option<PeriodicOrbit> {
    find_others(map, &[(start, n)], reach, known).pop()
}

/// The periodic orbits near `starts`, each with a period, that have none of the points `known`; starts that
/// lead to one point give one orbit.
///
/// The gap is divided by the distances to them, `m(x) = prod (1 + 1/|x - r|^2)` times `P^n(x) - x`, which has
/// its zeros but for theirs: Newton's method is repelled by what it has found already, and finds
/// zeros that lie next to one another (Farrell, Birkisson & Funke 2015, SIAM J. Sci. Comput. 37,
/// A2026: deflation).
#[must_use]
pub fn find_others(
    map: &PoincareMap,
    starts: &[(State, usize)],
    reach: f64,
    known: &[State],
) -> Vec<PeriodicOrbit> {
    let mut points = polish(map, starts, reach, known);
    if !known.is_empty() {
        // Near several zeros the gap is small everywhere: repeated without deflation.
        let reached: Vec<_> = points.into_iter().flatten().collect();
        points = polish(map, &reached, reach, &[]);
    }
    let mut apart: Vec<(State, usize)> = Vec::new();
    for (point, n) in points.into_iter().flatten() {
        if apart.iter().all(|(other, _)| map.angle.distance(*other, point) >= SAME_POINT) {
            apart.push((point, n));
        }
    }
    orbits_of(map, &apart, reach).into_iter().flatten().collect()
}

/// [`find`] from each of several starts with its own period.
#[must_use]
pub fn find_each(
    map: &PoincareMap,
    starts: &[(State, usize)],
    reach: f64,
) -> Vec<Option<PeriodicOrbit>> {
    let points = polish(map, starts, reach, &[]);
    let closed: Vec<_> = points.iter().flatten().copied().collect();
    let mut orbits = orbits_of(map, &closed, reach).into_iter();
    points.into_iter().map(|point| point.and_then(|_| orbits.next()?)).collect()
}

/// The orbits of points that close after some periods, with their smallest periods.
fn orbits_of(
    map: &PoincareMap,
    closed: &[(State, usize)],
    reach: f64,
) -> Vec<Option<PeriodicOrbit>> {
    let wrapped =
        |&([theta, velocity], n): &(State, usize)| ([map.angle.wrapped(theta), velocity], n);
    let firsts: Vec<(State, usize)> = closed.iter().map(wrapped).collect();
    let orbit = |((first, n), course): (&(State, usize), Vec<Image>)| {
        // Beside its doubling a shorter orbit is known to less than rounding, as one of twice the period.
        let returns = |d: &usize| map.angle.distance(course[d - 1].state, *first) < SAME;
        let smallest = (1..*n).filter(|d| n.is_multiple_of(*d)).find(returns);
        match smallest {
            Some(d) => {
                let closed = polish(map, &[(*first, d)], reach, &[]).pop()??;
                orbits_of(map, &[closed], reach).pop()?
            }
            None => complete(map, *first, &course),
        }
    };
    firsts.iter().zip(map.courses(&firsts)).map(orbit).collect()
}

/// The index of the point with the lowest angle.
fn lowest(points: &[State]) -> usize {
    (0..points.len()).min_by(|a, b| points[*a][0].total_cmp(&points[*b][0])).unwrap_or(0)
}

/// The least resolvable gap.
fn least_gap(derivative: &Matrix2<f64>) -> f64 {
    RESIDUAL.max(ROUNDING * derivative.norm())
}

/// The iteration of Newton's method from one start.
struct Iteration {
    start: State,
    n: usize,
    point: State,
    /// First ratio of the gap to the least one.
    first: f64,
    /// Least ratio, and where.
    best: Option<(f64, State)>,
}

/// The points with the least gaps that Newton's method reaches from `starts`, with their periods; none of those
/// that do not converge.
fn polish(
    map: &PoincareMap,
    starts: &[(State, usize)],
    reach: f64,
    known: &[State],
) -> Vec<Option<(State, usize)>> {
    let begun = |(start, n): &(State, usize)| {
        let start = [map.angle.wrapped(start[0]), start[1]];
        Iteration { start, n: *n, point: start, first: f64::INFINITY, best: None }
    };
    let mut iterations: Vec<Iteration> = starts.iter().map(begun).collect();
    let mut going: Vec<usize> = (0..iterations.len()).collect();
    for iteration in 0..ITERATIONS {
        let points: Vec<_> =
            going.iter().map(|k| (iterations[*k].point, iterations[*k].n)).collect();
        let images = map.iterate_all(&points);
        let mut images = images.iter();
        going.retain(|k| {
            images
                .next()
                .is_some_and(|image| iterations[*k].step(map, image, iteration, reach, known))
        });
        if going.is_empty() {
            break;
        }
    }
    let converged = |one: Iteration| {
        one.best.filter(|(least, _)| *least < 1.0).map(|(_, point)| (point, one.n))
    };
    iterations.into_iter().map(converged).collect()
}

impl Iteration {
    /// Steps on from the image of the point; false where the iteration ends.
    fn step(
        &mut self,
        map: &PoincareMap,
        image: &Image,
        iteration: usize,
        reach: f64,
        known: &[State],
    ) -> bool {
        let gap = map.gap(self.point, image.state);
        let size = gap.norm() / least_gap(&image.derivative);
        if iteration == 0 {
            self.first = size;
        }
        // Near an unstable orbit the gap grows first.
        if iteration == PROMISING && known.is_empty() && size > 0.1 * self.first && size > 1.0 {
            return false;
        }
        if !size.is_finite() || map.angle.distance(self.point, self.start) > reach {
            return false;
        }
        match self.best {
            // At the level of rounding the gap no longer falls: the iteration ends.
            Some((least, _)) if size >= least && least < 1.0 => return false,
            Some((least, _)) if size >= least => {}
            _ => self.best = Some((size, self.point)),
        }
        // None if all nearby states close too, as about rest without damping and drive.
        let Some(step) = (Matrix2::identity() - image.derivative).lu().solve(&gap) else {
            return false;
        };
        let step = repelled(map.angle, step, self.point, known);
        let length = step.norm();
        let damped = if length > 0.5 { 0.5 / length } else { 1.0 };
        self.point = [self.point[0] + damped * step[0], self.point[1] + damped * step[1]];
        true
    }
}

/// Newton's step of the gap times `m(x)`: along the step of the gap, over `1 - step . grad m / m`.
fn repelled(angle: Angle, step: Vector2<f64>, point: State, known: &[State]) -> Vector2<f64> {
    let mut slope = 0.0;
    for other in known {
        let away = Vector2::new(angle.wrapped(point[0] - other[0]), point[1] - other[1]);
        let square = away.norm_squared();
        slope -= 2.0 * away.dot(&step) / (square * (1.0 + square));
    }
    let stretched = step / (1.0 - slope);
    if stretched.norm().is_finite() { stretched } else { step }
}

/// The orbit from `first` on, from the images of each of its periods.
fn complete(map: &PoincareMap, first: State, course: &[Image]) -> Option<PeriodicOrbit> {
    let n = course.len();
    let mut points = Vec::with_capacity(n);
    let mut derivatives = Vec::with_capacity(n);
    let mut products = Vec::with_capacity(n);
    let mut travel = 0.0;
    let mut state = first;
    for image in course {
        points.push(state);
        derivatives.push(image.derivative);
        products.push(image.product);
        // Not only by the turns removed: a point at pi may come back at -pi.
        travel += image.turns as f64 * TAU + image.state[0] - state[0];
        state = image.state;
    }
    let w = (travel / TAU).round() as i64;
    let residual = map.gap(first, state).norm();
    if n == 1
        && first[1].abs() < SAME_POINT
        && let Some(rest) = KinkedRest::of(&map.pendulum, first[0])
    {
        return Some(PeriodicOrbit {
            n,
            w,
            points: vec![[rest.theta, 0.0]],
            residual,
            multipliers: rest.multipliers(PRECISE),
            monodromy: vec![rest.along(Vector2::new(1.0, 0.0))],
            angle: map.angle,
        });
    }
    let lowest = lowest(&points);
    points.rotate_left(lowest);
    derivatives.rotate_left(lowest);
    products.rotate_left(lowest);
    let monodromy: Vec<Matrix2<f64>> = (0..n)
        .map(|start| (0..n).fold(Matrix2::identity(), |m, k| derivatives[(start + k) % n] * m))
        .collect();
    // Where no law gives it, the product is the determinant, and nothing is checked.
    let product: Option<f64> = products.iter().copied().product();
    let multipliers = multipliers(&monodromy[0], product.unwrap_or(monodromy[0].determinant()));
    // Relative to the products whose difference a determinant is: under strong damping these are
    // all that rounding leaves.
    let area_shrinks = derivatives.iter().zip(&products).all(|(m, product)| {
        let (ad, bc) = (m[(0, 0)] * m[(1, 1)], m[(0, 1)] * m[(1, 0)]);
        product.is_none_or(|each| {
            (ad - bc - each).abs() <= PRODUCT * (ad.abs() + bc.abs() + each.abs())
        })
    });
    (area_shrinks && residual < 10.0 * least_gap(&monodromy[0])).then_some(PeriodicOrbit {
        n,
        w,
        points,
        residual,
        multipliers,
        monodromy,
        angle: map.angle,
    })
}
