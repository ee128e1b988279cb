//! A sensor whose disc does not turn about its centre.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::lanes::sine::Fine;

pub struct EncoderEccentricity;

impl Law for EncoderEccentricity {
    const DEFINITION: Definition<'static> = Definition {
        name: "encoder_eccentricity",
        group: Group::Reading,
        family: Family::Reading,
        action: Action::Reading,
        formula: "reading theta + e sin(theta + psi)",
        parameters: Parameters::Library(&[
            Parameter {
                name: "e",
                role: Role::Size,
                unit: "rad",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.1],
                meaning: "greatest error",
            },
            Parameter {
                name: "psi",
                role: Role::Phase,
                unit: "rad",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [-3.15, 3.15],
                meaning: "phase at theta = 0",
            },
        ]),
        revealed_by: "any motion through large angles",
        mappable: Mappable::Yes,
    };

    fn reading<R: Real>([e, psi, ..]: &[R; MOST_PARAMETERS], theta: R, _: R, _: R) -> R {
        let sine = (theta + *psi).scale(std::f64::consts::FRAC_1_PI).sine::<Fine>();
        theta + *e * sine
    }
}
