//! A torque that repeats with the angle: the poles of a motor, an oval race.

use super::law::{Action, Definition, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Point, Power};
use crate::lanes::Real;
use crate::lanes::sine::Fine;

pub struct BearingHarmonic;

impl Law for BearingHarmonic {
    const DEFINITION: Definition = Definition {
        name: "bearing_harmonic",
        group: Group::Torque,
        action: Action::Position,
        formula: "+amplitude sin(n theta + psi)",
        parameters: &[
            Parameter {
                name: "amplitude",
                unit: "rad/s^2",
                power: Power::Of(2),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "amplitude of the torque per inertia",
            },
            Parameter {
                name: "n",
                unit: "1",
                power: Power::Of(0),
                range: [0.0, 1000.0],
                typical: [1.0, 12.0],
                meaning: "periods a turn",
            },
            Parameter {
                name: "psi",
                unit: "rad",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [-3.15, 3.15],
                meaning: "phase at theta = 0",
            },
        ],
        keeps_mirror: false,
        revealed_by: "turns and large swings",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([amplitude, n, psi]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let angle = *n * at.theta + *psi;
        *amplitude * angle.scale(std::f64::consts::FRAC_1_PI).sine::<Fine>()
    }
}
