//! A drive whose amplitude differs from its stated value.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct DriveAmplitude;

impl Law for DriveAmplitude {
    const DEFINITION: Definition<'static> = Definition {
        name: "drive_amplitude",
        group: Group::Drive,
        family: Family::Drive,
        action: Action::Drive,
        formula: "p (1 + e)",
        parameters: Parameters::Library(&[Parameter {
            name: "e",
            role: Role::Size,
            unit: "1",
            power: Power::Of(0),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.3, 0.3],
            meaning: "error of the amplitude over it",
        }]),
        revealed_by: "forced runs",
        mappable: Mappable::Yes,
    };

    fn drive<R: Real>([e, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        motion.p = motion.p + motion.p * *e;
    }
}
