//! The oscillation that branches off at the loss of stability of rest, continued to its fold.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::poincare::PoincareMap;
use crate::integrate::State;
use crate::model::Pendulum;

/// Length of a step along the branch, in the space of angle, velocity and `p`.
const STEP: f64 = 0.08;
/// Largest number of steps.
const MOST_STEPS: usize = 80;
/// Change of `p` by which the map's derivative by it is measured.
const DIFFERENCE: f64 = 1e-6;
/// Newton's steps onto the branch, and the tolerance of convergence.
const ITERATIONS: usize = 12;
const RESIDUAL: f64 = 1e-12;
/// Refinements of the place of the fold.
const REFINEMENTS: usize = 30;
const LEVEL: f64 = 1e-9;

/// The fold of a branch of oscillations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fold {
    /// Amplitude of the drive: below it the oscillation does not exist.
    pub p: f64,
    /// A stroboscopic point of the oscillation there.
    pub point: State,
}

/// A point of the branch and its direction.
type Place = (Vector3<f64>, Vector3<f64>);

/// The branch `P(x) = m x`: `m = 1` has the drive's period; `m = -1` twice that, and is its own mirror
/// image.
struct Branch<'a> {
    pendulum: &'a Pendulum,
    multiplier: f64,
}

impl Branch<'_> {
    fn map(&self, p: f64) -> PoincareMap {
        let mut driven = self.pendulum.clone();
        driven.drive.p = p;
        PoincareMap::new(&driven)
    }

    /// `P(x) - m x` and its derivatives by angle, velocity and `p`, a column each.
    fn gap(&self, z: Vector3<f64>) -> (Vector2<f64>, [Vector2<f64>; 3]) {
        let x = [z[0], z[1]];
        let map = self.map(z[2]);
        let image = map.once(x);
        let goal = x.map(|part| self.multiplier * part);
        let [above, below] = [DIFFERENCE, -DIFFERENCE].map(|by| self.map(z[2] + by).once(x).state);
        let by_p = map.gap(below, above) / (2.0 * DIFFERENCE);
        let d = image.derivative - Matrix2::identity() * self.multiplier;
        (map.gap(goal, image.state), [d.column(0).into(), d.column(1).into(), by_p])
    }

    /// The direction of the branch, in the sense of `before`.
    fn direction(columns: [Vector2<f64>; 3], before: Vector3<f64>) -> Option<Vector3<f64>> {
        let row = |k: usize| Vector3::new(columns[0][k], columns[1][k], columns[2][k]);
        let along = row(0).cross(&row(1)).try_normalize(0.0)?;
        Some(if along.dot(&before) < 0.0 { -along } else { along })
    }

    /// The point of the branch at this distance along `from`'s direction.
    fn onto(&self, from: Place, length: f64) -> Option<Place> {
        let (start, along) = from;
        let mut z = start + along * length;
        for _ in 0..ITERATIONS {
            let (gap, [a, b, c]) = self.gap(z);
            let ahead = along.dot(&(z - start)) - length;
            if gap.norm().max(ahead.abs()) < RESIDUAL {
                return Some((z, Self::direction([a, b, c], along)?));
            }
            let matrix =
                Matrix3::new(a[0], b[0], c[0], a[1], b[1], c[1], along[0], along[1], along[2]);
            z -= matrix.lu().solve(&Vector3::new(gap[0], gap[1], ahead))?;
            if !z.iter().all(|x| x.is_finite()) {
                return None;
            }
        }
        None
    }
}

/// The fold of the branch of oscillations that rest sheds at `pendulum`'s drive, where it has the
/// multiplier `multiplier`, 1 or -1; `None` where the branch begins toward larger `p`, or no fold is
/// found.
#[must_use]
pub fn fold_of_onset(pendulum: &Pendulum, multiplier: f64) -> Option<Fold> {
    let branch = Branch { pendulum, multiplier };
    let derivative = PoincareMap::new(pendulum).once([0.0; 2]).derivative;
    let weak = derivative - Matrix2::identity() * multiplier;
    // The vector in its kernel.
    let rows = [weak.row(0), weak.row(1)];
    let row = rows[usize::from(rows[1].norm() > rows[0].norm())];
    let shed = Vector2::new(-row[1], row[0]).try_normalize(0.0)?;
    let mut place = (Vector3::new(0.0, 0.0, pendulum.drive.p), Vector3::new(shed[0], shed[1], 0.0));
    place = branch.onto(place, STEP)?;
    if place.1[2] >= 0.0 {
        return None;
    }
    for _ in 0..MOST_STEPS {
        let next = branch.onto(place, STEP)?;
        if next.0[2] <= 0.0 {
            return None;
        }
        if next.1[2] >= 0.0 {
            return branch.between(place, STEP);
        }
        place = next;
    }
    None
}

impl Branch<'_> {
    /// Where `p` is least, at most `length` beyond `from`: the direction has no part along `p` there.
    fn between(&self, from: Place, length: f64) -> Option<Fold> {
        let (mut low, mut high) = (0.0, length);
        let mut best = from;
        for _ in 0..REFINEMENTS {
            let middle = 0.5 * (low + high);
            best = self.onto(from, middle)?;
            if best.1[2].abs() < LEVEL || high - low < LEVEL {
                break;
            }
            if best.1[2] < 0.0 { low = middle } else { high = middle }
        }
        Some(Fold { p: best.0[2], point: [best.0[0], best.0[1]] })
    }
}
