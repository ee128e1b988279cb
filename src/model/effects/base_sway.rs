//! A floor, a table or a tower that sways sideways, at its own frequency.

use std::f64::consts::FRAC_1_PI;

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;
use crate::lanes::sine::Fine;

pub struct BaseSway;

impl Law for BaseSway {
    const DEFINITION: Definition<'static> = Definition {
        name: "base_sway",
        group: Group::Torque,
        family: Family::Drive,
        action: Action::Timed,
        formula: "-w0^2 amplitude cos(ws t + psi) cos(theta), t time in the laboratory",
        parameters: Parameters::Library(&[
            Parameter {
                name: "amplitude",
                role: Role::Size,
                unit: "g",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-5, 0.03],
                meaning: "amplitude of the acceleration toward positive theta, over gravity's",
            },
            Parameter {
                name: "ws",
                role: Role::Frequency,
                unit: "rad/s",
                power: Power::Of(1),
                range: [0.0, f64::INFINITY],
                typical: [0.1, 3.0],
                meaning: "angular frequency",
            },
            Parameter {
                name: "psi",
                role: Role::Phase,
                unit: "rad",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [-3.15, 3.15],
                meaning: "phase at t = 0",
            },
        ]),
        revealed_by: "a pendulum left at rest, and the ends of decays",
        mappable: Mappable::No,
    };

    #[inline(always)]
    fn torque<R: Real>([amplitude, ws, psi]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let sway = ws.mul_add(at.lab, *psi).scale(FRAC_1_PI).cosine::<Fine>();
        -(*amplitude * sway * at.cosine() / at.per_gravity)
    }

    fn keeps_mirror([amplitude, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *amplitude == 0.0
    }

    fn bars_maps(_: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        Some("it has a period of its own beside the drive's")
    }
}
