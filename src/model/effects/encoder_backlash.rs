//! Backlash between shaft and sensor: after a turn the reading is constant until the play is taken
//! up.
//!
//! The reading lags behind the angle by half the play. While the sense `s` of the motion is held,
//! the reading less `theta` is `s max(s k, -b/2)`, where `k` is its value at the last turn, less
//! the angle covered since. A motion begins in the middle of the play.

use super::law::{
    Action, Definition, Family, Group, Law, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point, Power, Role,
};
use crate::lanes::Real;

pub struct EncoderBacklash;

impl Law for EncoderBacklash {
    const DEFINITION: Definition<'static> = Definition {
        name: "encoder_backlash",
        group: Group::Reading,
        family: Family::Reading,
        action: Action::Play,
        formula: "reading y, |theta - y| <= b/2, moved only when pushed",
        parameters: Parameters::Library(&[Parameter {
            name: "b",
            role: Role::Size,
            unit: "rad",
            power: Power::Of(0),
            range: [0.0, f64::INFINITY],
            typical: [1e-4, 0.1],
            meaning: "play",
        }]),
        revealed_by: "turns, where the reading stands still",
        mappable: Mappable::Yes,
    };

    fn ready<R: Real>([b, rest @ ..]: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        [b.scale(0.5), rest[0], rest[1]]
    }

    #[inline(always)]
    fn kept<R: Real>([half, ..]: &[R; MOST_PARAMETERS], at: &Point<R>) -> Option<R> {
        let [turned, before] = at.past;
        let above = at.sense * (turned + before - at.theta) + *half;
        let beyond = (above + above * above.sign()).scale(0.5);
        Some(at.sense * (beyond - *half))
    }
}
