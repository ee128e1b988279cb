//! Drag with any power of the velocity, between laminar and turbulent.
//!
//! `|v|^n sign v` is `v (v^2 + e^2)^((n - 1)/2)` with `e = 1e-6`, far below the resolution of a
//! sensor: so the derivatives by velocity and power are finite at rest too. Powers below 1/2 are
//! refused: they are practically dry friction, too abrupt for steps without events.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

/// The square of the velocity at which the power law ends.
const FLOOR: f64 = 1e-12;

pub struct PowerLawDrag;

impl Law for PowerLawDrag {
    const DEFINITION: Definition<'static> = Definition {
        name: "power_law_drag",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Kinked,
        formula: "-q |v|^n sign(v)",
        parameters: Parameters::Library(&[
            Parameter {
                name: "q",
                role: Role::Size,
                unit: "rad^(1-n) s^(n-2)",
                power: Power::TwoMinus(1),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "drag at unit velocity over the moment of inertia",
            },
            Parameter {
                name: "n",
                role: Role::Power,
                unit: "1",
                power: Power::Of(0),
                range: [0.5, 4.0],
                typical: [1.1, 3.0],
                meaning: "power of the velocity; linear where |v| < 1e-6",
            },
        ]),
        revealed_by: "large amplitudes and rotation, against small ones",
        mappable: Mappable::Yes,
    };

    fn ready<R: Real>([q, n, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [-q, (n - n.like(1.0)).scale(0.5), rest]
    }

    #[inline(always)]
    fn torque<R: Real>([minus_q, power, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let square = at.velocity * at.velocity + at.constant(FLOOR);
        *minus_q * at.velocity * (*power * square.logarithm()).exponential()
    }
}
