//! A drive whose frequency drifts.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct DriveChirp;

impl Law for DriveChirp {
    const DEFINITION: Definition<'static> = Definition {
        name: "drive_chirp",
        group: Group::Drive,
        family: Family::Drive,
        action: Action::FurtherDrive,
        formula: "phase omega t + r t^2/2 + phi, t since the run began",
        parameters: Parameters::Library(&[Parameter {
            name: "r",
            role: Role::Size,
            unit: "rad/s^2",
            power: Power::Of(2),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-7, 1e-3],
            meaning: "rate of change of the drive's angular frequency",
        }]),
        revealed_by: "long forced runs",
        mappable: Mappable::No,
    };

    fn drive<R: Real>([r, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        motion.chirp = *r;
    }

    fn bars_maps([r, ..]: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        (*r != 0.0).then_some("no two periods of its drive are alike, and a map repeats one")
    }
}
