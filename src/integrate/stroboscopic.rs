//! The stroboscopic map for many trajectories: states at `tau = 0 mod T`, one forcing period at a
//! time, every lane at the same phase.

use super::schedule::Schedule;
use super::step::Moving;
use super::tangent::Tangent;
use crate::error::Error;
use crate::lanes::sine::{Coarse, Degree, Fine, wrap};
use crate::lanes::{Isa, Job, Lane, MAX_WIDTH, Path, Real, dispatch};
use crate::model::Pendulum;

/// Angle and velocity, `[theta, th']`.
pub type State = [f64; 2];

/// From steps of this length on, in units of `1/sqrt(1 + |p|)`, the method errs about as much as the
/// coarse sine does, or more: measured from p = 0 to 30, where both grow with the stretching.
const COARSE_SINE_FROM: f64 = 0.28;

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
}

impl Strobe {
    /// `steps` steps a period; their length chooses the sine's degree.
    #[must_use]
    pub fn new(pendulum: &Pendulum, steps: usize, path: Path) -> Self {
        let schedule = Schedule::period(pendulum, steps);
        let pull = pendulum.greatest_pull().sqrt();
        let fine = pendulum.period() / steps as f64 * pull < COARSE_SINE_FROM;
        Self { pendulum: pendulum.clone(), schedule, path, fine }
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
        dispatch::run(self.path, Advance::new(self, theta, velocity, turns, periods)?);
        Ok(())
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
        dispatch::run(self.path, Singly(Advance::new(self, theta, velocity, turns, periods)?));
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
        dispatch::run(
            self.path,
            Stretch { strobe: self, states, turns, tangents, growth, periods },
        );
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

struct Advance<'a> {
    strobe: &'a Strobe,
    theta: &'a mut [f64],
    velocity: &'a mut [f64],
    turns: &'a mut [f64],
    periods: usize,
}

impl<'a> Advance<'a> {
    fn new(
        strobe: &'a Strobe,
        theta: &'a mut [f64],
        velocity: &'a mut [f64],
        turns: &'a mut [f64],
        periods: usize,
    ) -> Result<Self, Error> {
        same_length(("theta", theta.len()), ("velocity", velocity.len()))?;
        same_length(("theta", theta.len()), ("turns", turns.len()))?;
        Ok(Self { strobe, theta, velocity, turns, periods })
    }

    #[inline(always)]
    fn over<D: Degree, L: Lane>(self, token: L::Token) {
        let schedule = &self.strobe.schedule;
        let (mut theta, mut velocity, mut turns) =
            (Buffer::default(), Buffer::default(), Buffer::default());
        let chunks = self
            .theta
            .chunks_mut(L::WIDTH)
            .zip(self.velocity.chunks_mut(L::WIDTH))
            .zip(self.turns.chunks_mut(L::WIDTH));
        for ((a, b), c) in chunks {
            theta.fill(a);
            velocity.fill(b);
            turns.fill(c);
            let mut lanes =
                Moving::new(schedule, L::load(token, &theta.0), L::load(token, &velocity.0));
            let mut count = L::load(token, &turns.0);
            for _ in 0..self.periods {
                lanes.run::<D>(schedule);
                let (wrapped, whole) = wrap(lanes.half_turns);
                lanes.half_turns = wrapped;
                count = count + whole;
            }
            lanes.theta().store(&mut theta.0);
            lanes.velocity(schedule).store(&mut velocity.0);
            count.store(&mut turns.0);
            a.copy_from_slice(&theta.0[..a.len()]);
            b.copy_from_slice(&velocity.0[..b.len()]);
            c.copy_from_slice(&turns.0[..c.len()]);
        }
    }
}

impl Job for Advance<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) {
        if self.strobe.fine {
            self.over::<Fine, S::Lanes>(isa);
        } else {
            self.over::<Coarse, S::Lanes>(isa);
        }
    }
}

struct Singly<'a>(Advance<'a>);

impl Job for Singly<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, _: S) {
        if self.0.strobe.fine {
            self.0.over::<Fine, S::Single>(());
        } else {
            self.0.over::<Coarse, S::Single>(());
        }
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
                wrapped.scale(std::f64::consts::PI).store(&mut buffers[0].0);
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
