//! Running states without drive: closed on the angle section, with a period of their own.

use super::poincare::{Image, flow};
use crate::integrate::{Schedule, State};
use crate::model::Pendulum;
use std::f64::consts::TAU;

const STEP: f64 = 0.02;
const MOST_STEPS: usize = 200_000;
const RESIDUAL: f64 = 1e-12;

/// A rotation of the undriven pendulum: the velocity repeats after one turn.
#[derive(Clone, Debug)]
pub struct Rotation {
    /// Velocity where the pendulum hangs down (`theta = 0`).
    pub velocity: f64,
    /// Time of one turn.
    pub period: f64,
    /// The one multiplier that is not trivial: derivative of the section map,
    /// `exp(-gamma period)`.
    pub multiplier: f64,
    /// Its sense: 1 or -1.
    pub sense: i64,
    /// States along one turn, at equal times.
    pub curve: Vec<State>,
}

/// One turn on the angle section: time, velocity at the end and its derivative by the first one.
struct Turn {
    time: f64,
    velocity: f64,
    slope: f64,
}

/// From `theta = 0` with `velocity` once round; `None` if the pendulum turns back first.
fn turn(pendulum: &Pendulum, velocity: f64, mut visit: impl FnMut(State)) -> Option<Turn> {
    let sense = velocity.signum();
    let goal = sense * TAU;
    // A tenth of a rad at the most, however fast.
    let length = STEP.min(0.1 / velocity.abs());
    let step = Schedule::new(pendulum, 0.0, length, 1);
    let (mut angle, mut time) = (0.0, 0.0);
    let mut image =
        Image { state: [0.0, velocity], turns: 0, derivative: nalgebra::Matrix2::identity() };
    for _ in 0..MOST_STEPS {
        visit([angle, image.state[1]]);
        let next = flow(&step, [angle, image.state[1]]);
        let derivative = next.derivative * image.derivative;
        let next_angle = next.state[0] + TAU * next.turns as f64;
        if next.state[1] * sense <= 0.0 {
            return None;
        }
        if next_angle * sense >= TAU {
            // The remainder of the step, by Newton's method on its length.
            let mut rest = length * (goal - angle) / (next_angle - angle);
            let mut end = next;
            for _ in 0..20 {
                end = flow(&Schedule::new(pendulum, 0.0, rest, 1), [angle, image.state[1]]);
                let miss = end.state[0] + TAU * end.turns as f64 - goal;
                rest -= miss / end.state[1];
                if miss.abs() < 1e-15 * TAU {
                    break;
                }
            }
            let whole = end.derivative * image.derivative;
            let acceleration = pendulum.acceleration(0.0, goal, end.state[1]);
            // On the section the time of arrival moves with the state.
            let slope = whole[(1, 1)] - acceleration / end.state[1] * whole[(0, 1)];
            return Some(Turn { time: time + rest, velocity: end.state[1], slope });
        }
        image = Image { state: next.state, turns: 0, derivative };
        angle = next_angle;
        time += length;
    }
    None
}

/// The rotations that attract without drive: at most one, in the sense of the torque.
///
/// The map of the section `theta = 0 mod 2 pi` in the velocity is monotone, so iterates from above
/// fall onto its highest fixed point, or the pendulum stops going round and there is none.
#[must_use]
pub fn running_states(pendulum: &Pendulum) -> Vec<Rotation> {
    if !pendulum.is_autonomous() || !pendulum.is_dissipative() || pendulum.torque == 0.0 {
        return Vec::new();
    }
    let sense = pendulum.torque.signum();
    let mut velocity = sense * (2.5 + 2.0 * pendulum.torque.abs() / pendulum.gamma);
    for _ in 0..20_000 {
        let Some(end) = turn(pendulum, velocity, |_| {}) else { return Vec::new() };
        let gap = end.velocity - velocity;
        // Newton's step once the map is nearly linear there, else the map itself.
        velocity = if gap.abs() < 1e-2 && (1.0 - end.slope).abs() > 1e-9 {
            velocity + gap / (1.0 - end.slope)
        } else {
            end.velocity
        };
        if gap.abs() < 0.1 * RESIDUAL * velocity.abs().max(1.0) {
            break;
        }
    }
    let mut curve = Vec::new();
    let Some(end) = turn(pendulum, velocity, |state| curve.push(state)) else {
        return Vec::new();
    };
    let exact = (-pendulum.gamma * end.time).exp();
    let closed = (end.velocity - velocity).abs() < RESIDUAL * velocity.abs().max(1.0);
    if !closed || (end.slope / exact - 1.0).abs() > 1e-6 {
        return Vec::new();
    }
    vec![Rotation { velocity, period: end.time, multiplier: exact, sense: sense as i64, curve }]
}
