//! Tangent vectors of states: the rate at which neighbouring trajectories diverge.

use std::f64::consts::{PI, TAU};

use super::step::Moving;
use super::stroboscopic::Strobe;
use crate::integrate::tangent::Tangent;
use crate::integrate::{States, TangentStates};
use crate::lanes::sine::Fine;
use crate::lanes::{Isa, Job, Lane, MAX_WIDTH, dispatch};
use crate::model::pendulum::Route;

/// Distance of a state's shadow: its square and rounding over it are as small.
const SHADOW: f64 = 1e-7;

impl Strobe {
    /// [`Strobe::advance`] with one tangent vector for each state.
    ///
    /// Adds the natural logarithm of the factor by which a vector has grown to its growth: over the
    /// time it is the finite-time Lyapunov exponent. The vectors come back with length 1.
    pub fn stretch(&self, all: &mut TangentStates, periods: usize) {
        if self.route != Route::Smooth || self.extra {
            self.stretch_by_shadows(all, periods);
        } else {
            dispatch::run(self.simd, Stretch { strobe: self, all, periods });
        }
    }

    /// Each state and a second one at the distance [`SHADOW`] along its tangent: their distance grows as
    /// the tangent does, through turns and sticks too.
    fn stretch_by_shadows(&self, all: &mut TangentStates, periods: usize) {
        let TangentStates { states, tangents: [along, across], growth } = all;
        let count = states.len();
        let mut both: States = [[0.0; 2]].into_iter().cycle().take(2 * count).collect();
        for _ in 0..periods {
            let States { theta, velocity, turns } = &mut both;
            turns.fill(0.0);
            for i in 0..count {
                (theta[i], velocity[i]) = (states.theta[i], states.velocity[i]);
                theta[count + i] = states.theta[i] + SHADOW * along[i];
                velocity[count + i] = states.velocity[i] + SHADOW * across[i];
            }
            self.advance(&mut both, 1);
            let States { theta, velocity, turns } = &both;
            for i in 0..count {
                (states.theta[i], states.velocity[i]) = (theta[i], velocity[i]);
                states.turns[i] += turns[i];
                let apart = theta[count + i] - theta[i] + TAU * (turns[count + i] - turns[i]);
                let gain = velocity[count + i] - velocity[i];
                let length = apart.hypot(gain) / SHADOW;
                growth[i] += length.ln();
                // If friction has brought both to one state the growth is zero from then on.
                if length > 0.0 {
                    along[i] = apart / (SHADOW * length);
                    across[i] = gain / (SHADOW * length);
                }
            }
        }
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
    all: &'a mut TangentStates,
    periods: usize,
}

impl Job for Stretch<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) {
        self.of::<S::Few>(isa);
    }
}

impl Stretch<'_> {
    #[inline(always)]
    fn of<L: Lane>(self, token: L::Token) {
        let schedule = &self.strobe.schedule;
        let TangentStates { states, tangents, growth } = self.all;
        let States { theta, velocity, turns } = states;
        let mut columns = {
            let [along, across] = tangents;
            [theta, velocity, turns, along, across].map(Vec::as_mut_slice)
        };
        let width = L::WIDTH;
        let mut buffers: [Buffer; 5] = std::array::from_fn(|_| Buffer::default());
        let mut start = 0;
        while start < growth.len() {
            let part = start..(start + width).min(growth.len());
            for (buffer, column) in buffers.iter_mut().zip(&columns) {
                buffer.fill(&column[part.clone()]);
            }
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
                        growth[start + lane] += product.ln();
                        *product = 1.0;
                    }
                }
            }
            for (growth, product) in growth[part.clone()].iter_mut().zip(product) {
                *growth += product.ln();
            }
            for (buffer, column) in buffers.iter().zip(&mut columns) {
                column[part.clone()].copy_from_slice(&buffer.0[..part.len()]);
            }
            start = part.end;
        }
    }
}
