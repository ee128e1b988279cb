//! A drive whose frequency differs from its stated value.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct DriveFrequency;

impl Law for DriveFrequency {
    const DEFINITION: Definition<'static> = Definition {
        name: "drive_frequency",
        group: Group::Drive,
        family: Family::Drive,
        action: Action::Drive,
        formula: "omega (1 + e)",
        parameters: Parameters::Library(&[Parameter {
            name: "e",
            role: Role::Size,
            unit: "1",
            power: Power::Of(0),
            range: [-0.9, 10.0],
            typical: [-0.01, 0.01],
            meaning: "error of the frequency over it",
        }]),
        revealed_by: "forced runs, the longer the better",
        mappable: Mappable::Yes,
    };

    fn drive<R: Real>([e, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        motion.omega = motion.omega + motion.omega * *e;
    }
}
