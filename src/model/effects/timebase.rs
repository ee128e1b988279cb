//! A record whose clock runs fast or slow.
//!
//! All rates, `w0` and damping included, are in the record's seconds: only the frequency of the
//! drive, which has its own clock, differs. That is equivalent to an error of the drive's
//! frequency, exactly.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::model::drive::Motion;

pub struct Timebase;

impl Law for Timebase {
    const DEFINITION: Definition<'static> = Definition {
        name: "timebase",
        group: Group::Drive,
        family: Family::Reading,
        action: Action::Drive,
        formula: "omega/(1 + e), the record's time being (1 + e) t",
        parameters: Parameters::Library(&[Parameter {
            name: "e",
            role: Role::Size,
            unit: "1",
            power: Power::Of(0),
            range: [-0.9, 10.0],
            typical: [-0.01, 0.01],
            meaning: "seconds that the record's clock gains in one",
        }]),
        revealed_by: "forced runs; a better clock tells it from a drive frequency",
        mappable: Mappable::Yes,
    };

    fn drive<R: Real>([e, ..]: &[R; MOST_PARAMETERS], motion: &mut Motion<R>) {
        motion.omega = motion.omega / (*e + e.like(1.0));
    }
}
