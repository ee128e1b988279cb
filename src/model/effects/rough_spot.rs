//! Dry friction at one angle: dirt in the bearing, a cable that rubs.

use std::f64::consts::FRAC_1_PI;

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;
use crate::lanes::sine::Fine;

pub struct RoughSpot;

impl Law for RoughSpot {
    const DEFINITION: Definition<'static> = Definition {
        name: "rough_spot",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::Friction,
        formula: "-f exp(-(1 - cos(theta - th0))/w^2) sign(v)",
        parameters: Parameters::Library(&[
            Parameter {
                name: "f",
                role: Role::Size,
                unit: "rad/s^2",
                power: Power::Of(2),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.3],
                meaning: "friction there beyond that elsewhere",
            },
            Parameter {
                name: "th0",
                role: Role::Place,
                unit: "rad",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [-1.0, 1.0],
                meaning: "angle at which it is",
            },
            Parameter {
                name: "w",
                role: Role::Width,
                unit: "rad",
                power: Power::Of(0),
                range: [1e-2, f64::INFINITY],
                typical: [0.1, 0.4],
                meaning: "width: at w from the middle it is exp(-1/2) of the most",
            },
        ]),
        revealed_by: "swings that end short of it beside wider ones",
        mappable: Mappable::Yes,
    };

    fn ready<R: Real>([f, th0, w]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [f, th0, w.like(1.0) / (w * w)]
    }

    #[inline(always)]
    fn friction<R: Real>([f, th0, narrowness]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let away = (at.theta - *th0).scale(FRAC_1_PI).cosine::<Fine>() - at.constant(1.0);
        *f * (away * *narrowness).exponential()
    }

    fn keeps_mirror([f, th0, _]: &[f64; MOST_PARAMETERS]) -> bool {
        // In the middle or at the top it is its own mirror image.
        *f == 0.0 || th0.sin().abs() < 1e-15
    }
}
