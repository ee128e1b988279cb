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
const HALVINGS: i32 = 12;
const ALIKE: f64 = 0.02;
/// The part of that displacement at which the coefficient is precise.
const PRECISE: f64 = 0.125;
/// A product of the null vectors below this is 0.
const NONE: f64 = 1e-9;
/// Weights of differences at distances 1, 2 and 3 that leave errors of the sixth power.
const WEIGHTS: [f64; 3] = [1.5, -0.6, 0.1];

impl Critical<'_> {
    /// Whether the new orbits live beyond the loss of stability of the old one; none at folds, where that is not known, and
    /// without damping.
    #[must_use]
    pub fn is_supercritical(&self, point: &Point) -> Option<bool> {
        let (c, scalar) = (point.coefficient, point.border.scalar());
        let known = self.kind != Kind::Fold && c.is_finite() && scalar.abs() > NONE;
        known.then_some(self.multiplier() * c * scalar < 0.0)
    }

    /// The coefficient `w v c`; none where the sequence of phases changes nearby.
    #[must_use]
    pub fn cubic(&self, point: &Point, precise: bool) -> Option<f64> {
        let at = |distance: f64, weights: &[f64]| self.cubic_within(point, distance, weights);
        let mut before: Option<f64> = None;
        for k in 0..HALVINGS {
            let distance = BESIDE * 0.5_f64.powi(k);
            let Some([here, size]) = at(distance, &[1.0]) else { continue };
            if before.is_some_and(|before| (here - before).abs() < ALIKE * size) {
                let found = if precise { at(PRECISE * distance, &WEIGHTS)?[0] } else { here };
                return Some(found);
            }
            before = Some(here);
        }
        None
    }

    /// The coefficient by differences at a distance, and the size of what is projected on `w`.
    fn cubic_within(&self, point: &Point, distance: f64, weights: &[f64]) -> Option<[f64; 2]> {
        let place = &point.orbit.place;
        let [left, right] = point.border.vectors();
        let points = self.points(place);
        let map = Period::<4>::new(self.cycles.course, &Self::at(place));
        let by = |k: usize| distance * (k + 1) as f64;
        let laps: Vec<_> = (0..weights.len())
            .flat_map(|k| [by(k), -by(k)])
            .map(|by| Self::beside(&points, right, by))
            .collect();
        let images = self.images(&map, &laps);
        let phases =
            |lap: &[Image]| lap.iter().map(|image| image.phases.clone()).collect::<Vec<_>>();
        let own = phases(&images[0]);
        if images.iter().any(|lap| phases(lap) != own) {
            return None;
        }
        // Of each part, the first derivatives' derivative along `v`, and the second one.
        let (factors, count) = (self.factors(), points.len());
        let mut first = vec![Matrix2::zeros(); count];
        let mut second = vec![Matrix2::zeros(); count];
        for (k, weight) in weights.iter().enumerate() {
            let shares = first.iter_mut().zip(&mut second).enumerate();
            for (i, (first, second)) in shares {
                let [above, below] = [2 * k, 2 * k + 1].map(|lap| images[lap][i].by_state);
                let twice = point.orbit.parts[i] * 2.0;
                *first += (above - below) * (weight * factors[i] / (2.0 * by(k)));
                *second += (above - twice + below) * (weight * factors[i] / by(k).powi(2));
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
