//! The next odd power of the velocity after viscous damping.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct CubicDamping;

impl Law for CubicDamping {
    const DEFINITION: Definition<'static> = Definition {
        name: "cubic_damping",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Velocity,
        formula: "-k3 v^3",
        parameters: Parameters::Library(&[Parameter {
            name: "k3",
            role: Role::Size,
            unit: "s/rad^2",
            power: Power::Of(-1),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-4, 0.1],
            meaning: "coefficient over the moment of inertia",
        }]),
        revealed_by: "large amplitudes and rotation",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([k3, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*k3 * at.velocity * at.velocity * at.velocity)
    }
}
