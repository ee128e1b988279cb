//! What shrinks within a trap: an ellipse's norm, or at a rest on a kink a function of the direction.
//!
//! At a kink no ellipse need shrink in one period. The function `|x| V(direction)` does, where `V` is the
//! greatest growth over any number of periods, less what it must shrink by: `V = max(1, g V' / shrink)`
//! with the growth `g` and the next direction's `V'`. The trap is the greatest ellipse of its shape that lies in it.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};

use crate::model::Pendulum;
use crate::orbit::{KinkedRest, PeriodicOrbit};

/// Directions of a table, and iterations of it at most.
const DIRECTIONS: usize = 1024;
const ITERATIONS: usize = 20_000;
/// Relative change at which the table has converged, and its greatest value.
const CONVERGED: f64 = 1e-9;
const GREATEST: f64 = 1e9;

/// A function of the distance from an orbit's point that is proportional to it.
pub(super) enum Gauge {
    /// The norm of an upper triangular root, `[r11, r12, r22]`.
    Ellipse([f64; 3]),
    /// The distance times a function of the direction, at equal angles from 0 on.
    Star(Vec<f64>),
}

impl Gauge {
    /// The gauge of a rest on a kink that a period shrinks by `shrink`; none elsewhere.
    pub fn of_kink(pendulum: &Pendulum, orbit: &PeriodicOrbit, shrink: f64) -> Option<Self> {
        let [theta, velocity] = orbit.points[0];
        if orbit.n > 1 || velocity != 0.0 {
            return None;
        }
        let rest = KinkedRest::of(pendulum, theta)?;
        let image = |k: usize| {
            let ray = unit(TAU * k as f64 / DIRECTIONS as f64);
            let image = rest.along(ray) * ray;
            (image.norm() / shrink, image[1].atan2(image[0]))
        };
        let images: Vec<(f64, f64)> = (0..DIRECTIONS).map(image).collect();
        let mut heights = vec![1.0; DIRECTIONS];
        for _ in 0..ITERATIONS {
            let next: Vec<f64> = images
                .iter()
                .map(|(growth, angle)| (growth * between(&heights, *angle)).max(1.0))
                .collect();
            let still = next.iter().zip(&heights).all(|(a, b)| (a - b).abs() <= CONVERGED * b);
            heights = next;
            if still || heights.iter().any(|height| *height > GREATEST) {
                break;
            }
        }
        Some(Self::Star(heights))
    }

    /// The gauge at this distance.
    pub fn height(&self, [x, y]: [f64; 2]) -> f64 {
        match self {
            Self::Ellipse([a, b, c]) => (a * x + b * y).hypot(c * y),
            Self::Star(heights) => x.hypot(y) * between(heights, y.atan2(x)),
        }
    }

    /// A point at which it is 1, by an angle.
    pub fn point(&self, angle: f64) -> [f64; 2] {
        match self {
            Self::Ellipse([a, b, c]) => {
                let y = angle.sin() / c;
                [(angle.cos() - b * y) / a, y]
            }
            Self::Star(heights) => {
                let ray = unit(angle) / between(heights, angle);
                [ray[0], ray[1]]
            }
        }
    }

    /// The root of an ellipse in which it is below 1.
    pub fn root(&self) -> [f64; 3] {
        let heights = match self {
            Self::Ellipse(root) => return *root,
            Self::Star(heights) => heights,
        };
        let place = |k: usize| unit(TAU * k as f64 / DIRECTIONS as f64) / heights[k];
        let spread: Matrix2<f64> =
            (0..DIRECTIONS).map(|k| place(k) * place(k).transpose()).sum::<Matrix2<f64>>();
        let shape = spread.try_inverse().unwrap_or_else(Matrix2::identity);
        let (s, t, u) = (shape[(0, 0)], shape[(0, 1)], shape[(1, 1)]);
        let root = [s.sqrt(), t / s.sqrt(), (u - t * t / s).sqrt()];
        let norm = |x: Vector2<f64>| Self::Ellipse(root).height([x[0], x[1]]);
        let least = (0..DIRECTIONS).map(|k| norm(place(k))).fold(f64::INFINITY, f64::min);
        root.map(|part| part / least)
    }
}

fn unit(angle: f64) -> Vector2<f64> {
    Vector2::new(angle.cos(), angle.sin())
}

/// The table at an angle, by linear interpolation.
fn between(heights: &[f64], angle: f64) -> f64 {
    let count = heights.len();
    let place = (angle / TAU).rem_euclid(1.0) * count as f64;
    let (k, part) = (place.floor() as usize % count, place - place.floor());
    heights[k] + part * (heights[(k + 1) % count] - heights[k])
}
