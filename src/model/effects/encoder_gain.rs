//! A sensor with a wrong scale.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;

pub struct EncoderGain;

impl Law for EncoderGain {
    const DEFINITION: Definition<'static> = Definition {
        name: "encoder_gain",
        group: Group::Reading,
        family: Family::Reading,
        action: Action::Reading,
        formula: "reading (1 + e) theta",
        parameters: Parameters::Library(&[Parameter {
            name: "e",
            role: Role::Size,
            unit: "1",
            power: Power::Of(0),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.1, 0.1],
            meaning: "error of the scale over it",
        }]),
        revealed_by: "turns; in swings the period against the amplitude",
        mappable: Mappable::Yes,
    };

    const SCALES: bool = true;

    fn reading<R: Real>([e, ..]: &[R; MOST_PARAMETERS], theta: R, _: R, _: R) -> R {
        theta + *e * theta
    }
}
