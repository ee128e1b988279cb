//! A pivot that also moves sideways, at the drive's frequency.

use super::law::{Action, Definition, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Power};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct LateralDrive;

impl Law for LateralDrive {
    const DEFINITION: Definition = Definition {
        name: "lateral_drive",
        group: Group::Drive,
        action: Action::FurtherDrive,
        formula: "-amplitude cos(x + phase) cos(theta), x the drive's phase",
        parameters: &[
            Parameter {
                name: "amplitude",
                unit: "1",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-3, 0.3],
                meaning: "acceleration toward positive theta over gravity",
            },
            Parameter {
                name: "phase",
                unit: "rad",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [-3.15, 3.15],
                meaning: "its phase against the drive",
            },
        ],
        revealed_by: "forced runs, from rest above all",
        mappable: Mappable::Yes,
    };

    fn drive<R: Real>([amplitude, phase, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        (motion.lateral, motion.lateral_phase) = (*amplitude, *phase);
    }

    fn keeps_mirror([amplitude, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *amplitude == 0.0
    }
}
