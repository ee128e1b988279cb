//! A constant torque: a motor's, a tilted magnet's, a twisted cable's.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct BiasTorque;

impl Law for BiasTorque {
    const DEFINITION: Definition<'static> = Definition {
        name: "bias_torque",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Position,
        formula: "+torque",
        parameters: Parameters::Library(&[Parameter {
            name: "torque",
            role: Role::Size,
            unit: "rad/s^2",
            power: Power::Of(2),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.3, 0.3],
            meaning: "torque over m l^2 w0^2",
        }]),
        revealed_by: "any record whose zero is known; equal to an asymmetric friction while sliding",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([torque, ..]: &[R; MOST_PARAMETERS], _: &Point<R>) -> R {
        *torque
    }

    fn keeps_mirror([torque, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *torque == 0.0
    }
}
