//! Coulomb friction that changes as the rig warms up or wears.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct CoulombDrift;

impl Law for CoulombDrift {
    const DEFINITION: Definition<'static> = Definition {
        name: "coulomb_drift",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::Friction,
        formula: "-r t sign(v), t time in the laboratory",
        parameters: Parameters::Library(&[Parameter {
            name: "r",
            role: Role::Size,
            unit: "rad/s^3",
            power: Power::Of(3),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-1e-4, 1e-4],
            meaning: "rate of change of theta_r; where it has used that up friction is negative",
        }]),
        revealed_by: "the same run again, hours later",
        mappable: Mappable::Frozen,
    };

    #[inline(always)]
    fn friction<R: Real>([r, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        *r * at.lab
    }
}
