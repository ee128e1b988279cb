//! A magnet or a dent below the pendulum: a well around the angle 0, once every turn.
//!
//! The angle is wrapped. Half a turn away, where it jumps, the torque is below rounding for all
//! widths that are allowed.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct Magnet;

impl Law for Magnet {
    const DEFINITION: Definition<'static> = Definition {
        name: "magnet",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Position,
        formula: "-amplitude (x/width) exp(-x^2/(2 width^2)), x = theta wrapped",
        parameters: Parameters::Library(&[
            Parameter {
                name: "amplitude",
                role: Role::Size,
                unit: "rad/s^2",
                power: Power::Of(2),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "torque per inertia at x = width, times 1.65; below 0 it repels",
            },
            Parameter {
                name: "width",
                role: Role::Width,
                unit: "rad",
                power: Power::Of(0),
                range: [0.02, 0.4],
                typical: [0.05, 0.3],
                meaning: "angle of the greatest torque",
            },
        ]),
        revealed_by: "passes of the bottom, and where the last swings end",
        mappable: Mappable::Yes,
    };

    fn ready<R: Real>([amplitude, width, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [amplitude, width.like(1.0) / width, rest]
    }

    #[inline(always)]
    fn torque<R: Real>([amplitude, narrowness, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let part = at.wrapped() * *narrowness;
        -(*amplitude * part * (part * part).scale(-0.5).exponential())
    }
}
