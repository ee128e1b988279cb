//! Dry friction of constant magnitude, the paper's `theta_r = Tr / w0^2`.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct CoulombFriction;

impl Law for CoulombFriction {
    const DEFINITION: Definition<'static> = Definition {
        name: "coulomb_friction",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::Friction,
        formula: "-theta_r sign(v)",
        parameters: Parameters::Library(&[Parameter {
            name: "theta_r",
            role: Role::Size,
            unit: "rad/s^2",
            power: Power::Of(2),
            range: [0.0, f64::INFINITY],
            typical: [1e-4, 0.3],
            meaning: "friction torque over m l^2 w0^2; in SI Tr",
        }]),
        revealed_by: "the last swings of a decay, which it ends in a finite time",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn friction<R: Real>([theta_r, ..]: &[R; MOST_PARAMETERS], _: &Point<R>) -> R {
        *theta_r
    }
}
