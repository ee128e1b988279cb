//! A pivot that also moves sideways, at the drive's frequency.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct LateralDrive;

impl Law for LateralDrive {
    const DEFINITION: Definition<'static> = Definition {
        name: "lateral_drive",
        group: Group::Drive,
        family: Family::Drive,
        action: Action::FurtherDrive,
        formula: "-e p cos(x + phase) cos(theta), x the drive's phase",
        parameters: Parameters::Library(&[
            Parameter {
                name: "e",
                role: Role::Size,
                unit: "1",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-3, 0.3],
                meaning: "amplitude toward positive theta over that of the drive",
            },
            Parameter {
                name: "phase",
                role: Role::Phase,
                unit: "rad",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [-3.15, 3.15],
                meaning: "its phase against the drive",
            },
        ]),
        revealed_by: "forced runs, from rest above all",
        mappable: Mappable::Yes,
    };

    fn drive<R: Real>([e, phase, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        (motion.lateral, motion.lateral_phase) = (*e, *phase);
    }

    fn keeps_mirror([e, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *e == 0.0
    }
}
