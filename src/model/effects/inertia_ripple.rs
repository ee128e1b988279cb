//! An inertia that varies with the angle: a joint, a belt, a camera on the arm.
//!
//! `I th'' + I' v^2/2 = all else` with `I = 1 + e cos(n th + psi)`, from Lagrange's equation.

use std::f64::consts::FRAC_1_PI;

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, NOT_PERIODIC, Parameter, Parameters, Point,
    Power, Role,
};
use crate::lanes::Real;
use crate::lanes::sine::Fine;

pub struct InertiaRipple;

impl Law for InertiaRipple {
    const DEFINITION: Definition<'static> = Definition {
        name: "inertia_ripple",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Inertia,
        formula: "inertia 1 + e cos(n theta + psi): -e cos(n theta + psi) th'' + e n sin(n theta + psi) v^2/2",
        parameters: Parameters::Library(&[
            Parameter {
                name: "e",
                role: Role::Size,
                unit: "1",
                power: Power::Of(0),
                range: [-0.9, 0.9],
                typical: [1e-4, 0.1],
                meaning: "amplitude of the variation over the mean",
            },
            Parameter {
                name: "n",
                role: Role::Order,
                unit: "1",
                power: Power::Of(0),
                range: [0.0, 1000.0],
                typical: [1.0, 3.0],
                meaning: "periods a turn; in maps a whole number",
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
        revealed_by: "slow turns beside fast ones, against a bearing harmonic",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([e, n, psi]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let sine = (*n * at.theta + *psi).scale(FRAC_1_PI).sine::<Fine>();
        (*e * *n * sine * at.velocity * at.velocity).scale(0.5)
    }

    #[inline(always)]
    fn inertia<R: Real>([e, n, psi]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        *e * (*n * at.theta + *psi).scale(FRAC_1_PI).cosine::<Fine>()
    }

    fn keeps_mirror([e, _, psi]: &[f64; MOST_PARAMETERS]) -> bool {
        *e == 0.0 || psi.sin().abs() < 1e-15
    }

    fn bars_maps([e, n, _]: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        (*e != 0.0 && n.fract() != 0.0).then_some(NOT_PERIODIC)
    }
}
