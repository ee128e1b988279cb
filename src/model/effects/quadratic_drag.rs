//! Drag in proportion to the square of the velocity: air at high speed.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct QuadraticDrag;

impl Law for QuadraticDrag {
    const DEFINITION: Definition<'static> = Definition {
        name: "quadratic_drag",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Kinked,
        formula: "-q v |v|",
        parameters: Parameters::Library(&[Parameter {
            name: "q",
            role: Role::Size,
            unit: "1/rad",
            power: Power::Of(0),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-4, 0.3],
            meaning: "drag coefficient over the moment of inertia",
        }]),
        revealed_by: "large amplitudes and rotation",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([q, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*q * at.velocity * at.speed())
    }
}
