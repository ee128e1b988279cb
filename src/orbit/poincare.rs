//! The stroboscopic map of one trajectory, precise and with its derivative.

use std::f64::consts::{FRAC_1_PI, PI};

use nalgebra::{Matrix2, Vector2};

use crate::integrate::reference::flow::Flow;
use crate::integrate::tangent::Tangent;
use crate::integrate::{Moving, Schedule, State, Strobe};
use crate::lanes::sine::Fine;
use crate::model::pendulum::Route;
use crate::model::{Angle, Pendulum};

/// A step short enough for errors near 1e-15 a period: the method's error falls as the eighth
/// power, and is 1e-9 after five periods at 0.095.
const STEP: f64 = 0.025;

/// The map over one forcing period, at the accuracy of orbits: errors near rounding.
#[derive(Clone, Debug)]
pub struct PoincareMap {
    /// The model.
    pub pendulum: Pendulum,
    /// Topology of its angle.
    pub angle: Angle,
    way: Way,
}

/// Equal steps where gravity, drive, torque and viscous damping are all; else the integrator for any
/// model; or the steps of a strobe.
#[derive(Clone, Debug)]
enum Way {
    Plain(Schedule),
    Any(Box<Flow>),
    Lanes(Box<Strobe>),
}

/// An image under the map with its derivative.
#[derive(Clone, Copy, Debug)]
pub struct Image {
    /// Angle, on the circle in [-pi, pi], and velocity.
    pub state: State,
    /// Whole turns removed from the angle.
    pub turns: i64,
    /// Derivative of the state by the first state.
    pub derivative: Matrix2<f64>,
    /// Its determinant without rounding errors, where it is known: `exp(-gamma T)` times the ratios
    /// of the accelerations at the turns, 0 after a stick.
    pub product: Option<f64>,
}

impl PoincareMap {
    /// The map of `pendulum` at `tau = 0 mod T`.
    #[must_use]
    pub fn new(pendulum: &Pendulum) -> Self {
        let plain = pendulum.route() == Route::Smooth && !pendulum.has_extra_load();
        let way = if plain {
            let pull = pendulum.greatest_pull().sqrt();
            let steps = (pendulum.period() * pull / STEP).ceil() as usize;
            Way::Plain(Schedule::period(pendulum, steps.max(32)))
        } else {
            Way::Any(Box::new(Flow::new(pendulum)))
        };
        Self { pendulum: pendulum.clone(), angle: pendulum.angle(), way }
    }

    /// The map of `strobe`'s steps, with the same precision and speed.
    #[must_use]
    pub fn of_steps(strobe: &Strobe) -> Self {
        let way = Way::Lanes(Box::new(strobe.clone()));
        Self { pendulum: strobe.pendulum.clone(), angle: strobe.angle, way }
    }

    /// Advances by one period.
    #[must_use]
    pub fn once(&self, state: State) -> Image {
        let flow_of = match &self.way {
            Way::Plain(schedule) => {
                let shrinking = (-self.pendulum.gamma * self.pendulum.period()).exp();
                return Image { product: Some(shrinking), ..flow(self.angle, schedule, state) };
            }
            Way::Any(flow_of) => flow_of,
            Way::Lanes(strobe) => return stretched(strobe, state),
        };
        let arrival = flow_of.carry(state, 0.0, self.pendulum.period());
        let [[a, b], [c, d]] = arrival.derivative;
        let (half_turns, turns) = self.angle.wrap(arrival.state[0] * FRAC_1_PI);
        Image {
            state: [half_turns * PI, arrival.state[1]],
            turns: turns as i64,
            derivative: Matrix2::new(a, b, c, d),
            product: arrival.product,
        }
    }

    /// The difference of two states, on the circle modulo a turn.
    #[must_use]
    pub fn gap(&self, from: State, to: State) -> Vector2<f64> {
        Vector2::new(self.angle.wrapped(to[0] - from[0]), to[1] - from[1])
    }

    /// Advances by `periods` periods, with the derivative of the whole.
    #[must_use]
    pub fn iterate(&self, state: State, periods: usize) -> Image {
        let mut image =
            Image { state, turns: 0, derivative: Matrix2::identity(), product: Some(1.0) };
        for _ in 0..periods {
            let next = self.once(image.state);
            image = Image {
                state: next.state,
                turns: image.turns + next.turns,
                derivative: next.derivative * image.derivative,
                product: next.product.zip(image.product).map(|(a, b)| a * b),
            };
        }
        image
    }
}

/// Advances by one period of `strobe`, a lane for each column of the derivative.
fn stretched(strobe: &Strobe, state: State) -> Image {
    let (mut theta, mut velocity) = ([state[0]; 2], [state[1]; 2]);
    let (mut turns, mut growth) = ([0.0; 2], [0.0; 2]);
    let (mut along, mut across) = ([1.0, 0.0], [0.0, 1.0]);
    // Lengths agree, so this cannot fail.
    let _ = strobe.stretch(
        (&mut theta, &mut velocity),
        &mut turns,
        (&mut along, &mut across),
        &mut growth,
        1,
    );
    let size = growth.map(f64::exp);
    Image {
        state: [theta[0], velocity[0]],
        turns: turns[0] as i64,
        derivative: Matrix2::new(
            along[0] * size[0],
            along[1] * size[1],
            across[0] * size[0],
            across[1] * size[1],
        ),
        product: None,
    }
}

/// A schedule's flow with its derivative.
#[must_use]
pub fn flow(angle: Angle, schedule: &Schedule, state: State) -> Image {
    let seed = |i: usize| {
        let mut slope = [0.0; 2];
        slope[i] = 1.0;
        Tangent { value: state[i], slope }
    };
    let mut moving = Moving::new(schedule, seed(0), seed(1));
    moving.run::<Fine>(schedule);
    let velocity = moving.velocity(schedule);
    let theta = moving.theta();
    let (half_turns, turns) = angle.wrap(moving.half_turns.value);
    Image {
        state: [half_turns * PI, velocity.value],
        turns: turns as i64,
        derivative: Matrix2::new(
            theta.slope[0],
            theta.slope[1],
            velocity.slope[0],
            velocity.slope[1],
        ),
        product: None,
    }
}
