//! Numbers along a motion that pass 0 where its sequence of slips and sticks changes, with their derivatives.
//!
//! - Onset of sticking, at each turn and stick: the acceleration in the new sense. Below 0 friction holds the pendulum.
//! - Grazing, between turns: the least velocity in the sense of the motion. It is reached where the acceleration is 0, so
//!   that the time of it has no part in the derivative. Where the pendulum stops before, the slip is continued in its sense.
//!
//! - Of both kinds, at each stick: the acceleration at the peak of a harmonic load, within the stick or after the release.
//!   At 0 a slip between two sticks comes or goes.
//!
//! At 0 the motion is the same on both sides, so that the system of an orbit and one of these has the same solutions by
//! the derivatives of either side: those of the map differ by a multiple of those of the number.

use std::f64::consts::{PI, TAU};

use super::event::Kind;
use crate::integrate::reference::dense::DenseStep;
use crate::integrate::reference::driver::Driver;
use crate::integrate::reference::problem::OdeProblem;
use crate::integrate::tangent::{Number, Tangent};
use crate::orbit::brackets::zero;

/// Step of time of a difference of loads.
const LATER: f64 = 1e-5;

/// A number and its derivatives by state and coordinates.
pub type Edge = (f64, [f64; 4]);

/// The number of the last step, which ends at a velocity 0 if it `stops`; none where there is none.
#[must_use]
pub fn passed<const N: usize>(
    kind: Kind,
    ode: &OdeProblem<Tangent<f64, N>>,
    driver: &Driver<'_, Tangent<f64, N>>,
    stops: bool,
) -> Option<Edge> {
    let number = match kind {
        Kind::StickOnset => stops.then(|| reversed(ode, driver)),
        Kind::Grazing => least(ode, &driver.dense, stops),
        _ => None,
    }?;
    Some(edge(number))
}

fn edge<const N: usize>(number: Tangent<f64, N>) -> Edge {
    let slope = |k: usize| number.slope.get(k).copied().unwrap_or(0.0);
    (number.value, std::array::from_fn(slope))
}

/// The numbers of a stick between two times.
pub fn held<const N: usize>(
    ode: &OdeProblem<Tangent<f64, N>>,
    driver: &Driver<'_, Tangent<f64, N>>,
    [from, to]: [f64; 2],
) -> impl Iterator<Item = Edge> {
    let motion = ode.plain().equation().motion;
    let (still, past) = (driver.state, driver.past);
    let released = !driver.is_stuck();
    let peaks = [0.0, PI].map(|phase| {
        let wait = (phase - motion.omega * from - motion.phase).rem_euclid(TAU);
        from + wait / motion.omega
    });
    // After the release the load rises to its peak for less than half a period.
    let near = if released { PI / motion.omega } else { 0.0 };
    let harmonic = ode.is_harmonic();
    peaks.into_iter().filter(move |peak| harmonic && peak - to < near).map(move |peak| {
        let [forth, back] =
            [1.0, -1.0].map(|sense| ode.acceleration(peak, still, [sense, 1.0], past));
        let of_back = back.reset(-back.value, -1.0);
        edge(if forth.value > of_back.value { forth } else { of_back })
    })
}

/// The acceleration at a stop in the sense that the motion has not had.
fn reversed<const N: usize>(
    ode: &OdeProblem<Tangent<f64, N>>,
    driver: &Driver<'_, Tangent<f64, N>>,
) -> Tangent<f64, N> {
    let (dense, tau) = (&driver.dense, driver.tau);
    let ([sense, side], [theta, velocity]) = (dense.signs, dense.end);
    let at = |tau: f64| {
        let still = [theta, velocity.reset(0.0, 0.0)];
        let number = ode.acceleration(tau, still, [-sense, side], driver.past);
        number.reset(-sense * number.value, -sense)
    };
    let mut number = at(tau);
    let by_time = (at(tau + LATER).value - at(tau - LATER).value) / (2.0 * LATER);
    // The time of the stop moves by minus the velocity over the acceleration.
    let before = dense.last().value;
    for (slope, moved) in number.slope.iter_mut().zip(velocity.slope) {
        *slope -= by_time * moved / before;
    }
    number
}

/// The least velocity in the sense of a step, or of one that goes on in its sense from its end.
fn least<const N: usize>(
    ode: &OdeProblem<Tangent<f64, N>>,
    step: &DenseStep<Tangent<f64, N>>,
    stops: bool,
) -> Option<Tangent<f64, N>> {
    let sense = step.signs[0];
    let dense = if stops {
        let (from, length) = (step.tau + step.length, ode.longest_step());
        DenseStep::new(ode.field(), from, step.end, step.last(), step.signs, length)
    } else {
        step.clone()
    };
    // After a release the acceleration is one of rounding, and nothing moves yet.
    let moves = stops || dense.start[1].value != 0.0;
    let passes = moves && sense * dense.first().value < 0.0 && sense * dense.last().value >= 0.0;
    let after = |length: f64| {
        let mut part = dense.clone();
        part.shorten(ode.field(), length);
        part
    };
    passes.then(|| {
        let [_, velocity] = after(zero(|length| after(length).last().value, 0.0, dense.length)).end;
        velocity.reset(sense * velocity.value, sense)
    })
}
