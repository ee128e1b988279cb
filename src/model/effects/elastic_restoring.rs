//! A cable or a spiral spring that winds up turn by turn.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point,
    Power, Role,
};
use crate::lanes::Real;

pub struct ElasticRestoring;

impl Law for ElasticRestoring {
    const DEFINITION: Definition<'static> = Definition {
        name: "elastic_restoring",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Position,
        formula: "-k theta, theta not wrapped",
        parameters: Parameters::Library(&[Parameter {
            name: "k",
            role: Role::Size,
            unit: "1/s^2",
            power: Power::Of(2),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-4, 0.3],
            meaning: "stiffness over the moment of inertia",
        }]),
        revealed_by: "many turns in one direction",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([k, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*k * at.theta)
    }

    fn counts_turns([k, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *k != 0.0
    }
}
