//! Viscous damping that changes as the rig warms up or wears.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct ViscousDrift;

impl Law for ViscousDrift {
    const DEFINITION: Definition<'static> = Definition {
        name: "viscous_drift",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Velocity,
        formula: "-r t v, t time in the laboratory",
        parameters: Parameters::Library(&[Parameter {
            name: "r",
            role: Role::Size,
            unit: "1/s^2",
            power: Power::Of(2),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-1e-4, 1e-4],
            meaning: "rate of change of gamma",
        }]),
        revealed_by: "the same run again, hours later",
        mappable: Mappable::Frozen,
    };

    #[inline(always)]
    fn torque<R: Real>([r, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*r * at.lab * at.velocity)
    }
}
