//! Coulomb friction that falls to a new level as the bearing warms up.
//!
//! The heat flow in is constant and the flow out proportional to the stored heat: the temperature,
//! and all that depends on it, approaches its limit exponentially (Newton's law of cooling).

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct CoulombWarmUp;

impl Law for CoulombWarmUp {
    const DEFINITION: Definition<'static> = Definition {
        name: "coulomb_warm_up",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::Friction,
        formula: "+f (1 - exp(-t/tau)) sign(v), t time in the laboratory",
        parameters: Parameters::Library(&[
            Parameter {
                name: "f",
                role: Role::Size,
                unit: "rad/s^2",
                power: Power::Of(2),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.1],
                meaning: "what theta_r falls by in the end; below 0 it rises",
            },
            TIME_CONSTANT,
        ]),
        revealed_by: "the same run before, while and after the rig warms up",
        mappable: Mappable::Frozen,
    };

    fn ready<R: Real>([f, tau, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [f, tau.like(1.0) / tau, rest]
    }

    #[inline(always)]
    fn friction<R: Real>([f, rate, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        *f * cooled(*rate, at)
    }
}

/// The time over which a rig warms up.
pub const TIME_CONSTANT: Parameter = Parameter {
    name: "tau",
    role: Role::Time,
    unit: "s",
    power: Power::Of(-1),
    range: [1e-3, f64::INFINITY],
    typical: [100.0, 3200.0],
    meaning: "time constant of the warming",
};

/// `exp(-t rate) - 1`: 0 at first, -1 in the end.
#[inline(always)]
pub fn cooled<R: Real>(rate: R, at: &Point<R>) -> R {
    (-(at.lab * rate)).exponential() - at.constant(1.0)
}
