//! The stroboscopic map for many trajectories: states at `tau = 0 mod T`, one forcing period at a
//! time, every lane at the same phase.

use std::f64::consts::{PI, TAU};

use super::block::Block;
use super::general::Timetable;
use super::schedule::Schedule;
use super::step::Moving;
use super::tangent::Tangent;
use crate::error::Error;
use crate::lanes::sine::{Fine, wrap};
use crate::lanes::{Isa, Job, Lane, MAX_WIDTH, Path, Real, dispatch};
use crate::model::pendulum::Route;
use crate::model::{Equation, Pendulum};

/// Angle and velocity, `[theta, th']`.
pub type State = [f64; 2];

/// From steps of this length on, in units of `1/sqrt(1 + |p|)`, the method errs about as much as the
/// coarse sine does, or more: measured from p = 0 to 30, where both grow with the stretching.
const COARSE_SINE_FROM: f64 = 0.28;

/// Distance of a state's shadow: its square and rounding over it are as small.
const SHADOW: f64 = 1e-7;

/// The stroboscopic map of one pendulum at a chosen accuracy, on a chosen instruction set.
#[derive(Clone, Debug)]
pub struct Strobe {
    /// The model.
    pub pendulum: Pendulum,
    /// The steps over one period.
    pub schedule: Schedule,
    /// The instruction set.
    pub path: Path,
    /// Whether the sine of degree 15 is used.
    pub fine: bool,
    /// Which way through the kernel the model takes.
    pub route: Route,
    /// Whether the model changes with the sign of the velocity.
    pub events: bool,
    /// Whether friction can hold the pendulum fast.
    pub friction: bool,
    /// Whether torques of angle and time act besides gravity and the constant one.
    pub extra: bool,
    /// The drive at the stages of the general method; empty on other routes.
    pub timetable: Timetable,
    /// The equation, time in the laboratory held.
    pub equation: Equation<f64>,
}

impl Strobe {
    /// `steps` steps a period; their length chooses the sine's degree.
    #[must_use]
    pub fn new(pendulum: &Pendulum, steps: usize, path: Path) -> Self {
        let schedule = Schedule::period(pendulum, steps);
        let pull = pendulum.greatest_pull().sqrt();
        let fine = pendulum.period() / steps as f64 * pull < COARSE_SINE_FROM;
        let route = pendulum.route();
        let general = if route == Route::General { steps } else { 0 };
        Self {
            pendulum: pendulum.clone(),
            schedule,
            path,
            fine,
            route,
            events: pendulum.has_events(),
            friction: pendulum.has_friction(),
            extra: pendulum.has_extra_torque(),
            timetable: Timetable::new(pendulum, general),
            equation: pendulum.equation(),
        }
    }

    /// The same map with `factor` times as many steps.
    #[must_use]
    pub fn refined(&self, factor: usize) -> Self {
        Self::new(&self.pendulum, self.steps() * factor, self.path)
    }

    /// Steps a period.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.schedule.steps().len()
    }

    /// Advances every state by `periods` forcing periods, in place.
    ///
    /// Angles come back in [-pi, pi]; the whole turns taken off are added to `turns`.
    ///
    /// # Errors
    /// [`Error::Lengths`] if the three slices differ in length.
    pub fn advance(
        &self,
        theta: &mut [f64],
        velocity: &mut [f64],
        turns: &mut [f64],
        periods: usize,
    ) -> Result<(), Error> {
        let width = self.block_width(theta.len());
        self.advance_blocks(theta, velocity, turns, width, |block| {
            for _ in 0..periods {
                self.period(block);
                block.wrap();
            }
        })
    }

    /// As [`Strobe::advance`], one trajectory at a time with the same arithmetic as a lane.
    ///
    /// # Errors
    /// As [`Strobe::advance`].
    pub fn advance_singly(
        &self,
        theta: &mut [f64],
        velocity: &mut [f64],
        turns: &mut [f64],
        periods: usize,
    ) -> Result<(), Error> {
        self.advance_blocks(theta, velocity, turns, 1, |block| {
            for _ in 0..periods {
                self.period_singly(block);
                block.wrap();
            }
        })
    }

    fn advance_blocks(
        &self,
        theta: &mut [f64],
        velocity: &mut [f64],
        turns: &mut [f64],
        width: usize,
        run: impl Fn(&mut Block),
    ) -> Result<(), Error> {
        same_length(("theta", theta.len()), ("velocity", velocity.len()))?;
        same_length(("theta", theta.len()), ("turns", turns.len()))?;
        let kick = self.schedule.kick;
        let mut block = Block::new(width);
        let chunks = theta.chunks_mut(width).zip(velocity.chunks_mut(width));
        for ((theta, velocity), turns) in chunks.zip(turns.chunks_mut(width)) {
            block.fill(theta, velocity, kick);
            run(&mut block);
            for i in 0..theta.len() {
                theta[i] = block.half_turns[i] * PI;
                velocity[i] = block.kick[i] * (1.0 / kick);
                turns[i] += block.turns[i];
            }
        }
        Ok(())
    }

    /// As [`Strobe::advance`], with one tangent vector beside each state.
    ///
    /// Adds to `growth` the natural logarithm of the factor by which the vector has grown: over the
    /// time it is the finite-time Lyapunov exponent. The vectors come back with length 1.
    ///
    /// # Errors
    /// [`Error::Lengths`] if the slices differ in length.
    pub fn stretch(
        &self,
        states: (&mut [f64], &mut [f64]),
        turns: &mut [f64],
        tangents: (&mut [f64], &mut [f64]),
        growth: &mut [f64],
        periods: usize,
    ) -> Result<(), Error> {
        let count = states.0.len();
        same_length(("theta", count), ("velocity", states.1.len()))?;
        same_length(("theta", count), ("turns", turns.len()))?;
        same_length(("theta", count), ("tangent theta", tangents.0.len()))?;
        same_length(("theta", count), ("tangent velocity", tangents.1.len()))?;
        same_length(("theta", count), ("growth", growth.len()))?;
        if self.route != Route::Smooth || self.extra {
            return self.stretch_by_shadows(states, turns, tangents, growth, periods);
        }
        dispatch::run(
            self.path,
            Stretch { strobe: self, states, turns, tangents, growth, periods },
        );
        Ok(())
    }

    /// Each state and a second one at the distance [`SHADOW`] along its tangent: their distance grows as
    /// the tangent does, through turns and sticks too.
    fn stretch_by_shadows(
        &self,
        states: (&mut [f64], &mut [f64]),
        turns: &mut [f64],
        tangents: (&mut [f64], &mut [f64]),
        growth: &mut [f64],
        periods: usize,
    ) -> Result<(), Error> {
        let count = states.0.len();
        let (mut theta, mut velocity) = (vec![0.0; 2 * count], vec![0.0; 2 * count]);
        for _ in 0..periods {
            let mut net = vec![0.0; 2 * count];
            for i in 0..count {
                (theta[i], velocity[i]) = (states.0[i], states.1[i]);
                theta[count + i] = states.0[i] + SHADOW * tangents.0[i];
                velocity[count + i] = states.1[i] + SHADOW * tangents.1[i];
            }
            self.advance(&mut theta, &mut velocity, &mut net, 1)?;
            for i in 0..count {
                (states.0[i], states.1[i]) = (theta[i], velocity[i]);
                turns[i] += net[i];
                let way = theta[count + i] - theta[i] + TAU * (net[count + i] - net[i]);
                let gain = velocity[count + i] - velocity[i];
                let length = way.hypot(gain) / SHADOW;
                growth[i] += length.ln();
                // Where friction has brought both to one state nothing grows any more.
                if length > 0.0 {
                    tangents.0[i] = way / (SHADOW * length);
                    tangents.1[i] = gain / (SHADOW * length);
                }
            }
        }
        Ok(())
    }
}

fn same_length(a: (&'static str, usize), b: (&'static str, usize)) -> Result<(), Error> {
    if a.1 == b.1 {
        return Ok(());
    }
    Err(Error::Lengths { given: (a.1, b.1), names: (a.0, b.0) })
}

/// A bundle's worth of numbers in memory, refilled and emptied lane by lane.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Buffer(pub [f64; MAX_WIDTH]);

impl Default for Buffer {
    fn default() -> Self {
        Self([0.0; MAX_WIDTH])
    }
}

impl Buffer {
    fn fill(&mut self, source: &[f64]) {
        self.0[..source.len()].copy_from_slice(source);
        self.0[source.len()..].fill(0.0);
    }
}

struct Stretch<'a> {
    strobe: &'a Strobe,
    states: (&'a mut [f64], &'a mut [f64]),
    turns: &'a mut [f64],
    tangents: (&'a mut [f64], &'a mut [f64]),
    growth: &'a mut [f64],
    periods: usize,
}

impl Job for Stretch<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) {
        let schedule = &self.strobe.schedule;
        let width = S::Narrow::WIDTH;
        let mut buffers: [Buffer; 5] = std::array::from_fn(|_| Buffer::default());
        let mut start = 0;
        while start < self.turns.len() {
            let part = start..(start + width).min(self.turns.len());
            buffers[0].fill(&self.states.0[part.clone()]);
            buffers[1].fill(&self.states.1[part.clone()]);
            buffers[2].fill(&self.turns[part.clone()]);
            buffers[3].fill(&self.tangents.0[part.clone()]);
            buffers[4].fill(&self.tangents.1[part.clone()]);
            let mut product = [1.0; MAX_WIDTH];
            for _ in 0..self.periods {
                let theta = Tangent {
                    value: S::Narrow::load(isa, &buffers[0].0),
                    slope: [S::Narrow::load(isa, &buffers[3].0)],
                };
                let velocity = Tangent {
                    value: S::Narrow::load(isa, &buffers[1].0),
                    slope: [S::Narrow::load(isa, &buffers[4].0)],
                };
                let mut lanes = Moving::new(schedule, theta, velocity);
                lanes.run::<Fine>(schedule);
                let velocity = lanes.velocity(schedule);
                let (wrapped, whole) = wrap(lanes.half_turns.value);
                let turns = S::Narrow::load(isa, &buffers[2].0) + whole;
                wrapped.scale(PI).store(&mut buffers[0].0);
                velocity.value.store(&mut buffers[1].0);
                turns.store(&mut buffers[2].0);
                lanes.theta().slope[0].store(&mut buffers[3].0);
                velocity.slope[0].store(&mut buffers[4].0);
                for (lane, product) in product.iter_mut().enumerate().take(part.len()) {
                    let [a, b] = [buffers[3].0[lane], buffers[4].0[lane]];
                    let length = (a * a + b * b).sqrt();
                    buffers[3].0[lane] = a / length;
                    buffers[4].0[lane] = b / length;
                    *product *= length;
                    // A logarithm a period would cost as much as the step itself.
                    if !(1e-100..1e100).contains(product) {
                        self.growth[start + lane] += product.ln();
                        *product = 1.0;
                    }
                }
            }
            for (growth, product) in self.growth[part.clone()].iter_mut().zip(product) {
                *growth += product.ln();
            }
            let copy = |target: &mut [f64], i: usize| {
                target[part.clone()].copy_from_slice(&buffers[i].0[..part.len()]);
            };
            copy(self.states.0, 0);
            copy(self.states.1, 1);
            copy(self.turns, 2);
            copy(self.tangents.0, 3);
            copy(self.tangents.1, 4);
            start = part.end;
        }
    }
}
