//! Which side of a passage of a complex pair the invariant curve lives on.
//!
//! With `A q = e^{i f} q`, `A^T p = e^{-i f} p` and `<p, q> = 1` the first Lyapunov coefficient of the closing map is
//! `Re(e^{-i f} (<p, C(q, q, q')> + 2 <p, B(q, (1 - A)^-1 B(q, q'))> + <p, B(q', (e^{2 i f} - A)^-1 B(q, q))>)) / 2`,
//! where `q'` is the conjugate: negative where the curve is stable and lies beyond the loss of stability (Kuznetsov
//! 2004, Elements of Applied Bifurcation Theory, section 5.4.3). `B` and `C` are differences of exact first derivatives.

use nalgebra::{Complex, Matrix2, Vector2};

use super::cycle::{Cycles, Orbit};
use super::period::{Image, Period};
use super::phases::Phase;
use crate::integrate::State;

/// Displacement of the differences, an angle and a velocity.
const BESIDE: f64 = 1e-3;
/// A power of a multiplier up to the fourth this near to 1 is a strong resonance, where the formula has no meaning.
const RESONANT: f64 = 1e-3;

type Vector = Vector2<Complex<f64>>;

impl Cycles<'_> {
    /// Whether the invariant curve that the orbit sheds lives where it has lost its stability; none at a strong resonance
    /// and where slips and sticks change nearby.
    #[must_use]
    pub fn sheds_stable_curve(&self, orbit: &Orbit) -> Option<bool> {
        let at = |theta: f64, velocity: f64| self.derivative(orbit, [theta, velocity]);
        let (middle, phases) = at(0.0, 0.0);
        let sides = [-1.0, 0.0, 1.0].map(|x| [-1.0, 0.0, 1.0].map(|y| at(BESIDE * x, BESIDE * y)));
        if sides.iter().flatten().any(|(_, other)| *other != phases) {
            return None;
        }
        let side = sides.map(|row| row.map(|(matrix, _)| matrix));
        let first = [side[2][1] - side[0][1], side[1][2] - side[1][0]].map(|d| d / (2.0 * BESIDE));
        let mixed = (side[2][2] - side[2][0] - side[0][2] + side[0][0]) / (4.0 * BESIDE * BESIDE);
        let pure = [side[2][1] + side[0][1], side[1][2] + side[1][0]];
        let [theta, velocity] = pure.map(|sum| (sum - middle * 2.0) / (BESIDE * BESIDE));
        let second = [[theta, mixed], [mixed, velocity]];
        coefficient(&middle, &first, &second).map(|value| value < 0.0)
    }

    /// The derivative of the closing map at a displacement from the first point of an orbit, and the phases on the way.
    fn derivative(&self, orbit: &Orbit, away: State) -> (Matrix2<f64>, Vec<Phase>) {
        let [theta, velocity] = self.points(&orbit.place)[0];
        let map = Period::<3>::new(self.course, &[self.at(&orbit.place)]);
        let [whole, half] = self.parts();
        let mut state = [theta + away[0], velocity + away[1]];
        let (mut product, mut phases) = (Matrix2::identity(), Vec::new());
        for k in 0..whole + half {
            let part = if k < whole { 1.0 } else { 0.5 };
            for Image { state: next, by_state, phases: passed, .. } in map.images(&[state], part) {
                (state, product) = (next, by_state * product);
                phases.extend(passed);
            }
        }
        (product * self.closing().0, phases)
    }
}

/// The first Lyapunov coefficient from the first, second and third derivatives of a map of the plane; none at a strong
/// resonance.
fn coefficient(
    own: &Matrix2<f64>,
    first: &[Matrix2<f64>; 2],
    second: &[[Matrix2<f64>; 2]; 2],
) -> Option<f64> {
    let half = 0.5 * own.trace();
    let multiplier = Complex::new(half, (own.determinant() - half * half).max(0.0).sqrt());
    let powers = (1..=4).map(|k| (multiplier.powi(k) - 1.0).norm());
    if powers.fold(f64::INFINITY, f64::min) < RESONANT {
        return None;
    }
    let real = |x: f64| Complex::new(x, 0.0);
    let a = own.map(real);
    // Columns of the adjugate of `A - m` are eigenvectors, and its rows those of the transpose.
    let q = Vector::new(a[(0, 1)], multiplier - a[(0, 0)]);
    let left = Vector::new(a[(1, 0)], multiplier - a[(0, 0)]);
    let dot = |p: &Vector, x: &Vector| p[0] * x[0] + p[1] * x[1];
    let left = left / dot(&left, &q);
    let along = |parts: [Matrix2<f64>; 2], u: &Vector| {
        parts[0].map(real) * u[0] + parts[1].map(real) * u[1]
    };
    let b = |u: &Vector, v: &Vector| along(*first, u) * v;
    let c = |u: &Vector, v: &Vector, w: &Vector| {
        let rows = second.map(|row| along(row, u));
        (rows[0] * v[0] + rows[1] * v[1]) * w
    };
    let conjugate = q.map(|x| x.conj());
    let one = nalgebra::Matrix2::<Complex<f64>>::identity();
    let mean = (one - a).try_inverse()? * b(&q, &conjugate);
    let twice = (one * (multiplier * multiplier) - a).try_inverse()? * b(&q, &q);
    let sum = c(&q, &q, &conjugate) + b(&q, &mean) * real(2.0) + b(&conjugate, &twice);
    Some(0.5 * (multiplier.conj() * dot(&left, &sum)).re)
}
