//! Where a branch ends on another one, of orbits with half the period or more symmetry.
//!
//! The difference of an orbit from such a one falls to 0 there, and would change its sign beyond: the orbits come back as
//! their own images. So the end is found by that sign, and located on the other branch by its multiplier.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector2;

use super::branch::{End, interpolated};
use super::cycle::{Closure, Cycles, Orbit, Type};
use super::period::Period;
use crate::integrate::State;
use crate::model::pendulum::Symmetry;

/// Largest step of a difference that passes 0.
const NEAR: f64 = 0.5;
/// A difference below this is none.
const NONE: f64 = 1e-9;
/// Steps of the secant method, its first one and its last one in units of the coordinate.
const REFINEMENTS: usize = 12;
const FIRST: f64 = 1e-6;
const EXACT: f64 = 1e-14;

/// An orbit that may be met: its type, which of its tests vanishes there, and half the difference from it.
type Special = (Type, usize, Vector2<f64>);

impl Cycles<'_> {
    /// The orbits with half the period or more symmetry of which this one may be born.
    fn special(&self, orbit: &Orbit) -> Vec<Special> {
        let points = self.points(&orbit.place);
        let Type { n, w, closure, .. } = self.of;
        let even = n.is_multiple_of(2);
        let difference = |a: State, b: State| {
            let turn = TAU * ((a[0] - b[0]) / TAU).round();
            Vector2::new(a[0] - b[0] - turn, a[1] - b[1]) * 0.5
        };
        let first = points[0];
        let image = |state: State| [-state[0], -state[1]];
        let centre = PI * (first[0] / PI).round();
        let rest = Type { n: 1, w: 0, closure: Closure::Rest, centre };
        let about = |point: State| PI * ((first[0] + point[0]) / TAU).round();
        let half = |centre| Type { n, w: 0, closure: Closure::Half, centre };
        let mut all = Vec::new();
        match (closure, self.symmetry) {
            (Closure::Half, Some(Symmetry::AtOnce)) => {
                all.push((rest, 1, difference(first, image(first))));
            }
            (Closure::Whole, symmetry) => {
                if even {
                    let shorter = Type { n: n / 2, w: w / 2, ..self.of };
                    all.push((shorter, 1, difference(first, points[n / 2])));
                }
                let at_once = symmetry == Some(Symmetry::AtOnce) && w == 0;
                if at_once && n == 1 {
                    all.push((rest, 0, difference(first, image(first))));
                } else if at_once && even {
                    let opposite = points[n / 2];
                    all.push((half(about(opposite)), 1, difference(first, image(opposite))));
                }
                if symmetry == Some(Symmetry::HalfPeriod) && w == 0 && !even {
                    let map = Period::<3>::new(self.course, &[self.at(&orbit.place)]);
                    for one in map.images(&points[n / 2..=n / 2], 0.5) {
                        let apart = difference(first, image(one.state));
                        all.push((half(about(one.state)), 1, apart));
                    }
                }
            }
            _ => {}
        }
        all
    }

    /// The end of the branch between two orbits on one with more symmetry, and the orbit there.
    pub(super) fn meeting(&self, here: &Orbit, next: &Orbit) -> Option<(End, Orbit)> {
        let both = [here, next].map(|orbit| self.special(orbit));
        let passes = |(a, b): &(&Special, &Special)| {
            let (a, b) = (a.2, b.2);
            (a.dot(&b) < 0.0 || b.norm() < NONE) && (a - b).norm() < NEAR
        };
        let (a, b) = both[0].iter().zip(&both[1]).find(passes)?;
        let part = a.2.norm() / (a.2.norm() + b.2.norm());
        let between = interpolated(here, next, part);
        let place = self.met((a.0, a.1), &between).unwrap_or(between);
        let last = self.unfollowed(&place)?;
        let end = if a.0.closure == Closure::Rest { End::Rest } else { End::Parent };
        Some((end, Orbit { tangent: here.tangent.clone(), orientation: here.orientation, ..last }))
    }

    /// The orbit of another type near a place at which one of its tests vanishes, by the secant method, as an orbit of this
    /// type.
    fn met(
        &self,
        (of, test): (Type, usize),
        near: &nalgebra::DVector<f64>,
    ) -> Option<nalgebra::DVector<f64>> {
        let other = Cycles { of, ..*self };
        let mut points = self.points(near);
        if of.closure == Closure::Rest {
            points = vec![[of.centre, 0.0]];
        }
        points.truncate(other.count());
        let mut place = other.place(&points, self.at(near));
        let last = place.len() - 1;
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..REFINEMENTS {
            let orbit = other.near(&place, &other.along())?;
            let (at, value) = (orbit.place[last], orbit.tests[test]);
            let step = match before {
                None => FIRST,
                Some((x, y)) => -value * (at - x) / (value - y),
            };
            if step.abs() < EXACT || !step.is_finite() {
                let mut points = other.repeated(&orbit, self);
                let turn = TAU * ((self.points(near)[0][0] - points[0][0]) / TAU).round();
                for point in &mut points {
                    point[0] += turn;
                }
                return Some(self.place(&points, other.at(&orbit.place)));
            }
            before = Some((at, value));
            place = orbit.place;
            place[last] += step;
        }
        None
    }
}
