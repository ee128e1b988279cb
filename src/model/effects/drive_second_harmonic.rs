//! A drive that is not quite harmonic: a crank of finite length, a shaker at its limit.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct DriveSecondHarmonic;

impl Law for DriveSecondHarmonic {
    const DEFINITION: Definition<'static> = Definition {
        name: "drive_second_harmonic",
        group: Group::Drive,
        family: Family::Drive,
        action: Action::FurtherDrive,
        formula: "a = p cos(x) + e p cos(2 x + phase), x the drive's phase",
        parameters: Parameters::Library(&[
            Parameter {
                name: "e",
                role: Role::Size,
                unit: "1",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-3, 0.3],
                meaning: "amplitude at twice the frequency over that of the drive",
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
        revealed_by: "forced runs",
        mappable: Mappable::Yes,
    };

    fn drive<R: Real>([e, phase, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        (motion.second, motion.second_phase) = (*e, *phase);
    }
}
