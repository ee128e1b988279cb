//! Rest on a kink of the torque: its growth, where one-sided derivatives differ.
//!
//! A damping that differs between the two senses of the motion, as `-b |v|`, has two derivatives at
//! `v = 0`, and rest stays there. Small motions obey an equation that is homogeneous of degree one, linear in
//! each sector of directions: they scale with the start, and turn as a map of the circle of directions says.
//! `P(r e) = r M(e) e` with the derivative `M(e)`, which is continuous in the direction `e` as the torque is
//! continuous. If directions return, after one period or two, motions along them grow by a factor each time:
//! an eigenvalue of the product of their `M`. Otherwise directions turn for ever, and the growth is the mean of
//! `ln |M(e) e|`, weighted toward the middle of a long orbit (Das, Saiki, Sander & Yorke 2017, Nonlinearity
//! 30, 4111).

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, Matrix2, Vector2};

use super::brackets::{below, may_touch, zero};
use super::floquet::Multipliers;
use super::sectors::{Slopes, Step};
use crate::integrate::reference::problem::greatest_rate;
use crate::integrate::tangent::Tangent;
use crate::model::{Equation, Pendulum};

/// Times in a period at which a rest is looked at.
const TIMES: usize = 16;
/// A rest is at most this far from the angle that it is sought at.
const NEAR: f64 = 1e-8;
/// Velocity at which the derivatives of each sense are taken.
const SLOW: f64 = 1e-20;
/// Largest acceleration at a rest, and largest difference of derivatives that are equal.
const ROUNDING: f64 = 1e-11;
/// Halvings of the steps until they are resolved.
const HALVINGS: u32 = 5;
/// Directions on the circle from which those that return are sought, and periods after which they do.
const DIRECTIONS: usize = 64;
const RETURNS: usize = 2;
/// Periods before a mean at most; the difference at which it has converged.
const SETTLED: usize = 256;
const CONVERGED: f64 = 1e-12;
/// The first mean is over this part of the most periods, or this number.
const PART: usize = 32;
const LEAST: usize = 64;
/// Periods of a mean at most for an exponent.
pub const PRECISE: usize = 16_384;
/// Periods of a mean at most for what only separates stable from unstable.
pub const QUICK: usize = 128;

type Number = Tangent<f64, 2>;

/// The equation of small motions about a rest, over one period.
#[derive(Clone, Debug)]
pub struct KinkedRest {
    /// Its angle.
    pub theta: f64,
    steps: Vec<Step>,
}

impl KinkedRest {
    /// The rest of `pendulum` at the angle `theta`; none where there is no rest, where friction holds it, and
    /// where the equation is differentiable.
    #[must_use]
    pub fn of(pendulum: &Pendulum, theta: f64) -> Option<Self> {
        let equation = Equation::lift(pendulum, |_, value| Number::constant(value));
        if pendulum.has_friction() || equation.keeps()[0] || equation.sways() {
            return None;
        }
        let balance = (theta / PI).round() * PI;
        let theta = if (theta - balance).abs() < NEAR { balance } else { still(pendulum, theta)? };
        let period = pendulum.period();
        let times = (0..TIMES).map(|k| period * k as f64 / TIMES as f64);
        let mut at_corner = true;
        for tau in times.clone() {
            if pendulum.acceleration(tau, theta, 0.0).abs() > ROUNDING {
                return None;
            }
            let at = equation.point(
                &equation.forcing(Number::constant(tau)),
                Number::constant(theta),
                Number::constant(0.0),
                Number::constant(1.0),
            );
            at_corner &= equation.switch(&at).is_some_and(|s| s.value.abs() < ROUNDING);
        }
        let slopes = |tau: f64| slopes(&equation, theta, at_corner, tau);
        let kinked = times.clone().any(|tau| {
            let all = slopes(tau).sectors;
            let size = 1.0 + all[0][0].abs() + all[0][1].abs();
            all.iter().any(|s| (0..2).any(|k| (s[k] - all[0][k]).abs() > ROUNDING * size))
        });
        if !kinked {
            return None;
        }
        let least = (period * greatest_rate(pendulum)).ceil().max(1.0) as usize;
        let mut steps = Vec::new();
        for halving in 0..=HALVINGS {
            let count = least << halving;
            let length = period / count as f64;
            let made = (0..count).map(|k| Step::new(k as f64 * length, length, &slopes));
            let (parts, resolved): (Vec<Step>, Vec<bool>) = made.unzip();
            steps = parts;
            if resolved.into_iter().all(|yes| yes) {
                break;
            }
        }
        Some(Self { theta, steps })
    }

    /// The derivative of the map along a direction: the image of a small vector is this times the vector.
    #[must_use]
    pub fn along(&self, direction: Vector2<f64>) -> Matrix2<f64> {
        let mut whole = Matrix2::identity();
        let mut signs = None;
        for step in &self.steps {
            whole = step.after(whole * direction, &mut signs) * whole;
        }
        whole
    }

    /// [`KinkedRest::along`] over several periods.
    fn along_for(&self, direction: Vector2<f64>, periods: usize) -> Matrix2<f64> {
        let on = |whole: Matrix2<f64>, _| self.along((whole * direction).normalize()) * whole;
        (0..periods).fold(Matrix2::identity(), on)
    }

    /// The multipliers of the direction along which motions grow most: those of its derivative where it
    /// returns after a period, their square roots, negative, after two; else a complex pair whose size is the
    /// mean growth and whose argument is the mean turn.
    ///
    /// A direction that repels its neighbours counts only where motions along it grow and all others shrink. A
    /// mean takes at most `most` periods.
    #[must_use]
    pub fn multipliers(&self, most: usize) -> Multipliers {
        for periods in 1..=RETURNS {
            let rays = self.returning(periods);
            let pair = |ray: &Vector2<f64>| {
                let whole = self.along_for(*ray, periods);
                let growth = (whole * ray).norm();
                [growth, whole.determinant() / growth]
            };
            let pairs: Vec<[f64; 2]> = rays.iter().map(pair).collect();
            let key = |p: &[f64; 2]| (p[0] >= p[1], p[0]);
            let greatest = |grows: bool| {
                let some = pairs.iter().filter(|p| !grows || p[0] >= 1.0);
                some.max_by(|a, b| {
                    let ((x, u), (y, v)) = (key(a), key(b));
                    x.cmp(&y).then(u.total_cmp(&v))
                })
            };
            if let Some([a, b]) = greatest(true).or_else(|| greatest(false)) {
                let sign = if periods == 1 { 1.0 } else { -1.0 };
                let root = |m: f64| Complex::new(sign * m.powf(1.0 / periods as f64), 0.0);
                return Multipliers([root(*a), root(*b)]);
            }
        }
        let [growth, turn] = self.mean(most);
        let pair = Complex::from_polar(growth.exp(), turn);
        let upper = if pair.im < 0.0 { pair.conj() } else { pair };
        Multipliers([upper, upper.conj()])
    }

    /// The directions that return after these periods.
    fn returning(&self, periods: usize) -> Vec<Vector2<f64>> {
        let away = |angle: f64| {
            let ray = unit(angle);
            let image = self.along_for(ray, periods) * ray;
            (ray[0] * image[1] - ray[1] * image[0]).atan2(ray.dot(&image))
        };
        let angle = |k: usize| TAU * (k as f64 + 0.5) / DIRECTIONS as f64;
        let values: Vec<f64> = (0..DIRECTIONS).map(|k| away(angle(k))).collect();
        let at = |k: usize| values[k % DIRECTIONS];
        let mut found = Vec::new();
        for k in 0..DIRECTIONS {
            let [before, here, next] = [at(k + DIRECTIONS - 1), at(k), at(k + 1)];
            if here * next <= 0.0 && (here - next).abs() < PI {
                found.push(zero(away, angle(k), angle(k + 1)));
            } else if here * before > 0.0
                && here * next > 0.0
                && may_touch([before, here, next].map(f64::abs))
            {
                let (low, high) = (angle(k) - TAU / DIRECTIONS as f64, angle(k + 1));
                let sign = here.signum();
                if let Some(inner) = below(|x| sign * away(x), low, high) {
                    found.extend([zero(away, low, inner), zero(away, inner, high)]);
                }
            }
        }
        found.into_iter().map(unit).collect()
    }

    /// The mean logarithm of the growth a period, and the mean angle by which directions turn.
    fn mean(&self, most: usize) -> [f64; 2] {
        let mut ray = unit(0.5);
        let mut middle = 0.0;
        let mut step = |settled: bool| {
            let image = self.along(ray) * ray;
            let size = image.norm();
            let turn = (ray[0] * image[1] - ray[1] * image[0]).atan2(ray.dot(&image));
            let turn = middle + (turn - middle + PI).rem_euclid(TAU) - PI;
            if !settled {
                middle += (turn - middle) / 8.0;
            }
            ray = image / size;
            [size.ln(), turn]
        };
        for _ in 0..SETTLED.min(most / 2) {
            step(false);
        }
        let mut steps: Vec<[f64; 2]> = Vec::new();
        let mut last = [f64::NAN; 2];
        let mut count = (most / PART).max(LEAST);
        loop {
            while steps.len() < count {
                steps.push(step(true));
            }
            let weight = |k: usize| {
                let part = (k as f64 + 1.0) / (count as f64 + 1.0);
                (-1.0 / (part * (1.0 - part))).exp()
            };
            let (mut sum, mut total) = ([0.0; 2], 0.0);
            for (k, values) in steps.iter().enumerate() {
                let weight = weight(k);
                total += weight;
                sum = [0, 1].map(|part| sum[part] + weight * values[part]);
            }
            let mean = sum.map(|part| part / total);
            let error = (mean[0] - last[0]).abs();
            if error < CONVERGED || count >= most {
                // A growth below its error is none, as without damping.
                let growth =
                    if mean[0].abs() <= 10.0 * error.max(CONVERGED) { 0.0 } else { mean[0] };
                return [growth, mean[1]];
            }
            (last, count) = (mean, 2 * count);
        }
    }
}

/// The angle near this one where the acceleration at `tau = 0` vanishes, by the secant method.
fn still(pendulum: &Pendulum, theta: f64) -> Option<f64> {
    let pull = |theta: f64| pendulum.acceleration(0.0, theta, 0.0);
    let (mut before, mut here) = (theta, theta + NEAR);
    for _ in 0..3 {
        let change = pull(here) - pull(before);
        let step = if change == 0.0 { 0.0 } else { pull(here) * (here - before) / change };
        (before, here) = (here, here - step);
    }
    ((here - theta).abs() < NEAR).then_some(here)
}

/// The derivatives of the acceleration at rest on each side of its kinks.
fn slopes(equation: &Equation<Number>, theta: f64, at_corner: bool, tau: f64) -> Slopes {
    let forcing = equation.forcing(Number::constant(tau));
    let angle = Number::seeded(theta, 0);
    let sides: &[f64] = if at_corner { &[1.0, -1.0] } else { &[0.0] };
    let mut all = Slopes { sectors: Vec::new(), normal: [0.0; 2] };
    for side in sides {
        for sense in [1.0, -1.0] {
            let velocity = Number::seeded(SLOW * sense, 1);
            let mut at = equation.point(&forcing, angle, velocity, Number::constant(sense));
            if at_corner {
                all.normal = equation.switch(&at).map_or([0.0; 2], |switch| switch.slope);
                at.side = Number::constant(*side);
            }
            all.sectors.push(equation.acceleration(&forcing, &at).slope);
        }
    }
    all
}

fn unit(angle: f64) -> Vector2<f64> {
    Vector2::new(angle.cos(), angle.sin())
}
