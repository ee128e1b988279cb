//! Critical amplitudes of a rest on a kink: its multipliers are continuous in `p`, not analytic.

use super::chebyshev::Values;
use super::tongues::{Critical, bordered, gap, is_stable};
use crate::orbit::brackets::{below, may_touch, zero};

/// Samples of a part of the range of `p`.
const SAMPLES: usize = 32;
/// Products of multipliers this near to 1 are not told from it.
const ROUNDING: f64 = 1e-6;

/// The critical amplitudes, and whether rest is stable before the first; `at` gives multipliers as
/// a monodromy matrix.
pub(super) fn critical(
    parts: usize,
    p_max: f64,
    at: impl Fn(f64) -> Values<5>,
) -> (Vec<Critical>, bool) {
    let count = SAMPLES * parts;
    let places: Vec<f64> = (0..=count).map(|i| p_max * (i as f64 / count as f64).powi(2)).collect();
    let values: Vec<Values<5>> = places.iter().map(|p| at(*p)).collect();
    let mut all = Vec::new();
    for multiplier in [1.0, -1.0] {
        let function = |p: f64| gap(multiplier, at(p));
        let of: Vec<f64> = values.iter().map(|m| gap(multiplier, *m)).collect();
        all.extend(zeros(&places, &of, function).into_iter().map(|p| (p, multiplier)));
    }
    // Where directions turn for ever rest changes with the product alone.
    let turning = |m: Values<5>| {
        let complex = m[0] * m[0] < m[4];
        if complex { 1.0 - m[4] } else { 1.0 }
    };
    for (p, both) in places.windows(2).zip(values.windows(2)) {
        let [left, right] = [both[0], both[1]].map(turning);
        if left * right < 0.0 && left.abs().min(right.abs()) > ROUNDING {
            let p = zero(|p| turning(at(p)), p[0], p[1]);
            all.push((p, at(p)[0].signum()));
        }
    }
    let (critical, stable_at_first) = bordered(all, p_max, |p| is_stable(at(p)));
    let changes = |c: &Critical| c.stable[0] != c.stable[1];
    (critical.into_iter().filter(changes).collect(), stable_at_first)
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
