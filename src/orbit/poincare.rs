//! The stroboscopic map of one trajectory, precise and with its derivative.

use nalgebra::{Matrix2, Vector2};

use crate::integrate::accuracy::wrapped;
use crate::integrate::tangent::Tangent;
use crate::integrate::{Moving, Schedule, State};
use crate::lanes::sine::{Fine, wrap};
use crate::model::Pendulum;

/// A step short enough for errors near 1e-15 a period: the method's error falls as the eighth
/// power, and is 1e-9 after five periods at 0.095.
const STEP: f64 = 0.025;

/// The map over one forcing period, at the accuracy of orbits: errors near rounding.
#[derive(Clone, Debug)]
pub struct PoincareMap {
    /// The model.
    pub pendulum: Pendulum,
    schedule: Schedule,
}

/// An image of the map with its derivative.
#[derive(Clone, Copy, Debug)]
pub struct Image {
    /// Angle in [-pi, pi] and velocity.
    pub state: State,
    /// Whole turns taken off the angle.
    pub turns: i64,
    /// Derivative of the state by the first state.
    pub derivative: Matrix2<f64>,
}

impl PoincareMap {
    /// The map of `pendulum` at `tau = 0 mod T`.
    #[must_use]
    pub fn new(pendulum: &Pendulum) -> Self {
        let pull = pendulum.greatest_pull().sqrt();
        let steps = (pendulum.period() * pull / STEP).ceil() as usize;
        Self { pendulum: pendulum.clone(), schedule: Schedule::period(pendulum, steps.max(32)) }
    }

    /// One period on.
    #[must_use]
    pub fn once(&self, state: State) -> Image {
        flow(&self.schedule, state)
    }

    /// `periods` periods on, with the derivative of the whole.
    #[must_use]
    pub fn iterate(&self, state: State, periods: usize) -> Image {
        let mut image = Image { state, turns: 0, derivative: Matrix2::identity() };
        for _ in 0..periods {
            let next = self.once(image.state);
            image = Image {
                state: next.state,
                turns: image.turns + next.turns,
                derivative: next.derivative * image.derivative,
            };
        }
        image
    }
}

/// A schedule's flow with its derivative.
#[must_use]
pub fn flow(schedule: &Schedule, state: State) -> Image {
    let seed = |i: usize| {
        let mut slope = [0.0; 2];
        slope[i] = 1.0;
        Tangent { value: state[i], slope }
    };
    let mut moving = Moving::new(schedule, seed(0), seed(1));
    moving.run::<Fine>(schedule);
    let velocity = moving.velocity(schedule);
    let theta = moving.theta();
    let (half_turns, turns) = wrap(moving.half_turns.value);
    Image {
        state: [half_turns * std::f64::consts::PI, velocity.value],
        turns: turns as i64,
        derivative: Matrix2::new(
            theta.slope[0],
            theta.slope[1],
            velocity.slope[0],
            velocity.slope[1],
        ),
    }
}

/// `P^n(x) - x`, the angle modulo a turn.
#[must_use]
pub fn closing_gap(from: State, to: State) -> Vector2<f64> {
    Vector2::new(wrapped(to[0] - from[0]), to[1] - from[1])
}
