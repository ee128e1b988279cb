//! Friction proportional to the bearing's load: weight, drive and centrifugal force.
//!
//! That is the rod's force over the weight, `|(1 + a) cos th + v^2|` (in SI `v^2/w0^2`), without what
//! a sideways drive adds. Hanging at rest it is 1, which Coulomb friction has already. Where it
//! passes zero the friction has a corner: steps end there.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct LoadDependentFriction;

impl Law for LoadDependentFriction {
    const DEFINITION: Definition<'static> = Definition {
        name: "load_dependent_friction",
        group: Group::Damping,
        family: Family::DryFriction,
        action: Action::LoadedFriction,
        formula: "-k (|(1 + a) cos(theta) + v^2/w0^2| - 1) sign(v)",
        parameters: Parameters::Library(&[Parameter {
            name: "k",
            role: Role::Size,
            unit: "rad/s^2",
            power: Power::Of(2),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-4, 0.3],
            meaning: "friction of the hanging weight; above theta_r the sum may be negative",
        }]),
        revealed_by: "rotation and large swings",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn friction<R: Real>([k, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        *k * (load(at) * at.side * at.per_gravity - at.constant(1.0))
    }

    #[inline(always)]
    fn switch<R: Real>(_: &[R; MOST_PARAMETERS], at: &Point<R>) -> Option<R> {
        Some(load(at))
    }
}

/// The load of the rod over its weight.
#[inline(always)]
fn load<R: Real>(at: &Point<R>) -> R {
    at.vertical * at.cosine() + at.velocity * at.velocity
}
