//! An impulse on the pendulum or its stand.
//!
//! The force rises and falls as a Gaussian of the width 0.05 over `w0`: short for the pendulum, and long
//! for a step of the integrator. The velocity changes by `J`.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

/// One over the width.
const SHARPNESS: f64 = 20.0;
/// `1/sqrt(2 pi)`.
const NORMAL: f64 = 0.398_942_280_401_432_7;

pub struct Impulses;

impl Law for Impulses {
    const DEFINITION: Definition<'static> = Definition {
        name: "impulses",
        group: Group::Torque,
        family: Family::Drive,
        action: Action::Timed,
        formula: "+J exp(-s^2/2)/(w sqrt(2 pi)), s = (t - t0)/w, w = 0.05/w0, t time in the laboratory",
        parameters: Parameters::Library(&[
            Parameter {
                name: "J",
                role: Role::Size,
                unit: "rad/s",
                power: Power::Of(1),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [1e-4, 0.1],
                meaning: "change of the velocity",
            },
            Parameter {
                name: "t0",
                role: Role::Instant,
                unit: "s",
                power: Power::Of(-1),
                range: [f64::NEG_INFINITY, f64::INFINITY],
                typical: [0.0, 3000.0],
                meaning: "time of the knock, in the laboratory",
            },
        ]),
        revealed_by: "residuals that set in at once and ring on",
        mappable: Mappable::No,
    };

    #[inline(always)]
    fn torque<R: Real>([jump, t0, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let since = (at.lab - *t0).scale(SHARPNESS);
        *jump * (since * since.scale(-0.5)).exponential().scale(NORMAL * SHARPNESS)
    }

    fn keeps_mirror([jump, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *jump == 0.0
    }

    fn bars_maps(_: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        Some("it happens once")
    }
}
