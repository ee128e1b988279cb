//! Under friction, rest is a set: the angles at which the load never exceeds the friction.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::find::REACH;
use crate::integrate::{State, Strobe};
use crate::model::{Angle, Equation, Pendulum};
use crate::orbit::brackets::zero;
use crate::orbit::{PoincareMap, newton};

/// Number of angles at which a set without closed form is sought.
const ANGLES: usize = 720;
/// Largest number of half turns from 0 at which sets on the line are sought.
const MOST_HALF_TURNS: i32 = 1000;
/// An angle this near to 0 or pi is set to it.
const NEAR: f64 = 1e-6;
/// Largest distance of a set's middle from its half turn.
const WITHIN: f64 = FRAC_PI_2 - 1e-9;
/// An undriven pendulum stands still where the load exceeds the friction by no more than this.
const BALANCED: f64 = 1e-9;

/// The angle in the middle of each set at rest, hanging and upside down: where the load at its
/// greatest is least. Empty without friction.
///
/// On the line there may be one around each half turn, as far as those reach that a turn follows without any.
#[must_use]
pub fn centres(pendulum: &Pendulum) -> Vec<f64> {
    if !pendulum.has_friction() {
        return Vec::new();
    }
    let equation = pendulum.equation();
    // Where the load is least a quarter turn from rest, each half turn has its part of the angles that are held.
    let around = |half_turn: i32| {
        let middle = f64::from(half_turn) * PI;
        let away = (centre(&equation, middle) - middle).clamp(-WITHIN, WITHIN);
        Some(middle + away).filter(|theta| equation.holds_for_ever(*theta))
    };
    if pendulum.angle() == Angle::Circle {
        return [0, 1].into_iter().filter_map(around).collect();
    }
    let mut all: Vec<f64> = around(0).into_iter().collect();
    for sense in [1, -1] {
        let mut empty = 0;
        for away in 1..MOST_HALF_TURNS {
            let found = around(sense * away);
            empty = if found.is_some() { 0 } else { empty + 1 };
            if empty == 2 {
                break;
            }
            all.extend(found);
        }
    }
    all
}

/// The angles, hanging and upside down, where the loads at their greatest in both senses exceed the friction alike: where
/// rest is, or the oscillation that a drive makes of it.
#[must_use]
pub fn balances(pendulum: &Pendulum) -> [f64; 2] {
    let equation = pendulum.equation();
    if equation.is_plain() {
        // The load torque - (1 + p cos) sin th swings about 0.
        let theta = equation.torque.clamp(-1.0, 1.0).asin();
        return [theta, PI - theta];
    }
    [0.0, PI].map(|middle| {
        let half = 0.5 * PI / ANGLES as f64;
        let angles = (0..ANGLES).map(|k| middle - FRAC_PI_2 + half * (2 * k + 1) as f64);
        let all = angles.filter_map(|angle| balanced(&equation, angle, half));
        let nearest = all.min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
        let theta = nearest.unwrap_or_else(|| centre(&equation, middle));
        if (theta - middle).abs() < NEAR { middle } else { theta }
    })
}

/// The angle within `width` of `theta` at which the loads at their greatest in both senses exceed the friction alike, by
/// bisection.
#[must_use]
pub fn balanced(equation: &Equation<f64>, theta: f64, width: f64) -> Option<f64> {
    let difference = |theta: f64| {
        let [forth, back] = equation.greatest_excesses(theta);
        forth - back
    };
    let [low, high] = [theta - width, theta + width];
    (difference(low) * difference(high) <= 0.0).then(|| zero(difference, low, high))
}

/// Points of the orbits 1:0 that lie where the pendulum may stand still, stable or not: no trap of another attractor
/// may hold them. Without drive these are the equilibria.
#[must_use]
pub fn standing(strobe: &Strobe, map: &PoincareMap) -> Vec<State> {
    if strobe.equation.is_autonomous() {
        return equilibria(&strobe.equation).into_iter().map(|theta| [theta, 0.0]).collect();
    }
    let starts = balances(&strobe.pendulum).map(|theta| ([theta, 0.0], 1));
    let mut points = Vec::new();
    // Near a saddle-node both starts may lead to one orbit; the second search finds the other.
    for _ in 0..2 {
        let orbits = newton::find_others(map, &starts, REACH, &points);
        points.extend(orbits.into_iter().flat_map(|orbit| orbit.points));
    }
    points
}

/// The angles at which an undriven pendulum stands still; of an interval that friction holds, some.
fn equilibria(equation: &Equation<f64>) -> Vec<f64> {
    let width = TAU / ANGLES as f64;
    let excess: Vec<f64> =
        (0..ANGLES).map(|k| equation.excess((k as f64 + 0.5) * width - PI)).collect();
    let mut all = Vec::new();
    for k in 0..ANGLES {
        let theta = (k as f64 + 0.5) * width - PI;
        let [before, after] = [ANGLES - 1, 1].map(|step| excess[(k + step) % ANGLES]);
        if excess[k] <= 0.0 {
            all.push(theta);
        } else if excess[k] <= before && excess[k] <= after {
            let least = least_loaded(equation, theta, width);
            all.extend((equation.excess(least) <= BALANCED).then_some(least));
        }
    }
    all
}

fn centre(equation: &Equation<f64>, middle: f64) -> f64 {
    if equation.is_plain() {
        // The greater of |torque - (1 + p) sin th| and |torque - (1 - p) sin th| is least where both are equal: at
        // torque = sin th, or at sin th = 0 if p is above 1.
        let level = if equation.motion.p.abs() > 1.0 { 0.0 } else { equation.torque };
        let theta = level.clamp(-1.0, 1.0).asin();
        return if middle == 0.0 { theta } else { PI - theta };
    }
    let angle = |k: usize| middle - FRAC_PI_2 + PI * (k as f64 + 0.5) / ANGLES as f64;
    let best = (0..ANGLES)
        .map(angle)
        .min_by(|a, b| equation.excess(*a).total_cmp(&equation.excess(*b)))
        .unwrap_or(middle);
    let theta = least_loaded(equation, best, PI / ANGLES as f64);
    if (theta - middle).abs() < NEAR { middle } else { theta }
}

/// The angle within `width` of `theta` at which the excess of the load is least, by ternary search.
#[must_use]
pub fn least_loaded(equation: &Equation<f64>, theta: f64, width: f64) -> f64 {
    let (mut low, mut high) = (theta - width, theta + width);
    for _ in 0..60 {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if equation.excess(a) < equation.excess(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}
