//! A torque that repeats with the angle: the poles of a motor, an oval race.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, NOT_PERIODIC, Parameter, Parameters, Point,
    Power, Role,
};
use crate::lanes::Real;
use crate::lanes::sine::Fine;

pub struct BearingHarmonic;

impl Law for BearingHarmonic {
    const DEFINITION: Definition<'static> = Definition {
        name: "bearing_harmonic",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Position,
        formula: "+amplitude sin(n theta + psi)",
        parameters: Parameters::Library(&[
            Parameter {
                name: "amplitude",
                role: Role::Size,
                unit: "rad/s^2",
                power: Power::Of(2),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "amplitude of the torque per inertia",
            },
            Parameter {
                name: "n",
                role: Role::Order,
                unit: "1",
                power: Power::Of(0),
                range: [0.0, 1000.0],
                typical: [1.0, 12.0],
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
        revealed_by: "turns and large swings",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([amplitude, n, psi]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let angle = *n * at.theta + *psi;
        *amplitude * angle.scale(std::f64::consts::FRAC_1_PI).sine::<Fine>()
    }

    fn keeps_mirror([amplitude, _, psi]: &[f64; MOST_PARAMETERS]) -> bool {
        // Half a turn of psi only changes the sign.
        *amplitude == 0.0 || psi.sin().abs() < 1e-15
    }

    fn bars_maps([amplitude, n, _]: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        (*amplitude != 0.0 && n.fract() != 0.0).then_some(NOT_PERIODIC)
    }
}
