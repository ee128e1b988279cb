//! Properties of a term, found by evaluating it: balance of units, jumps at rest, periodicity in
//! the angle, symmetry.
//!
//! Terms are made of analytic functions, so that an identity which holds at several arbitrary
//! points holds everywhere.

use std::f64::consts::TAU;

use super::tree::{Place, Tree};
use crate::model::effects::{Parameter, Power, Role};

/// An arbitrary point, for values that do not depend on it.
pub const NOWHERE: Place = Place {
    theta: 0.0,
    velocity: 0.0,
    sense: 1.0,
    phase: 0.0,
    lab: 0.0,
    frequency: 1.0,
    pivot: 0.0,
};

/// Relative difference within which values are equal.
const CLOSE: f64 = 1e-9;
/// Change of the unit of time that tests the balance of units.
const UNIT: f64 = 1.37;
/// An angle many turns away.
const FAR: f64 = 1e6;
/// Positions in their typical ranges at which parameters are tested.
const PARTS: [f64; 3] = [0.23, 0.51, 0.87];

/// Points all over the plane, and times.
fn places() -> impl Iterator<Item = Place> {
    (0..12).map(|k| {
        // Multiples of irrational numbers, as good as random.
        let part = |step: f64| (f64::from(k) * step + 0.37).fract();
        let velocity = 5.0 * part(0.414_213_562) - 2.5;
        Place {
            theta: TAU * part(0.618_033_989) - 3.0,
            velocity,
            sense: 1_f64.copysign(velocity),
            phase: TAU * part(0.732_050_808),
            lab: 1.0 + 20.0 * part(0.236_067_977),
            frequency: 1.0,
            pivot: 2.0 * part(0.449_489_743) - 1.0,
        }
    })
}

/// Values of parameters in their typical ranges.
pub fn usual(parameters: &[Parameter]) -> impl Iterator<Item = Vec<f64>> {
    PARTS.into_iter().map(|part| {
        let value = |p: &Parameter| p.typical[0] + part * (p.typical[1] - p.typical[0]);
        parameters.iter().map(value).collect()
    })
}

fn alike(a: f64, b: f64) -> bool {
    (a - b).abs() <= CLOSE * (a.abs() + b.abs()) + f64::MIN_POSITIVE
}

/// Whether `other` equals the term at all test points.
fn always(term: &Tree, values: &[f64], other: impl Fn(&Place) -> f64) -> bool {
    // Relative to the size of the term, which may pass zero.
    let size = places().map(|at| term.value(values, &at).abs()).fold(0.0, f64::max);
    places().all(|at| (term.value(values, &at) - other(&at)).abs() <= CLOSE * size)
}

/// Whether the term is periodic in the angle.
pub fn repeats_every_turn(term: &Tree, values: &[f64]) -> bool {
    always(term, values, |at| term.value(values, &Place { theta: at.theta + TAU, ..*at }))
}

/// Whether the term pulls back, on both sides, from angles that many turns lead to.
pub fn pulls_back(term: &Tree, values: &[f64]) -> bool {
    let pull = |theta: f64, at: Place| theta.signum() * term.value(values, &Place { theta, ..at });
    places().all(|at| [-FAR, FAR].iter().all(|theta| pull(*theta, at) < -1.0))
}

/// Whether the term is periodic with the drive.
pub fn repeats_every_period(term: &Tree, values: &[f64]) -> bool {
    always(term, values, |at| term.value(values, &Place { phase: at.phase + TAU, ..*at }))
}

/// Whether the term is antisymmetric under reflection and this shift of the drive's phase.
pub fn mirrors(term: &Tree, values: &[f64], later: f64) -> bool {
    always(term, values, |at| {
        let (theta, velocity, sense) = (-at.theta, -at.velocity, -at.sense);
        -term.value(values, &Place { theta, velocity, sense, phase: at.phase + later, ..*at })
    })
}

/// Whether the term changes abruptly where the velocity passes zero.
pub fn jumps(term: &Tree, parameters: &[Parameter]) -> bool {
    usual(parameters).any(|values| {
        places().any(|at| {
            let side = |sense: f64| term.value(&values, &Place { velocity: 0.0, sense, ..at });
            !alike(side(1.0), side(-1.0))
        })
    })
}

/// Whether the term is zero wherever the velocity is.
pub fn vanishes_at_rest(term: &Tree, parameters: &[Parameter]) -> bool {
    usual(parameters).all(|values| {
        let size = places().map(|at| term.value(&values, &at).abs()).fold(0.0, f64::max);
        places().all(|at| {
            let still = Place { velocity: 0.0, ..at };
            term.value(&values, &still).abs() <= CLOSE * size
        })
    })
}

/// Whether the term is proportional to its first parameter.
pub fn is_proportional(term: &Tree, parameters: &[Parameter]) -> bool {
    usual(parameters).all(|values| {
        let mut double = values.clone();
        double[0] *= 2.0;
        always(term, &values, |at| 0.5 * term.value(&double, at))
    })
}

/// The role of the parameter at `place` of their list, by the term, its scaling and its typical range.
pub fn role(term: &Tree, parameters: &[Parameter], place: usize) -> Role {
    let Parameter { power, typical, unit, .. } = parameters[place];
    let turned = |values: &[f64]| {
        let mut values = values.to_vec();
        values[place] += TAU;
        values
    };
    let repeats = usual(parameters).all(|values| {
        let further = turned(&values);
        always(term, &values, |at| term.value(&further, at))
    });
    let bare = power == Power::Of(0) && unit == "1";
    if place == 0 {
        Role::Size
    } else if parameters.iter().any(|other| other.power == Power::TwoMinus(place)) {
        Role::Power
    } else if repeats {
        Role::Phase
    } else if typical[0] < 0.0 {
        Role::Place
    } else if bare && typical.iter().all(|end| end.fract() == 0.0) {
        Role::Order
    } else if bare {
        Role::Power
    } else if power == Power::Of(-1) {
        Role::Time
    } else {
        Role::Width
    }
}

/// A point at which the term is not a number.
pub fn gap(term: &Tree, parameters: &[Parameter]) -> Option<(Place, Vec<f64>)> {
    let still = places().map(|at| Place { velocity: 0.0, ..at });
    let bottom = places().map(|at| Place { theta: 0.0, ..at });
    let all: Vec<Place> = places().chain(still).chain(bottom).chain([NOWHERE]).collect();
    usual(parameters).find_map(|values| {
        let at = all.iter().find(|at| !term.value(&values, at).is_finite())?;
        Some((*at, values.clone()))
    })
}

/// Whether the units balance: with another unit of time the term is the same acceleration. If they
/// do not, the power of `w0` that the first parameter would need, where there is one.
///
/// # Errors
/// The power of `w0` that the first parameter would need.
pub fn balances(term: &Tree, parameters: &[Parameter]) -> Result<(), Option<f64>> {
    let mut powers = Vec::new();
    for values in usual(parameters) {
        let scaled: Vec<f64> = parameters
            .iter()
            .zip(&values)
            .map(|(p, value)| value * UNIT.powf(power(p, &values)))
            .collect();
        for at in places() {
            let other = Place {
                velocity: UNIT * at.velocity,
                lab: at.lab / UNIT,
                frequency: UNIT * at.frequency,
                ..at
            };
            let wanted = UNIT * UNIT * term.value(&values, &at);
            let found = term.value(&scaled, &other);
            if !alike(wanted, found) {
                let first = parameters.first().map_or(0.0, |p| power(p, &values));
                powers.push(first + (wanted / found).ln() / UNIT.ln());
            }
        }
    }
    let Some(first) = powers.first() else { return Ok(()) };
    let one = powers.iter().all(|power| (power - first).abs() < 1e-6);
    Err((one && is_proportional(term, parameters)).then(|| (first * 1e6).round() / 1e6))
}

fn power(parameter: &Parameter, values: &[f64]) -> f64 {
    match parameter.power {
        Power::Of(power) => f64::from(power),
        Power::Real(power) => power,
        Power::TwoMinus(place) => 2.0 - values[place],
    }
}
