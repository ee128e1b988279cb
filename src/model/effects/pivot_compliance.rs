//! A pivot with horizontal compliance, and its own mode.
//!
//! With the pivot's displacement `x` over the pendulum's length, Lagrange's equations are
//! `th'' + x'' cos th = all else` and `x'' + 2 z wx x' + wx^2 x = -mu (th'' cos th - v^2 sin th)`. With
//! the momentum `y = x' + mu v cos th` in place of `x'` they need no `th''` on the right:
//! `x' = y - mu v cos th`, `y' = -2 z wx x' - wx^2 x` and
//! `(1 - mu cos^2 th) th'' = all else + cos th (2 z wx x' + wx^2 x - mu v^2 sin th)`. Where friction
//! makes `th''` jump, `x''` does, but neither `y` nor its rate.
//!
//! A motion begins with `x' = 0` and with `x` at its equilibrium under the rod's force, `mu sin th
//! (w0^2 (1 + a) cos th + v^2)/wx^2`. While friction holds the pendulum the mode continues to
//! oscillate, and its force may release the pendulum.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct PivotCompliance;

impl Law for PivotCompliance {
    const DEFINITION: Definition<'static> = Definition {
        name: "pivot_compliance",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Inertia,
        formula: "-x'' cos theta, x'' + 2 z wx x' + wx^2 x = -mu (theta'' cos theta - v^2 sin theta)",
        parameters: Parameters::Library(&[
            Parameter {
                name: "mu",
                role: Role::Size,
                unit: "1",
                power: Power::Of(0),
                range: [f64::NEG_INFINITY, 0.9],
                typical: [0.003, 0.1],
                meaning: "the pendulum's mass over that which moves with the pivot, itself included",
            },
            Parameter {
                name: "wx",
                role: Role::Mode,
                unit: "rad/s",
                power: Power::Of(1),
                range: [1.0, 30.0],
                typical: [4.0, 16.0],
                meaning: "angular frequency of the pivot's mode; beyond 30 w0 the pivot is as good as fixed",
            },
            Parameter {
                name: "z",
                role: Role::Mode,
                unit: "1",
                power: Power::Of(0),
                range: [0.0, f64::INFINITY],
                typical: [0.005, 0.1],
                meaning: "damping ratio of that mode",
            },
        ]),
        revealed_by: "fast turns beside small swings: a ripple that is strongest near wx",
        mappable: Mappable::No,
    };

    fn ready<R: Real>([mu, wx, z]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [mu, wx * wx, (z * wx).scale(2.0)]
    }

    #[inline(always)]
    fn torque<R: Real>(parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let cosine = at.cosine();
        let [_, pull] = rates(parameters, at, cosine);
        let whirl = parameters[0] * at.velocity * at.velocity * at.sine;
        -(cosine * (pull + whirl))
    }

    #[inline(always)]
    fn inertia<R: Real>(parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let cosine = at.cosine();
        -(parameters[0] * cosine * cosine)
    }

    #[inline(always)]
    fn sway<R: Real>(parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> Option<[R; 2]> {
        Some(rates(parameters, at, at.cosine()))
    }

    fn aside<R: Real>([mu, stiffness, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let pull = at.vertical.mul_add(at.cosine(), at.velocity * at.velocity);
        *mu * at.sine * pull / *stiffness
    }

    fn bars_maps(_: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        Some("its sideways mode has a motion of its own, which no start says")
    }
}

/// `x'` and `y'`.
#[inline(always)]
fn rates<R: Real>(
    [mu, stiffness, loss]: &[R; MOST_PARAMETERS],
    at: &Point<R>,
    cosine: R,
) -> [R; 2] {
    let [x, momentum] = at.sway;
    let rate = momentum - *mu * at.velocity * cosine;
    [rate, -(stiffness.mul_add(x, *loss * rate))]
}
