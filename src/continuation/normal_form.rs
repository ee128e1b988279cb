//! The cubic coefficient at a doubling or at a symmetry breaking.
//!
//! At the distance `e` along the null vector `v` the new orbit is `x + e v + e^2 u`, by the order `e^2` of the closing
//! system with `u = -W(1)^-1 B(v, v) / 2`: `u` closes like the old orbit. The order `e^3` is
//! `mu + c e^2 = 0` for the change `mu` of the multiplier, with `c = w (C(v, v, v) / 6 + B(v, u)) / (w v)`
//! (Kuznetsov 2004, Elements of Applied Bifurcation Theory, section 5.4.2). About rest `B = 0`.
//!
//! `B` and `C` are the second and third derivatives of the map. They are differences of exact first derivatives on both
//! sides: at three distances without the first two terms of the error, or at one where some digits do.

use nalgebra::{DVector, Matrix2, Vector2};

use super::critical::{Critical, Point};
use super::cycle::Closure;
use super::event::Kind;
use super::period::{Image, Period};

/// The longest displacement along the null vector, and its halvings at most: until the differences at it and at half of it
/// are this near to one another, over the size of what is projected on `w`.
const BESIDE: f64 = 0.032;
const HALVINGS: usize = 12;
const ALIKE: f64 = 0.02;
/// Displacements that are tried at once, to fill the lanes.
const BATCH: usize = 4;
/// The part of that displacement at which the coefficient is precise.
const PRECISE: f64 = 0.125;
/// A product of the null vectors below this is 0.
const NONE: f64 = 1e-9;
/// The part of all steps of the integrator that is enough for a sign.
const COARSE: f64 = 0.6;
/// Weights of differences at distances 1, 2 and 3 that leave errors of the sixth power.
const WEIGHTS: [f64; 3] = [1.5, -0.6, 0.1];

impl Critical<'_> {
    /// Whether the new orbits live beyond the loss of stability of the old one; none at folds, where that is not known, and
    /// without damping.
    #[must_use]
    pub fn is_supercritical(&self, point: &Point) -> Option<bool> {
        let c = point.coefficient;
        if self.kind == Kind::Fold || !c.is_finite() {
            return None;
        }
        let scalar = point.border.scalar();
        (scalar.abs() > NONE).then_some(self.multiplier() * c * scalar < 0.0)
    }

    /// The coefficient `w v c`; none where the sequence of phases changes nearby.
    #[must_use]
    pub fn cubic(&self, point: &Point, precise: bool) -> Option<f64> {
        let mut before: Option<f64> = None;
        for batch in 0..HALVINGS / BATCH {
            let halved = |k: usize| BESIDE * 0.5_f64.powi((batch * BATCH + k) as i32);
            let distances: [f64; BATCH] = std::array::from_fn(halved);
            let laps = self.displaced(point, &distances, COARSE);
            for (distance, laps) in distances.iter().zip(&laps) {
                let laps = std::slice::from_ref(laps);
                let Some([here, size]) = self.cubic_within(point, &[*distance], laps, &[1.0])
                else {
                    continue;
                };
                if before.is_some_and(|before| (here - before).abs() < ALIKE * size) {
                    if !precise {
                        return Some(here);
                    }
                    let distances = [1.0, 2.0, 3.0].map(|k| k * PRECISE * distance);
                    let laps = self.displaced(point, &distances, 1.0);
                    return Some(self.cubic_within(point, &distances, &laps, &WEIGHTS)?[0]);
                }
                before = Some(here);
            }
        }
        None
    }

    /// The images of points displaced by distances along the null vector and against it, by a part of the steps.
    fn displaced(&self, point: &Point, distances: &[f64], steps: f64) -> Vec<[Vec<Image>; 2]> {
        let place = &point.orbit.place;
        let [_, right] = point.border.vectors();
        let points = self.points(place);
        let at = Self::at(place);
        let count = Period::<4>::count(self.cycles.course, &at) as f64 * steps;
        let map = Period::<4>::new(self.cycles.course, &at).by(count as usize);
        let both = distances.iter().flat_map(|by| [*by, -by]);
        let laps: Vec<_> = both.map(|by| Self::beside(&points, right, by)).collect();
        let mut images = self.images(&map, &laps).into_iter();
        let pair = |_| images.next().zip(images.next()).map(|(above, below)| [above, below]);
        distances.iter().filter_map(pair).collect()
    }

    /// The coefficient by differences at some distances, and the size of what is projected on `w`.
    fn cubic_within(
        &self,
        point: &Point,
        distances: &[f64],
        laps: &[[Vec<Image>; 2]],
        weights: &[f64],
    ) -> Option<[f64; 2]> {
        let [left, right] = point.border.vectors();
        let phases =
            |lap: &[Image]| lap.iter().map(|image| image.phases.clone()).collect::<Vec<_>>();
        let own = phases(&laps[0][0]);
        if laps.iter().flatten().any(|lap| phases(lap) != own) {
            return None;
        }
        // Of each part, the first derivatives' derivative along `v`, and the second one.
        let (factors, count) = (self.factors(), point.orbit.parts.len());
        let mut first = vec![Matrix2::zeros(); count];
        let mut second = vec![Matrix2::zeros(); count];
        for ((by, pair), weight) in distances.iter().zip(laps).zip(weights) {
            let shares = first.iter_mut().zip(&mut second).enumerate();
            for (i, (first, second)) in shares {
                let [above, below] = [0, 1].map(|side| pair[side][i].by_state);
                let twice = point.orbit.parts[i] * 2.0;
                *first += (above - below) * (weight * factors[i] / (2.0 * by));
                *second += (above - twice + below) * (weight * factors[i] / by.powi(2));
            }
        }
        let of = |vector: &DVector<f64>, i: usize| Vector2::new(vector[2 * i], vector[2 * i + 1]);
        let mut bent = DVector::zeros(2 * count);
        if self.cycles.of.closure != Closure::Rest {
            for (i, first) in first.iter().enumerate() {
                bent.rows_mut(2 * i, 2).copy_from(&(first * of(right, i) * -0.5));
            }
            bent = self.cycles.weak(&point.orbit.parts, 1.0).lu().solve(&bent)?;
        }
        let third = |i: usize| second[i] * of(right, i) / 6.0 + first[i] * of(&bent, i);
        let sum: f64 = (0..count).map(|i| of(left, i).dot(&third(i))).sum();
        Some([sum, (0..count).map(|i| third(i).norm()).sum()])
    }
}
