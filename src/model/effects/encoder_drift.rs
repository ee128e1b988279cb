//! A sensor whose zero drifts: a warming potentiometer, a gyroscope's rate integrated with its own zero.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;

pub struct EncoderDrift;

impl Law for EncoderDrift {
    const DEFINITION: Definition<'static> = Definition {
        name: "encoder_drift",
        group: Group::Reading,
        family: Family::Reading,
        action: Action::Reading,
        formula: "reading theta + r t, t time in the laboratory",
        parameters: Parameters::Library(&[Parameter {
            name: "r",
            role: Role::Size,
            unit: "rad/s",
            power: Power::Of(1),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-7, 1e-3],
            meaning: "rate at which the reading of theta = 0 changes",
        }]),
        revealed_by: "where the swings are centred, early and late",
        mappable: Mappable::Yes,
    };

    fn reading<R: Real>([r, ..]: &[R; MOST_PARAMETERS], theta: R, _: R, lab: R) -> R {
        theta + *r * lab
    }
}
