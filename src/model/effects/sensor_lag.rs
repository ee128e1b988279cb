//! A sensor with a delay: a filter of first order, `tau y' = theta - y`, much faster than the
//! swing.
//!
//! The term of first order in `tau` is kept; the next, `tau^2 th''`, is smaller by `tau w0`. A free
//! decay that is read late equals one that began late: only a drive, with its own clock, reveals
//! the delay.

use super::law::{Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Power, Role};
use crate::lanes::Real;

pub struct SensorLag;

impl Law for SensorLag {
    const DEFINITION: Definition<'static> = Definition {
        name: "sensor_lag",
        group: Group::Reading,
        family: Family::Reading,
        action: Action::Reading,
        formula: "reading theta - tau v",
        parameters: Parameters::Library(&[Parameter {
            name: "tau",
            role: Role::Size,
            unit: "s",
            power: Power::Of(-1),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            typical: [1e-4, 0.1],
            meaning: "time by which the reading is late; negative where the drive's clock is",
        }]),
        revealed_by: "forced runs at several frequencies, against a drive phase",
        mappable: Mappable::Yes,
    };

    fn reading<R: Real>([tau, ..]: &[R; MOST_PARAMETERS], theta: R, velocity: R, _: R) -> R {
        theta - *tau * velocity
    }
}
