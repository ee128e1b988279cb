//! A magnetic brake: eddy currents in a conductor that passes a magnet.
//!
//! The torque grows with the velocity up to a critical one, where the currents' own field begins to
//! cancel the magnet's, and falls beyond (Smythe (1942), Trans. AIEE 61, 681; in this form Wouterse
//! (1991), IEE Proc. B 138, 153).

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct EddyBrake;

impl Law for EddyBrake {
    const DEFINITION: Definition<'static> = Definition {
        name: "eddy_brake",
        group: Group::Damping,
        family: Family::Damping,
        action: Action::Velocity,
        formula: "-b v/(1 + (v/vc)^2)",
        parameters: Parameters::Library(&[
            Parameter {
                name: "b",
                role: Role::Size,
                unit: "1/s",
                power: Power::Of(1),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "damping of slow motion, on top of gamma",
            },
            Parameter {
                name: "vc",
                role: Role::Width,
                unit: "rad/s",
                power: Power::Of(1),
                range: [1e-3, f64::INFINITY],
                typical: [0.3, 5.0],
                meaning: "critical velocity, at which the brake is strongest",
            },
        ]),
        revealed_by: "fast rotation, against the damping of small swings",
        mappable: Mappable::Yes,
    };

    fn ready<R: Real>([b, vc, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [b, vc.like(1.0) / vc, rest]
    }

    #[inline(always)]
    fn torque<R: Real>([b, slowness, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let part = at.velocity * *slowness;
        -(*b * at.velocity / (part * part + at.constant(1.0)))
    }
}
