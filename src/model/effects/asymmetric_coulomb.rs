//! Dry friction that differs between the two senses of rotation: `theta_r + d` forward, `theta_r -
//! d` backward.
//!
//! `-(theta_r + d sign v) sign v = -theta_r sign v - d`, and a load `L` at rest is held while
//! `-(theta_r - d) <= L <= theta_r + d`, which is `|L - d| <= theta_r`: in motion and at rest it
//! equals the constant torque `-d`, as long as `|d| <= theta_r`. No record of one rig distinguishes
//! it from a bias torque.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct AsymmetricCoulomb;

impl Law for AsymmetricCoulomb {
    const DEFINITION: Definition<'static> = Definition {
        name: "asymmetric_coulomb",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::Position,
        formula: "-d |sign(v)|",
        parameters: Parameters::Library(&[Parameter {
            name: "d",
            role: Role::Size,
            unit: "rad/s^2",
            power: Power::Of(2),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [-0.3, 0.3],
            meaning: "half the difference between the frictions forth and back, below theta_r",
        }]),
        revealed_by: "the rig turned round: a bias torque keeps its sense, a friction turns with it",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([d, ..]: &[R; MOST_PARAMETERS], _: &Point<R>) -> R {
        -*d
    }

    fn keeps_mirror([d, ..]: &[f64; MOST_PARAMETERS]) -> bool {
        *d == 0.0
    }
}
