//! A drive whose phase differs from its stated value; equivalent to a late trigger.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct DrivePhase;

impl Law for DrivePhase {
    const DEFINITION: Definition<'static> = Definition {
        name: "drive_phase",
        group: Group::Drive,
        family: Family::Drive,
        action: Action::Drive,
        formula: "phase + d",
        parameters: Parameters::Library(&[Parameter {
            name: "d",
            role: Role::Size,
            unit: "rad",
            power: Power::Of(0),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.5, 0.5],
            meaning: "error of the phase",
        }]),
        revealed_by: "forced runs whose phase is known",
        mappable: Mappable::Yes,
    };

    fn drive<R: Real>([d, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        motion.phase = motion.phase + *d;
    }
}
