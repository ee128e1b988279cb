//! Viscous damping that falls to a new level as the grease warms up.

use super::coulomb_warm_up::{TIME_CONSTANT, cooled};
use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct ViscousWarmUp;

impl Law for ViscousWarmUp {
    const DEFINITION: Definition<'static> = Definition {
        name: "viscous_warm_up",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Velocity,
        formula: "+b (1 - exp(-t/tau)) v, t time in the laboratory",
        parameters: Parameters::Library(&[
            Parameter {
                name: "b",
                role: Role::Size,
                unit: "1/s",
                power: Power::Of(1),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.1],
                meaning: "what gamma falls by in the end; below 0 it rises",
            },
            TIME_CONSTANT,
        ]),
        revealed_by: "the same run before, while and after the rig warms up",
        mappable: Mappable::Frozen,
    };

    fn ready<R: Real>([b, tau, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [b, tau.like(1.0) / tau, rest]
    }

    #[inline(always)]
    fn torque<R: Real>([b, rate, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*b * cooled(*rate, at) * at.velocity)
    }
}
