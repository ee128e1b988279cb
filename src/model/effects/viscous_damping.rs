//! Damping in proportion to the velocity, the paper's `gamma`.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct ViscousDamping;

impl Law for ViscousDamping {
    const DEFINITION: Definition<'static> = Definition {
        name: "viscous_damping",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Velocity,
        formula: "-gamma v",
        parameters: Parameters::Library(&[Parameter {
            name: "gamma",
            role: Role::Size,
            unit: "1/s",
            power: Power::Of(1),
            range: [0.0, f64::INFINITY],
            typical: [1e-3, 1.0],
            meaning: "c/(m w0), twice the damping ratio; in SI c/m",
        }]),
        revealed_by: "any decay",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([gamma, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*gamma * at.velocity)
    }
}
