//! Fluid that moves along with the pendulum: it has inertia, also against the pivot's motion, but no
//! weight.
//!
//! `(1 + e) th'' = ... - (1 + (1 + e) a) sin th`. A constant `e` scales all other terms, which
//! measured gravity, damping and friction per inertia already include; the remainder is the pivot's
//! force on a mass without weight. A free decay does not depend on it, and under a drive it is
//! equivalent to an error of the drive's amplitude.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct AddedMass;

impl Law for AddedMass {
    const DEFINITION: Definition<'static> = Definition {
        name: "added_mass",
        group: Group::Torque,
        family: Family::Drive,
        action: Action::Driven,
        formula: "-e a sin(theta), a the pivot's acceleration over gravity, all per whole inertia",
        parameters: Parameters::Library(&[Parameter {
            name: "e",
            role: Role::Size,
            unit: "1",
            power: Power::Of(0),
            range: [-0.9, 10.0],
            typical: [-0.1, 0.1],
            meaning: "inertia that moves along without weight, over that of the pendulum",
        }]),
        revealed_by: "w0 in the fluid and without it; forced runs only if the stroke is well known",
        mappable: Mappable::Yes,
    };

    #[inline(always)]
    fn torque<R: Real>([e, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        let pull = at.vertical - at.constant(1.0) / at.per_gravity;
        -(*e * pull * at.sine)
    }
}
