//! Friction of a contact that yields like a spring before it slips.
//!
//! Dahl (1968), A solid friction model, Aerospace report TOR-0158(3107-18)-1, with exponent 1: the
//! part `z` of the friction that has built up obeys `dz/dtheta = (sign(v) - z)/zc`. While the sense
//! `s` of the motion is held, `z = s - (s - z0) exp(-s (theta - theta0)/zc)` from the last turn, at
//! `theta0` with `z0`, on: so a trajectory keeps these two numbers and needs no further equation. A
//! motion begins with `z = 0`.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct DahlFriction;

impl Law for DahlFriction {
    const DEFINITION: Definition<'static> = Definition {
        name: "dahl_friction",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::Kinked,
        formula: "-f z, z' = (v - |v| z)/zc",
        parameters: Parameters::Library(&[
            Parameter {
                name: "f",
                role: Role::Size,
                unit: "rad/s^2",
                power: Power::Of(2),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "friction after a long way in one sense",
            },
            Parameter {
                name: "zc",
                role: Role::Width,
                unit: "rad",
                power: Power::Of(0),
                range: [1e-3, f64::INFINITY],
                typical: [0.01, 0.3],
                meaning: "angle over which it builds up after a turn",
            },
        ]),
        revealed_by: "the last swings of a decay, which do not stop where Coulomb friction holds",
        mappable: Mappable::No,
    };

    fn ready<R: Real>([f, zc, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [f, zc.like(1.0) / zc, rest]
    }

    #[inline(always)]
    fn torque<R: Real>(parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -(parameters[0] * built_up(parameters[1], at))
    }

    #[inline(always)]
    fn kept<R: Real>([_, stiffness, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> Option<R> {
        Some(built_up(*stiffness, at))
    }

    fn bars_maps(_: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        Some("it depends on where the motion last turned, which no start says")
    }
}

/// The part of the friction that has built up.
#[inline(always)]
fn built_up<R: Real>(stiffness: R, at: &Point<R>) -> R {
    let [turned, before] = at.past;
    let path = (at.theta - turned) * at.sense;
    at.sense - (at.sense - before) * (-(path * stiffness)).exponential()
}
