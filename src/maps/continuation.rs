//! Critical amplitudes under a torque, when rest is an orbit of the drive's period.
//!
//! The orbit that rest becomes as the torque grows from 0 is sought from values of `p` with stable
//! rest, and along the amplitudes with a multiplier -1, since a stable interval may shift by more
//! than its length. Then it is continued along `p`, both ways, by Newton's method, up to folds, at
//! which a multiplier is +1 and the orbit ends.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Vector2};

use super::chebyshev::Values;
use super::tongues::{Balance, Curve, bordered, gap, is_stable, under};
use crate::integrate::State;
use crate::model::Pendulum;
use crate::orbit::PoincareMap;
use crate::orbit::newton::SAME;

/// Newton's steps onto the orbit, and the gap at which it has converged, in units of the rounding
/// error.
const ITERATIONS: usize = 8;
const RESIDUAL: f64 = 1e-12;
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Steps of the root of `p`, in units of the frequency: solutions turn and grow by a small part.
const STEP: f64 = 0.05;
/// A step is accepted if Newton's method moves the predicted point by at most this.
const NEAR: f64 = 0.1;
/// The least step in `p`; the first and the least step of the torque, in parts of it.
const LEAST_STEP: f64 = 1e-9;
const FIRST_SHARE: f64 = 0.25;
const LEAST_SHARE: f64 = 1e-4;
/// The next point is predicted from this number of points.
const FORESEEN: usize = 5;
/// A fold this near in `p` is located by extrapolation: the square of the gap falls linearly to it.
const AT_FOLD: f64 = 1e-7;
/// Starting values of `p` for orbits, as parts of a stable interval of the pendulum without torque.
const PLACES: [f64; 3] = [0.5, 0.02, 0.98];
/// The first step and the last one to a place with the multiplier -1: it is where an orbit is followed from.
const DOUBLED: f64 = 1e-6;
/// Refinements of a zero at most, and the last one's size in parts of `1 + p`.
const REFINEMENTS: usize = 40;
const EXACT: f64 = 1e-12;

/// The orbit at one `p`.
#[derive(Clone, Copy, Debug)]
struct Place {
    p: f64,
    point: State,
    /// Entries of its monodromy matrix by rows, and its determinant.
    monodromy: Values<5>,
}

/// The orbit as a function of `p`, with what happens on it.
struct Sheet {
    places: Vec<Place>,
    critical: Vec<(f64, f64)>,
}

struct Continuation<'a> {
    pendulum: &'a Pendulum,
    angle: f64,
    omega: f64,
    p_max: f64,
}

/// The critical amplitudes of the orbits that continue a balance, whose critical amplitudes without
/// torque are `level`'s.
pub(super) fn curve(pendulum: &Pendulum, balance: Balance, level: &Curve, p_max: f64) -> Curve {
    let omega = level.omega;
    let continuation = Continuation { pendulum, angle: balance.angle(), omega, p_max };
    let inner = level.stable_intervals(p_max).into_iter();
    let places = inner.flat_map(|[low, high]| PLACES.map(|part| low + part * (high - low)));
    let doubling = level.critical.iter().filter(|c| c.multiplier < 0.0).map(|c| c.p);
    let seeds = doubling.filter_map(|p| continuation.begun(p, true));
    let mut sheets: Vec<Sheet> = Vec::new();
    let all = seeds.chain(places.filter_map(|p| continuation.begun(p, false)));
    for seed in all.filter_map(|seed| continuation.within(seed)) {
        if !sheets.iter().any(|sheet| continuation.holds(sheet, &seed)) {
            sheets.push(continuation.sheet(seed));
        }
    }
    let critical = sheets.iter().flat_map(|sheet| sheet.critical.iter().copied()).collect();
    let stable = |p: f64| sheets.iter().any(|sheet| sheet.is_stable(p));
    let (critical, stable_at_first) = bordered(critical, p_max, stable);
    Curve { omega, critical, stable_at_first, fold: None }
}

impl Place {
    fn coordinates(&self) -> [f64; 3] {
        [self.point[0], self.point[1], self.p]
    }
}

impl Sheet {
    /// Whether the orbit exists and is stable, which holds from one critical amplitude to the next.
    fn is_stable(&self, p: f64) -> bool {
        let side = |q: f64| self.critical.iter().filter(|c| c.0 < q).count();
        let known = self.places.iter().filter(|place| side(place.p) == side(p));
        let [low, high] = [self.places.first(), self.places.last()].map(|end| end.map(|e| e.p));
        let within = low.is_some_and(|low| self.begin(low) <= p)
            && high.is_some_and(|high| p <= self.end(high));
        // The point farthest from the ends is the most reliable.
        within
            && known
                .min_by(|a, b| (a.p - p).abs().total_cmp(&(b.p - p).abs()))
                .is_some_and(|place| is_stable(place.monodromy))
    }

    /// The start of its range: at a fold a little before its first point.
    fn begin(&self, low: f64) -> f64 {
        self.critical.first().map_or(low, |c| c.0.min(low))
    }

    fn end(&self, high: f64) -> f64 {
        self.critical.last().map_or(high, |c| c.0.max(high))
    }
}

impl Continuation<'_> {
    /// The orbit of `pendulum` near `guess`.
    fn solved(&self, pendulum: &Pendulum, p: f64, guess: State) -> Option<Place> {
        let map = PoincareMap::new(&under(pendulum, p.max(f64::MIN_POSITIVE), self.omega));
        let mut point = guess;
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let image = map.once(point);
            let m = image.derivative;
            let moved = image.state[0] + TAU * image.turns as f64 - point[0];
            let gap = Vector2::new(moved, image.state[1] - point[1]);
            let size = gap.norm();
            if size < RESIDUAL.max(ROUNDING * m.norm()) {
                let product = image.product.unwrap_or(m.determinant());
                let monodromy = [m[(0, 0)], m[(0, 1)], m[(1, 0)], m[(1, 1)], product];
                return Some(Place { p, point, monodromy });
            }
            if size.is_nan() || size >= before {
                return None;
            }
            before = size;
            let step = (m - Matrix2::identity()).lu().solve(&gap)?;
            point = [point[0] - step[0], point[1] - step[1]];
        }
        None
    }

    /// The orbit that rest becomes as the torque grows from 0, at `p`, or at a multiplier of -1;
    /// none if it ends in a fold before.
    fn begun(&self, p: f64, doubling: bool) -> Option<Place> {
        let mut pendulum = self.pendulum.clone();
        let mut at = |share: f64, p: f64, guess: State| {
            pendulum.torque = share * self.pendulum.torque;
            let first = self.solved(&pendulum, p, guess)?;
            if doubling { self.doubled(&pendulum, first) } else { Some(first) }
        };
        let mut known = vec![(0.0, at(0.0, p, [self.angle, 0.0])?)];
        let mut step = FIRST_SHARE;
        loop {
            let (share, here) = known[known.len() - 1];
            if share >= 1.0 {
                return Some(here);
            }
            let next = f64::min(share + step.min(FIRST_SHARE), 1.0);
            let coordinates = known.iter().map(|(share, place)| (*share, place.coordinates()));
            let [theta, velocity, ahead] = foreseen(coordinates, next);
            let guess = [theta, velocity];
            let follows = |place: &Place| {
                let away = (place.p - ahead).abs() / (1.0 + ahead);
                continues(&here, place) && distance(place.point, guess).max(away) < NEAR
            };
            match at(next, ahead, guess).filter(follows) {
                Some(place) => {
                    known.push((next, place));
                    step *= 2.0;
                }
                None if step > LEAST_SHARE => step *= 0.5,
                None => return None,
            }
        }
    }

    /// The orbit with the multiplier -1 near one of another `p`, by the secant method.
    fn doubled(&self, pendulum: &Pendulum, near: Place) -> Option<Place> {
        let size = |place: &Place| gap(-1.0, place.monodromy);
        let mut before = near;
        let mut here = self.solved(pendulum, near.p + DOUBLED * (1.0 + near.p), near.point)?;
        for _ in 0..ITERATIONS {
            let step = size(&here) * (here.p - before.p) / (size(&here) - size(&before));
            if step.abs() > NEAR * (1.0 + here.p) || step.is_nan() || here.p <= step {
                return None;
            }
            let ratio = -step / (here.p - before.p);
            let guess = extrapolated(&before, &here, ratio);
            before = here;
            here = self.solved(pendulum, here.p - step, guess)?;
            if step.abs() < DOUBLED {
                return Some(here);
            }
        }
        None
    }

    /// This orbit within the requested range, if it reaches it.
    fn within(&self, seed: Place) -> Option<Place> {
        if seed.p <= self.p_max {
            return Some(seed);
        }
        self.followed(seed, self.p_max).0.pop().filter(|last| last.p <= self.p_max)
    }

    /// The whole orbit from one of its points, in both directions.
    fn sheet(&self, seed: Place) -> Sheet {
        let (mut places, begin) = self.followed(seed, 0.0);
        places.reverse();
        let (after, end) = self.followed(seed, self.p_max);
        places.extend(after.into_iter().skip(1));
        let mut critical: Vec<(f64, f64)> = begin.into_iter().map(|p| (p, 1.0)).collect();
        critical.extend(self.doublings(&places).into_iter().map(|p| (p, -1.0)));
        critical.extend(end.into_iter().map(|p| (p, 1.0)));
        Sheet { places, critical }
    }

    /// Points from `seed` up to `goal`, and the fold at which the orbit ends before it.
    fn followed(&self, seed: Place, goal: f64) -> (Vec<Place>, Option<f64>) {
        let mut places = vec![seed];
        let mut step = f64::INFINITY;
        loop {
            let here = places[places.len() - 1];
            let before = *places.get(places.len().wrapping_sub(2)).unwrap_or(&here);
            let away = goal - here.p;
            if away == 0.0 || (here.point[0] - self.angle).abs() > PI {
                return (places, None);
            }
            let fold = fold_ahead(&before, &here);
            if let Some(fold) = fold.filter(|fold| (fold - here.p).abs() < AT_FOLD) {
                return (places, Some(fold.max(0.0)));
            }
            let root = here.p.sqrt() + (STEP * self.omega).copysign(away);
            let usual = (root * root.abs() - here.p).abs();
            let ahead = fold.map_or(f64::INFINITY, |fold| 0.9 * (fold - here.p).abs());
            let length = usual.min(step).min(ahead).min(away.abs());
            // The goal itself, without rounding.
            let p = if length < away.abs() { here.p + length.copysign(away) } else { goal };
            let guess = foreseen(places.iter().map(|place| (place.p, place.point)), p);
            let next = self
                .solved(self.pendulum, p, guess)
                .filter(|next| continues(&here, next) && distance(next.point, guess) < NEAR);
            if let Some(next) = next {
                places.push(next);
                step = 2.0 * length;
            } else {
                step = 0.5 * length;
                if step < LEAST_STEP {
                    return (places, fold.map(|fold| fold.max(0.0)));
                }
            }
        }
    }

    /// Passages of a multiplier through -1, also pairs of them between two points.
    fn doublings(&self, places: &[Place]) -> Vec<f64> {
        let size = |place: &Place| gap(-1.0, place.monodromy);
        let mut found = Vec::new();
        for (i, both) in places.windows(2).enumerate() {
            if i > 0 && size(&both[0]).signum() == size(&both[1]).signum() {
                let inner = self.turned(&places[i - 1..=i + 1]);
                if let Some(inner) = inner {
                    found.extend(self.passed(&places[i - 1], &inner));
                    found.extend(self.passed(&inner, &both[1]));
                }
            }
            if size(&both[0]).signum() != size(&both[1]).signum() {
                found.extend(self.passed(&both[0], &both[1]));
            }
        }
        found
    }

    /// The orbit between two of its points.
    fn between(&self, a: &Place, b: &Place, p: f64) -> Option<Place> {
        let ratio = (p - a.p) / (b.p - a.p);
        self.solved(self.pendulum, p, extrapolated(b, a, -ratio))
    }

    /// The passage of a multiplier through -1 between two points, by false position; the value at
    /// an end that is kept twice is halved (the Illinois variant).
    fn passed(&self, a: &Place, b: &Place) -> Option<f64> {
        let size = |place: &Place| gap(-1.0, place.monodromy);
        let mut ends = [(*a, size(a)), (*b, size(b))];
        let (mut last, mut stayed) = (f64::INFINITY, None);
        for _ in 0..REFINEMENTS {
            let [(low, at_low), (high, at_high)] = ends;
            let p = (low.p * at_high - high.p * at_low) / (at_high - at_low);
            let middle = self.between(&low, &high, p)?;
            let value = size(&middle);
            if value == 0.0 || (p - last).abs() < EXACT * (1.0 + p) {
                return Some(p);
            }
            last = p;
            let moved = usize::from(value.signum() != at_low.signum());
            ends[moved] = (middle, value);
            if stayed == Some(1 - moved) {
                ends[1 - moved].1 *= 0.5;
            }
            stayed = Some(1 - moved);
        }
        Some(last)
    }

    /// The place among three on one side of -1 that lies on the other, next to the middle one.
    fn turned(&self, three: &[Place]) -> Option<Place> {
        let size = |place: &Place| gap(-1.0, place.monodromy);
        let sign = size(&three[1]).signum();
        let (mut a, mut b, mut c) = (three[0], three[1], three[2]);
        for _ in 0..REFINEMENTS {
            let [left, middle, right] = [&a, &b, &c].map(|place| sign * size(place));
            if middle < 0.0 {
                return Some(b);
            }
            if left <= middle || right <= middle || left < 0.0 || right < 0.0 {
                return None;
            }
            // The lowest point of the parabola through the three.
            let (before, after) = (b.p - a.p, c.p - b.p);
            let slopes = [(middle - left) / before, (right - middle) / after];
            let bend = (slopes[1] - slopes[0]) / (before + after);
            let p = 0.5 * (a.p + b.p) - 0.5 * slopes[0] / bend;
            let below = middle - bend * (p - b.p).powi(2);
            // It stays above -1 by more than the parabola may err.
            if (p - b.p).abs() < 1e-9 || below > 0.5 * middle && middle > 1e-6 {
                return None;
            }
            let next = self.between(&a, &c, p)?;
            if p < b.p { (b, c) = (next, b) } else { (a, b) = (b, next) }
        }
        None
    }

    /// Whether an orbit is on the sheet.
    fn holds(&self, sheet: &Sheet, seed: &Place) -> bool {
        let after = sheet.places.partition_point(|place| place.p < seed.p);
        let (Some(b), Some(a)) = (sheet.places.get(after), sheet.places.get(after.wrapping_sub(1)))
        else {
            return false;
        };
        self.between(a, b, seed.p).is_some_and(|same| distance(same.point, seed.point) < SAME)
    }
}

fn distance(a: State, b: State) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The point on the line through two points, `ratio` of their distance beyond the second.
fn extrapolated(a: &Place, b: &Place, ratio: f64) -> State {
    [0, 1].map(|k| b.point[k] + ratio * (b.point[k] - a.point[k]))
}

/// The extrapolation of the last of these values by Lagrange's formula.
fn foreseen<const N: usize>(
    values: impl ExactSizeIterator<Item = (f64, [f64; N])>,
    at: f64,
) -> [f64; N] {
    let skipped = values.len().saturating_sub(FORESEEN);
    let last: Vec<(f64, [f64; N])> = values.skip(skipped).collect();
    let weight = |k: usize| {
        let x = last[k].0;
        let others = (0..last.len()).filter(|other| *other != k).map(|other| last[other].0);
        others.map(|other| (at - other) / (x - other)).product::<f64>()
    };
    last.iter().enumerate().fold([0.0; N], |sum, (k, (_, value))| {
        let weight = weight(k);
        std::array::from_fn(|part| sum[part] + weight * value[part])
    })
}

/// Whether one place may follow another: not across a fold, where the gap to +1 changes its sign.
fn continues(here: &Place, next: &Place) -> bool {
    gap(1.0, here.monodromy).signum() == gap(1.0, next.monodromy).signum()
}

/// The zero of the square of the gap to +1 by linear extrapolation from two points.
fn fold_ahead(before: &Place, here: &Place) -> Option<f64> {
    let [first, second] = [before, here].map(|place| gap(1.0, place.monodromy).powi(2));
    (second < first).then(|| here.p + second * (here.p - before.p) / (first - second))
}
