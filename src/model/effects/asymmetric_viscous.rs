//! Viscous damping that differs between the two senses of rotation.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct AsymmetricViscous;

impl Law for AsymmetricViscous {
    const DEFINITION: Definition<'static> = Definition {
        name: "asymmetric_viscous",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Kinked,
        formula: "-b |v|",
        parameters: Parameters::Library(&[Parameter {
            name: "b",
            role: Role::Size,
            unit: "1/s",
            power: Power::Of(1),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.3, 0.3],
            meaning: "half the difference between the coefficients forth and back",
        }]),
        revealed_by: "decays from both sides; amplitudes against a bias torque",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([b, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*b * at.speed())
    }

    fn keeps_mirror([b, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *b == 0.0
    }
}
