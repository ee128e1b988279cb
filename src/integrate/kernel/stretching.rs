//! Tangent vectors of states: the rate at which neighbouring trajectories diverge.

use std::f64::consts::{PI, TAU};

use super::step::Moving;
use super::stroboscopic::{Strobe, same_length};
use crate::error::Error;
use crate::integrate::tangent::Tangent;
use crate::lanes::sine::Fine;
use crate::lanes::{Isa, Job, Lane, MAX_WIDTH, dispatch};
use crate::model::pendulum::Route;

/// Distance of a state's shadow: its square and rounding over it are as small.
const SHADOW: f64 = 1e-7;

impl Strobe {
    /// [`Strobe::advance`] with one tangent vector for each state.
    ///
    /// Adds to `growth` the natural logarithm of the factor by which the vector has grown: over the
    /// time it is the finite-time Lyapunov exponent. The vectors come back with length 1.
    ///
    /// # Errors
    /// [`Error::Lengths`] if the slices differ in length.
    pub fn stretch(
        &self,
        mut states: (&mut [f64], &mut [f64]),
        turns: &mut [f64],
        mut tangents: (&mut [f64], &mut [f64]),
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
            let (states, tangents) = (&mut states, &mut tangents);
            return self.stretch_by_shadows(states, turns, tangents, growth, periods);
        }
        dispatch::run(
            self.simd,
            Stretch { strobe: self, states, turns, tangents, growth, periods },
        );
        Ok(())
    }

    /// Each state and a second one at the distance [`SHADOW`] along its tangent: their distance grows as
    /// the tangent does, through turns and sticks too.
    fn stretch_by_shadows(
        &self,
        states: &mut (&mut [f64], &mut [f64]),
        turns: &mut [f64],
        tangents: &mut (&mut [f64], &mut [f64]),
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
                // If friction has brought both to one state the growth is zero from then on.
                if length > 0.0 {
                    tangents.0[i] = way / (SHADOW * length);
                    tangents.1[i] = gain / (SHADOW * length);
                }
            }
        }
        Ok(())
    }
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
        if self.turns.len() <= S::Few::WIDTH {
            self.of::<S::Few>(isa);
        } else {
            self.of::<S::Narrow>(isa);
        }
    }
}

impl Stretch<'_> {
    #[inline(always)]
    fn of<L: Lane>(self, token: L::Token) {
        let schedule = &self.strobe.schedule;
        let width = L::WIDTH;
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
                    value: L::load(token, &buffers[0].0),
                    slope: [L::load(token, &buffers[3].0)],
                };
                let velocity = Tangent {
                    value: L::load(token, &buffers[1].0),
                    slope: [L::load(token, &buffers[4].0)],
                };
                let mut lanes = Moving::new(schedule, theta, velocity);
                lanes.run::<Fine>(schedule);
                let velocity = lanes.velocity(schedule);
                let (wrapped, whole) = self.strobe.angle.wrap(lanes.half_turns.value);
                let turns = L::load(token, &buffers[2].0) + whole;
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
