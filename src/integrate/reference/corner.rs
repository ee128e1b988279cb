//! The first corner of the equation of motion within a step of one trajectory.

use super::dense::DenseStep;
use super::problem::OdeProblem;
use crate::integrate::tangent::Number;

/// Number of parts of a step at which the switching function is evaluated.
const LOOKS: usize = 16;
/// A parabola through three samples touches zero if its minimum is below this part of their fall.
const MARGIN: f64 = 0.25;
/// Halvings and sections of a bracket.
const HALVINGS: usize = 60;
const SECTIONS: usize = 40;

/// The length of the step to the first corner within `dense`; none if there is none. `since` states
/// that the step starts from one. Derivatives are left out.
pub fn first<N: Number>(ode: &OdeProblem<N>, dense: &DenseStep<N>, since: bool) -> Option<f64> {
    let (field, mut step) = (ode.plain(), dense.values());
    let (start, side, length) = (dense.tau, dense.signs[1], dense.length);
    let curve = step.curve(field);
    let value = |part: f64| {
        let tau = start + part * length;
        side * ode.switch(tau, curve.at(tau))
    };
    let part = first_below_zero(&value, since)?;
    // One correction for the error of the interpolant.
    step.shorten(field, part * length);
    let rest = side * ode.switch(start + part * length, step.end);
    let by = 1e-3_f64.min(0.5 * part);
    let slope = (value(part + by) - value(part - by)) / (2.0 * by);
    let next = part - rest / slope;
    let better = (next - part).abs() < by && next < 1.0;
    Some(if better { next } else { part } * length)
}

/// The first part of a step from which on the function is negative. If the step starts at a zero
/// (`since`), that zero is ignored.
fn first_below_zero(value: &impl Fn(f64) -> f64, since: bool) -> Option<f64> {
    let place = |k: usize| k as f64 / LOOKS as f64;
    let all: [f64; LOOKS + 1] = std::array::from_fn(|k| value(place(k)));
    for k in 1..=LOOKS {
        if all[k] < 0.0 {
            let mut low = place(k - 1);
            if k == 1 && (since || all[0] <= 0.0) {
                // It rises from the zero first, or has no other zero.
                low = lowest(&|x| -value(x), [0.0, place(1)], true);
                if value(low) <= 0.0 {
                    return Some(0.0);
                }
            }
            return Some(passage(value, low, place(k)));
        }
        let [before, here, after] = [all[k - 1], all[k], all[(k + 1).min(LOOKS)]];
        let hollow =
            if k == LOOKS || (k == 1 && since) { false } else { here <= before && here <= after };
        if hollow && here < MARGIN * (before.max(after) - here) + f64::MIN_POSITIVE {
            let at = lowest(value, [place(k - 1), place(k + 1)], false);
            if value(at) < 0.0 {
                return Some(passage(value, place(k - 1), at));
            }
        }
    }
    None
}

/// The minimum between two parts, by the golden section; with `any` the first point found negative.
fn lowest(value: &impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2], any: bool) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = inner.map(value);
    for _ in 0..SECTIONS {
        if any && values[0].min(values[1]) < 0.0 {
            break;
        }
        if values[0] < values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [value(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], value(inner[1])];
        }
    }
    if values[0] < values[1] { inner[0] } else { inner[1] }
}

/// The zero at which it falls.
fn passage(value: &impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if value(middle) < 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}
