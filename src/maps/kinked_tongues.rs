//! Critical amplitudes of a rest on a kink: its multipliers are continuous in `p`, not differentiable.

use std::f64::consts::TAU;

use super::tongues::{Row, bordered};
use crate::model::Pendulum;
use crate::orbit::brackets::{below, may_touch, zero};
use crate::orbit::kink::QUICK;
use crate::orbit::{KinkedRest, Multipliers};

/// Samples of a part of the range of `p`, over which solutions grow at most by the exponential of about [`GROWTH`].
const SAMPLES: usize = 32;
const GROWTH: f64 = 8.0;
/// Products of multipliers this near to 1 are not told from it.
const ROUNDING: f64 = 1e-6;

/// The critical amplitudes of a balance at a frequency.
pub(super) fn row(pendulum: &Pendulum, balance: f64, omega: f64, p_max: f64) -> Row {
    let mut driven = pendulum.clone();
    driven.drive.omega = omega;
    // Solutions grow by about the exponential of the period times the root of p.
    let parts = (0.4 * TAU / omega * p_max.sqrt() / GROWTH).ceil().max(1.0) as usize;
    let at = |p: f64| -> [f64; 2] {
        let mut driven = driven.clone();
        driven.drive.p = p.max(f64::MIN_POSITIVE);
        let rest = KinkedRest::of(&driven, balance);
        let Multipliers([a, b]) =
            rest.map_or(Multipliers([0.0.into(); 2]), |r| r.multipliers(QUICK));
        [(a + b).re, (a * b).re]
    };
    let count = SAMPLES * parts;
    let places: Vec<f64> = (0..=count).map(|i| p_max * (i as f64 / count as f64).powi(2)).collect();
    let values: Vec<[f64; 2]> = places.iter().map(|p| at(*p)).collect();
    let mut all = Vec::new();
    for multiplier in [1.0, -1.0] {
        let function = |p: f64| gap(multiplier, at(p));
        let of: Vec<f64> = values.iter().map(|m| gap(multiplier, *m)).collect();
        all.extend(zeros(&places, &of, function).into_iter().map(|p| (p, multiplier)));
    }
    // Where directions turn for ever rest changes with the product alone.
    let turning = |[sum, product]: [f64; 2]| {
        if 0.25 * sum * sum < product { 1.0 - product } else { 1.0 }
    };
    for (p, both) in places.windows(2).zip(values.windows(2)) {
        let [left, right] = [both[0], both[1]].map(turning);
        if left * right < 0.0 && left.abs().min(right.abs()) > ROUNDING {
            let p = zero(|p| turning(at(p)), p[0], p[1]);
            all.push((p, at(p)[0].signum()));
        }
    }
    let stable = |p: f64| {
        let m = at(p);
        gap(1.0, m) > 0.0 && gap(-1.0, m) > 0.0 && m[1] < 1.0
    };
    let mut row = bordered(all, p_max, stable);
    row.critical.retain(|c| c.stable[0] != c.stable[1]);
    row
}

/// `1 - m (a + b) + a b`: zero where `m`, 1 or -1, is one of the multipliers.
fn gap(multiplier: f64, [sum, product]: [f64; 2]) -> f64 {
    1.0 - multiplier * sum + product
}

/// The zeros of a function with these values at these places, also pairs of them between two.
fn zeros(places: &[f64], values: &[f64], function: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut found = Vec::new();
    for i in 0..places.len() - 1 {
        let [left, right] = [values[i], values[i + 1]];
        if left * right < 0.0 {
            found.push(zero(&function, places[i], places[i + 1]));
        } else if i > 0
            && values[i - 1] * left > 0.0
            && left * right > 0.0
            && may_touch([values[i - 1], left, right].map(f64::abs))
        {
            let [low, high] = [places[i - 1], places[i + 1]];
            let sign = left.signum();
            if let Some(inner) = below(|p| sign * function(p), low, high) {
                found.extend([zero(&function, low, inner), zero(&function, inner, high)]);
            }
        }
    }
    found
}
