//! A tilted rig: gravity is at an angle to the line of the drive and to the sensor's zero.
//!
//! In a free decay equal to an offset of the encoder: `theta + d` then obeys the equation of `theta`.

use std::f64::consts::FRAC_1_PI;

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;
use crate::lanes::sine::Fine;

pub struct RigTilt;

impl Law for RigTilt {
    const DEFINITION: Definition<'static> = Definition {
        name: "rig_tilt",
        group: Group::Torque,
        family: Family::PositionTorque,
        action: Action::Position,
        formula: "-(sin(theta + d) - sin(theta)), in SI times w0^2",
        parameters: Parameters::Library(&[Parameter {
            name: "d",
            role: Role::Size,
            unit: "rad",
            power: Power::Of(0),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.1, 0.1],
            meaning: "angle by which gravity is turned; it hangs at -d",
        }]),
        revealed_by: "forced runs beside free ones, where an encoder offset differs from it",
        mappable: Mappable::Yes,
    };

    /// `sin d` and `cos d - 1 = -2 sin(d / 2)^2`, which keeps its digits.
    fn ready<R: Real>([d, _, rest]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        let half = d.scale(0.5 * FRAC_1_PI).sine::<Fine>();
        [d.scale(FRAC_1_PI).sine::<Fine>(), (half * half).scale(-2.0), rest]
    }

    #[inline(always)]
    fn torque<R: Real>([sine, cosine, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        -((*sine * at.cosine() + *cosine * at.sine) / at.per_gravity)
    }

    fn keeps_mirror([d, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *d == 0.0
    }
}
