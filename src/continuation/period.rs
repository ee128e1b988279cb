//! The stroboscopic map with exact first derivatives by the state and by the parameters of a course.
//!
//! Derivatives come of tangents carried by the integrator, through turns by the saltation of
//! [`crate::integrate::reference::driver`]. A parameter on which the period `T` depends also moves the end:
//! `d x(T) / d l = (d x / d l) at fixed time + f(x, T) dT/dl`.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};

use super::course::Course;
use super::edge::{self, Edge};
use super::event::Kind;
use super::phases::Phase;
use super::smooth;
use crate::integrate::State;
use crate::integrate::reference::driver::{Driver, Piece};
use crate::integrate::reference::problem::OdeProblem;
use crate::integrate::tangent::{Number, Tangent};
use crate::model::pendulum::Route;
use crate::model::{Parameter, Pendulum};

/// Error of a step of the integrator for any model.
const PRECISE: f64 = 3e-15;

/// A state some time later.
#[derive(Clone, Debug)]
pub struct Image {
    /// Angle, not wrapped, and velocity.
    pub state: State,
    /// Its derivative by the first state.
    pub by_state: Matrix2<f64>,
    /// Its derivative by each coordinate of the course.
    pub by_course: [Vector2<f64>; 2],
    /// The determinant of `by_state` where a law gives it: `exp(-gamma t)` times the ratios of the accelerations
    /// after and before each turn, 0 after a stick.
    pub product: Option<f64>,
    /// Phases of the motion, in order; empty where nothing jumps with the sense of the motion.
    pub phases: Vec<Phase>,
    /// Whether friction holds the pendulum at the end, and whether for ever.
    pub held: [bool; 2],
    /// The numbers of the events that are watched.
    pub edges: Vec<Edge>,
}

/// The map at one place of a course; `N` is 2 and the number of coordinates.
#[derive(Debug)]
pub struct Period<'a, const N: usize> {
    course: &'a Course,
    at: Vec<f64>,
    pendulum: Pendulum,
    /// Equal steps a period.
    count: usize,
    /// The problem for any model; none where equal steps do.
    ode: Option<OdeProblem<Tangent<f64, N>>>,
    watched: Option<Kind>,
}

impl<'a, const N: usize> Period<'a, N> {
    /// The map at these coordinates.
    #[must_use]
    pub fn new(course: &'a Course, at: &[f64]) -> Self {
        let pendulum = course.pendulum(at);
        let plain = pendulum.route() == Route::Smooth
            && !pendulum.has_extra_load()
            && !course.varies_friction()
            && !course.axes.iter().flatten().any(|(p, _)| matches!(p, Parameter::OfEffect { .. }));
        let ode = (!plain).then(|| {
            let ode = OdeProblem::new(&pendulum, false, PRECISE, course.number::<N>(at));
            // The derivative by a friction of strength 0 needs the turns.
            if course.varies_friction() { ode.finding_turns() } else { ode }
        });
        let count = smooth::count(&pendulum, course.step);
        Self { course, at: at.to_vec(), pendulum, count, ode, watched: None }
    }

    /// The number of equal steps that [`Period::new`] takes.
    #[must_use]
    pub fn count(course: &Course, at: &[f64]) -> usize {
        smooth::count(&course.pendulum(at), course.step)
    }

    /// This map by so many equal steps: one more for a larger parameter would make it jump.
    #[must_use]
    pub fn by(mut self, count: usize) -> Self {
        self.count = count;
        self
    }

    /// This map with the numbers of events of this kind along it, see [`edge`].
    #[must_use]
    pub fn watching(mut self, kind: Kind) -> Self {
        self.watched = Some(kind);
        self
    }

    /// Whether the acceleration jumps with the sense of the motion, here or elsewhere on the course.
    #[must_use]
    pub fn rubs(&self) -> bool {
        self.ode.as_ref().is_some_and(OdeProblem::jumps) || self.course.varies_friction()
    }

    /// The images of states at the beginning of a period this part of a period later.
    #[must_use]
    pub fn images(&self, states: &[State], part: f64) -> Vec<Image> {
        let Some(ode) = &self.ode else {
            let product = Some((-self.pendulum.gamma * part * self.pendulum.period()).exp());
            let carried = smooth::carry::<N>(self.course, &self.at, states, part, self.count);
            return carried.iter().map(|end| Image::of(end, product)).collect();
        };
        states.iter().map(|state| self.carried(ode, *state, part)).collect()
    }

    /// The image of one state, by the integrator for any model.
    fn carried(&self, ode: &OdeProblem<Tangent<f64, N>>, state: State, part: f64) -> Image {
        let omega = ode.field().equation().motion.omega;
        // Its own period where nothing moves the pivot, which no parameter changes.
        let whole = self.pendulum.period();
        let by_omega = if self.pendulum.is_autonomous() { 0.0 } else { -TAU / omega.value.powi(2) };
        let start = [Tangent::seeded(state[0], 0), Tangent::seeded(state[1], 1)];
        let mut driver = Driver::new(ode, 0.0, start, part * whole);
        let (mut phases, mut edges) = (Vec::new(), Vec::new());
        while let Some(piece) = driver.advance() {
            let phase = match piece {
                Piece::Step => {
                    let stops = driver.events.last().is_some_and(|stop| stop.tau >= driver.tau);
                    let watched = self.watched;
                    edges.extend(watched.and_then(|kind| edge::passed(kind, ode, &driver, stops)));
                    Phase::moving(driver.dense.signs[0])
                }
                Piece::Rest(from, to) => {
                    if self.watched.is_some() {
                        edges.extend(edge::held(ode, &driver, [from, to]));
                    }
                    Phase::Stick
                }
            };
            if self.rubs() && phases.last() != Some(&phase) {
                phases.push(phase);
            }
        }
        let mut end = driver.state;
        if let Some(signs) = driver.signs_held() {
            let acceleration = ode.acceleration(driver.tau, end, signs, driver.past).value();
            let rates = [end[1].value(), acceleration];
            for (number, rate) in end.iter_mut().zip(rates) {
                for (slope, by) in number.slope.iter_mut().zip(omega.slope).skip(2) {
                    *slope += rate * by_omega * part * by;
                }
            }
        }
        let even = self.pendulum.route() != Route::General;
        let shrinking = (-self.pendulum.gamma * part * whole).exp();
        let product = even.then_some(shrinking * driver.ratio);
        let held = [driver.is_stuck(), driver.is_stuck_for_ever()];
        Image { phases, held, edges, ..Image::of(&end, product) }
    }
}

impl Image {
    fn of<const N: usize>([theta, velocity]: &[Tangent<f64, N>; 2], product: Option<f64>) -> Self {
        let column = |k: usize| {
            let of = |number: &Tangent<f64, N>| number.slope.get(k).copied().unwrap_or(0.0);
            Vector2::new(of(theta), of(velocity))
        };
        Self {
            state: [theta.value, velocity.value],
            by_state: Matrix2::from_columns(&[column(0), column(1)]),
            by_course: [column(2), column(3)],
            product,
            phases: Vec::new(),
            held: [false; 2],
            edges: Vec::new(),
        }
    }
}
