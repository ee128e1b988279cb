//! Friction that is greater at rest and decreases with the velocity.
//!
//! The Gaussian form of Armstrong-Helouvry, Dupont & Canudas de Wit (1994), Automatica 30, 1083.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct StribeckFriction;

impl Law for StribeckFriction {
    const DEFINITION: Definition<'static> = Definition {
        name: "stribeck_friction",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::SlidingFriction,
        formula: "-a exp(-(v/vs)^2) sign(v)",
        parameters: Parameters::Library(&[
            Parameter {
                name: "a",
                role: Role::Size,
                unit: "rad/s^2",
                power: Power::Of(2),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "friction at rest less that of fast motion; may be negative",
            },
            Parameter {
                name: "vs",
                role: Role::Width,
                unit: "rad/s",
                power: Power::Of(1),
                range: [1e-3, f64::INFINITY],
                typical: [0.02, 1.0],
                meaning: "velocity over which it falls off",
            },
        ]),
        revealed_by: "the last swings of a decay, against Coulomb friction in the earlier ones",
        mappable: Mappable::Yes,
    };

    fn ready<R: Real>([a, vs, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [a, vs.like(1.0) / vs, rest]
    }

    #[inline(always)]
    fn friction<R: Real>([a, slowness, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let part = at.velocity * *slowness;
        *a * (-(part * part)).exponential()
    }
}
