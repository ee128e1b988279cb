//! The stroboscopic map of one trajectory, precise and with its derivative.

use std::f64::consts::{FRAC_1_PI, PI};

use nalgebra::{Matrix2, Vector2};

use crate::integrate::reference::flow::Flow;
use crate::integrate::tangent::Tangent;
use crate::integrate::{Moving, Schedule, State, Strobe, TangentStates};
use crate::lanes::sine::Fine;
use crate::model::pendulum::Route;
use crate::model::{Angle, Pendulum};

/// A step short enough for errors near 1e-15 a period: the method's error falls as the eighth
/// power, and is 1e-9 after five periods at 0.095.
pub const STEP: f64 = 0.025;

/// The map over one forcing period, at the accuracy of orbits: errors near rounding.
#[derive(Clone, Debug)]
pub struct PoincareMap {
    /// The model.
    pub pendulum: Pendulum,
    /// Topology of its angle.
    pub angle: Angle,
    integrator: Integrator,
}

/// Equal steps where gravity, drive, torque and viscous damping are all; else the integrator for any
/// model; or the steps of a strobe.
#[derive(Clone, Debug)]
enum Integrator {
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
        let integrator = if plain {
            let pull = pendulum.greatest_pull().sqrt();
            let steps = (pendulum.period() * pull / STEP).ceil() as usize;
            Integrator::Plain(Schedule::period(pendulum, steps.max(32)))
        } else {
            Integrator::Any(Box::new(Flow::new(pendulum)))
        };
        Self { pendulum: pendulum.clone(), angle: pendulum.angle(), integrator }
    }

    /// The map of `strobe`'s steps, with the same precision and speed.
    #[must_use]
    pub fn of_steps(strobe: &Strobe) -> Self {
        let integrator = Integrator::Lanes(Box::new(strobe.clone()));
        Self { pendulum: strobe.pendulum.clone(), angle: strobe.angle, integrator }
    }

    /// Advances by one period.
    #[must_use]
    pub fn once(&self, state: State) -> Image {
        let flow_of = match &self.integrator {
            Integrator::Plain(schedule) => {
                let shrinking = (-self.pendulum.gamma * self.pendulum.period()).exp();
                return Image { product: Some(shrinking), ..flow(self.angle, schedule, state) };
            }
            Integrator::Any(flow_of) => flow_of,
            Integrator::Lanes(strobe) => return stretched(strobe, &[state])[0],
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

    /// Advances several states by one period.
    fn once_all(&self, states: &[State]) -> Vec<Image> {
        match &self.integrator {
            Integrator::Lanes(strobe) => stretched(strobe, states),
            _ => states.iter().map(|state| self.once(*state)).collect(),
        }
    }

    /// Advances by `periods` periods, with the derivative of the whole.
    #[must_use]
    pub fn iterate(&self, state: State, periods: usize) -> Image {
        self.iterate_all(&[(state, periods)])[0]
    }

    /// Advances each of several states by a number of periods.
    #[must_use]
    pub fn iterate_all(&self, starts: &[(State, usize)]) -> Vec<Image> {
        let at = |(state, _): &(State, usize)| Image {
            state: *state,
            turns: 0,
            derivative: Matrix2::identity(),
            product: Some(1.0),
        };
        let whole = |(start, course): (_, Vec<Image>)| {
            course.into_iter().fold(at(start), |all, next| Image {
                state: next.state,
                turns: all.turns + next.turns,
                derivative: next.derivative * all.derivative,
                product: next.product.zip(all.product).map(|(a, b)| a * b),
            })
        };
        starts.iter().zip(self.courses(starts)).map(whole).collect()
    }

    /// The images of each of several states after each of a number of periods, one period from one to the next.
    #[must_use]
    pub fn courses(&self, starts: &[(State, usize)]) -> Vec<Vec<Image>> {
        let mut courses: Vec<Vec<Image>> = vec![Vec::new(); starts.len()];
        for period in 0..starts.iter().map(|(_, periods)| *periods).max().unwrap_or(0) {
            let going: Vec<usize> = (0..starts.len()).filter(|k| starts[*k].1 > period).collect();
            let state = |k: &usize| courses[*k].last().map_or(starts[*k].0, |image| image.state);
            let states: Vec<State> = going.iter().map(state).collect();
            for (k, next) in going.into_iter().zip(self.once_all(&states)) {
                courses[k].push(next);
            }
        }
        courses
    }
}

/// Advances each state by one period of `strobe`, with a lane for each column of the derivative.
fn stretched(strobe: &Strobe, states: &[State]) -> Vec<Image> {
    let both = |state: &State| [(*state, [1.0, 0.0]), (*state, [0.0, 1.0])];
    let mut all: TangentStates = states.iter().flat_map(both).collect();
    strobe.stretch(&mut all, 1);
    let image = |i: usize| {
        let size = [i, i + 1].map(|k| all.growth()[k].exp());
        let [along, across] = [i, i + 1].map(|k| all.tangent(k));
        Image {
            state: all.states().get(i),
            turns: all.states().turns()[i] as i64,
            derivative: Matrix2::new(
                along[0] * size[0],
                across[0] * size[1],
                along[1] * size[0],
                across[1] * size[1],
            ),
            product: None,
        }
    };
    (0..all.states().len()).step_by(2).map(image).collect()
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
