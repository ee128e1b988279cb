//! Running states without drive: closed on the angle section, with their own period.

use std::f64::consts::TAU;

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

use crate::integrate::State;
use crate::integrate::kernel::general::{Own, Running, STEP as ALL_STAGES, Stages, Stepping};
use crate::integrate::reference::flow::{Arrival, Flow};
use crate::integrate::tangent::Tangent;
use crate::lanes::Work;
use crate::model::pendulum::Route;
use crate::model::{Angle, Equation, Pendulum};

/// A number with its derivatives by the first angle and velocity.
type Number = Tangent<f64, 2>;

const STEP: f64 = 0.02;
const MOST_STEPS: usize = 200_000;
const RESIDUAL: f64 = 1e-12;
/// Largest deviation of the section map's derivative from what the damping gives it.
const SLOPE: f64 = 1e-6;
/// No search begins at a higher velocity than this and a little.
const FASTEST: f64 = 200.0;

/// A rotation of the undriven pendulum: the velocity repeats after one turn.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Rotation {
    /// Velocity at the hanging position (`theta = 0`).
    pub velocity: f64,
    /// Time of one turn.
    pub period: f64,
    /// The one multiplier that is not trivial: derivative of the section map, `exp(-gamma period)`
    /// where nothing else depends on the velocity.
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

/// A state a step of `length` later, turning in the sense `sense`, and the derivative; by `flow` where
/// there is one.
fn carry(
    (equation, flow): (&Equation<Number>, Option<&Flow>),
    sense: f64,
    start: State,
    length: f64,
) -> (State, Matrix2<f64>) {
    if let Some(flow) = flow {
        let Arrival { state, derivative: [[a, b], [c, d]], .. } = flow.carry(start, 0.0, length);
        return (state, Matrix2::new(a, b, c, d));
    }
    let number = |value: f64, slope: [f64; 2]| Number { value, slope };
    let mut state =
        Running { theta: number(start[0], [1.0, 0.0]), velocity: number(start[1], [0.0, 1.0]) };
    let clock = Own { begin: number(0.0, [0.0; 2]), length: number(length, [0.0; 2]) };
    let sense = number(sense, [0.0; 2]);
    let (state, ends) = (&mut state, &mut [sense; 2]);
    let stages = &mut Stages::new(sense);
    // Both signs are the sense: models with a corner do not use this.
    let signs = [sense; 2];
    Stepping { equation, clock, signs, part: ALL_STAGES, state, ends, stages }.run();
    let Running { theta, velocity } = *state;
    let [a, b, c, d] = [theta.slope[0], theta.slope[1], velocity.slope[0], velocity.slope[1]];
    ([theta.value, velocity.value], Matrix2::new(a, b, c, d))
}

/// One turn from `theta = 0` with `velocity`; `None` if the pendulum turns back first.
fn turn(pendulum: &Pendulum, velocity: f64, mut visit: impl FnMut(State)) -> Option<Turn> {
    let sense = velocity.signum();
    let goal = sense * TAU;
    // A tenth of a rad at the most, however fast.
    let length = STEP.min(0.1 / velocity.abs());
    let equation = pendulum.equation().map(Number { value: 0.0, slope: [0.0; 2] });
    let flow = pendulum.has_corner().then(|| Flow::new(pendulum));
    let by_step = (&equation, flow.as_ref());
    let (mut state, mut derivative, mut time) = ([0.0, velocity], Matrix2::identity(), 0.0);
    for _ in 0..MOST_STEPS {
        visit(state);
        let (next, by) = carry(by_step, sense, state, length);
        if next[1] * sense <= 0.0 {
            return None;
        }
        if next[0] * sense >= TAU {
            // The remainder of the step, by Newton's method on its length.
            let mut rest = length * (goal - state[0]) / (next[0] - state[0]);
            let (mut end, mut by) = (next, by);
            for _ in 0..20 {
                (end, by) = carry(by_step, sense, state, rest);
                let miss = end[0] - goal;
                rest -= miss / end[1];
                if miss.abs() < 1e-15 * TAU {
                    break;
                }
            }
            let whole = by * derivative;
            let acceleration = pendulum.acceleration(0.0, goal, end[1]);
            // On the section the time of arrival moves with the state.
            let slope = whole[(1, 1)] - acceleration / end[1] * whole[(0, 1)];
            return Some(Turn { time: time + rest, velocity: end[1], slope });
        }
        (state, derivative, time) = (next, by * derivative, time + length);
    }
    None
}

/// The rotations that attract without drive: at most one, in the sense of the torque.
///
/// The map of the section `theta = 0 mod 2 pi` in the velocity is monotone, so iterates from above
/// fall onto its highest fixed point, or the pendulum stops going round and there is none.
#[must_use]
pub fn running_states(pendulum: &Pendulum) -> Vec<Rotation> {
    if !pendulum.is_autonomous()
        || !pendulum.is_dissipative()
        || pendulum.torque == 0.0
        || pendulum.angle() == Angle::Line
    {
        return Vec::new();
    }
    let sense = pendulum.torque.signum();
    let fastest = 2.0 * pendulum.torque.abs() / pendulum.gamma;
    let mut velocity = sense * (2.5 + fastest.min(FASTEST));
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
    // Known without rounding where nothing else depends on the velocity.
    let exact = match pendulum.route() {
        Route::General => end.slope,
        _ => (-pendulum.gamma * end.time).exp(),
    };
    let closed = (end.velocity - velocity).abs() < RESIDUAL * velocity.abs().max(1.0);
    // Where the pendulum nearly stands still on its way, the multiplier is less than rounding leaves of the slope.
    if !closed || (end.slope - exact).abs() > SLOPE {
        return Vec::new();
    }
    vec![Rotation { velocity, period: end.time, multiplier: exact, sense: sense as i64, curve }]
}
