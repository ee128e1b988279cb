//! A sensor with a zero error; in one free decay equivalent to a tilt of the rig.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;

pub struct EncoderOffset;

impl Law for EncoderOffset {
    const DEFINITION: Definition<'static> = Definition {
        name: "encoder_offset",
        group: Group::Reading,
        family: Family::Reading,
        action: Action::Reading,
        formula: "reading theta + d",
        parameters: Parameters::Library(&[Parameter {
            name: "d",
            role: Role::Size,
            unit: "rad",
            power: Power::Of(0),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.1, 0.1],
            meaning: "reading at theta = 0",
        }]),
        revealed_by: "decays, whose peaks then differ between the sides",
        mappable: Mappable::Yes,
    };

    fn reading<R: Real>([d, ..]: &[R; MOST_PARAMETERS], theta: R, _: R, _: R) -> R {
        theta + *d
    }
}
