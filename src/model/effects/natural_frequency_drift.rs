//! A natural frequency that drifts, as the rod's length changes with temperature, or a mass creeps.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct NaturalFrequencyDrift;

impl Law for NaturalFrequencyDrift {
    const DEFINITION: Definition<'static> = Definition {
        name: "natural_frequency_drift",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Driven,
        formula: "-r t (1 + a) sin(theta), in SI times w0^2, t time in the laboratory, \
                  a the pivot's acceleration over gravity",
        parameters: Parameters::Library(&[Parameter {
            name: "r",
            role: Role::Size,
            unit: "1/s",
            power: Power::Of(1),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-9, 1e-5],
            meaning: "rate of change of w0^2, over w0^2",
        }]),
        revealed_by: "the same run again, hours later",
        mappable: Mappable::Frozen,
    };

    #[inline(always)]
    fn torque<R: Real>([r, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(*r * at.lab * at.vertical * at.sine)
    }
}
