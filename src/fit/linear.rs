//! Residuals of a window and their derivatives.

use std::ops::Range;
use std::sync::Arc;

use super::problem::{Columns, MOST_READINGS, Problem, Shaped, Slot};
use super::quantised::{Likelihood, likelihood};
use super::window::Window;
use crate::integrate::State;
use crate::integrate::reference::problem::OdeProblem;
use crate::integrate::reference::sample::sample;
use crate::integrate::tangent::{Number, Tangent};
use crate::lanes::dispatch::Register;
#[cfg(target_arch = "x86_64")]
use crate::lanes::pack::Bundle;
use crate::lanes::{Lane, Real};
use crate::model::{Observation, Parameter, Pendulum};

/// Largest number of derivatives in one pass.
const WIDEST: usize = 16;
/// A trial that needs more steps than this, and than that in a unit of time, is far off: it is given
/// up. Ten in a unit of time are common.
const MOST_STEPS: usize = 1000;
const MOST_STEPS_A_TIME: f64 = 50.0;
/// The largest rate of a mode that is integrated.
const QUICKEST: f64 = 10.0;
/// The free parameters of a reading, angle and velocity.
const READINGS: usize = MOST_READINGS + 2;

/// A window at one point of the search.
#[derive(Clone, Debug)]
pub struct Linear {
    /// Angle, not wrapped, and velocity at each sample.
    pub states: Vec<State>,
    /// Reading less model; 0 if a sample has no weight.
    pub apart: Vec<f64>,
    /// Residuals over the standard error; for readings rounded to counts, [`Likelihood::residual`].
    pub residuals: Vec<f64>,
    /// One over the standard error, or [`Likelihood::weight`]; 0 where a sample does not count.
    pub weights: Vec<f64>,
    /// For each sample a row of derivatives of the model times that weight: by the record's
    /// columns, then by the initial angle and velocity.
    pub rows: Vec<f64>,
    /// The length of a row.
    pub width: usize,
    /// The sum of the squared residuals, or of the deviances; not a number where the motion was lost.
    pub chi2: f64,
    /// Whether readings are intervals.
    counted: bool,
}

impl Linear {
    /// The row of one sample.
    #[must_use]
    pub fn row(&self, sample: usize) -> &[f64] {
        &self.rows[sample * self.width..(sample + 1) * self.width]
    }

    /// Residuals whose noise is white and of unit variance. The information of counts varies from
    /// almost none to all: for them, the slopes of the likelihood over the root of their mean
    /// square.
    #[must_use]
    pub fn white(&self) -> Vec<f64> {
        if !self.counted {
            return self.residuals.clone();
        }
        let number = self.weights.iter().filter(|weight| **weight > 0.0).count().max(1);
        let squares: f64 = self.weights.iter().map(|weight| weight * weight).sum();
        let mean = (squares / number as f64).sqrt().max(f64::MIN_POSITIVE);
        self.residuals.iter().zip(&self.weights).map(|(r, w)| r * w / mean).collect()
    }
}

/// Integrates `window` with the pendulum of its record.
#[must_use]
pub fn linearise(problem: &Problem, shaped: &Shaped, columns: &Columns, window: &Window) -> Linear {
    let directions = columns.motion.len() + 2;
    let register = problem.simd.register();
    let stride = directions.next_multiple_of(register.width());
    let samples = window.to - window.from;
    let mut motion = Motion {
        states: Vec::with_capacity(samples),
        heard: Vec::with_capacity(samples),
        slopes: vec![0.0; 2 * samples * stride],
        stride,
    };
    let follow = Follow { problem, shaped, columns, window };
    let mut first = 0;
    while first < directions {
        let left = directions - first;
        // The smallest number type that holds the remaining derivatives.
        match register {
            #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
            Register::Avx512(isa) => match left {
                ..=8 => follow.pass::<Bundle<_, 1>, 1>(isa, first, &mut motion),
                _ => follow.pass::<Bundle<_, 1>, 2>(isa, first, &mut motion),
            },
            #[cfg(target_arch = "x86_64")]
            Register::Avx2(isa) => match left {
                ..=8 => follow.pass::<Bundle<_, 1>, 2>(isa, first, &mut motion),
                _ => follow.pass::<Bundle<_, 1>, 4>(isa, first, &mut motion),
            },
            Register::Single => match left {
                ..=5 => follow.pass::<f64, 5>((), first, &mut motion),
                6..=8 => follow.pass::<f64, 8>((), first, &mut motion),
                9..=12 => follow.pass::<f64, 12>((), first, &mut motion),
                _ => follow.pass::<f64, WIDEST>((), first, &mut motion),
            },
        }
        first += WIDEST;
    }
    follow.read(motion)
}

/// The motion in a window.
struct Motion {
    /// Angle and velocity at the samples.
    states: Vec<State>,
    /// The input of the sensor: angle and velocity, or the reading of a rod sensor and 0.
    heard: Vec<State>,
    /// Its derivatives: for each sample two rows.
    slopes: Vec<f64>,
    /// The length of a row, in whole registers.
    stride: usize,
}

struct Follow<'a> {
    problem: &'a Problem,
    shaped: &'a Shaped,
    columns: &'a Columns,
    window: &'a Window,
}

impl Follow<'_> {
    /// The motion with its derivatives in the directions from `first` on that `N` slopes hold.
    fn pass<L: Lane, const N: usize>(&self, token: L::Token, first: usize, into: &mut Motion) {
        let record = &self.problem.records[self.window.record];
        let motion = &self.columns.motion;
        // A direction of another pass has no place in this one.
        let along = |value: f64, direction: usize| {
            Tangent::<L, N>::along(token, value, direction.wrapping_sub(first))
        };
        let number = |slot: Slot, value: f64| {
            let direction = motion.iter().position(|(_, other)| *other == slot);
            along(value, direction.unwrap_or(usize::MAX))
        };
        let Shaped { pendulum, gravity, rod_sensor, rate } = self.shaped;
        let parameter = |one: Parameter, value: f64| number(Slot::Parameter(one), value);
        let mut ode =
            OdeProblem::with_rate(pendulum, *rate, true, self.problem.tolerance, parameter)
                .finding_turns()
                .with_gravity(number(Slot::Gravity, *gravity));
        if let Some(recorded) = &record.recorded {
            ode = ode.driven_by(Arc::clone(recorded));
        }
        let times = &record.times[self.window.from..self.window.to];
        // A mode of the rig requires short steps, however slow the pendulum is.
        let rate = if ode.field().sways() { rate.min(QUICKEST) } else { 1.0 };
        let rate = rate.max(pendulum.motion().omega);
        let most =
            MOST_STEPS + (MOST_STEPS_A_TIME * rate * (times[times.len() - 1] - times[0])) as usize;
        let begin = |of: usize| along(self.window.start[of], motion.len() + of);
        let run =
            sample(&ode, times[0], [begin(0), begin(1)], times, |driver, _| driver.steps < most);
        into.states.clear();
        into.heard.clear();
        let rows = into.slopes.chunks_exact_mut(2 * into.stride);
        for (k, (state, rows)) in run.states.iter().zip(rows).enumerate() {
            let given = match rod_sensor {
                None => [run.given(&ode, k), state[1]],
                Some(sensor) => {
                    let reading = sensor.read(state[1], number(Slot::Bias, sensor.bias));
                    [reading, reading.like(0.0)]
                }
            };
            for (given, row) in given.iter().zip(rows.chunks_exact_mut(into.stride)) {
                given.slopes(&mut row[first..]);
            }
            into.heard.push(given.map(Number::value));
            into.states.push(state.map(Number::value));
        }
    }

    /// The reading of the sensor, by its input.
    fn read(&self, motion: Motion) -> Linear {
        let Motion { states, heard, slopes, stride } = motion;
        let record = &self.problem.records[self.window.record];
        // Of a sensor on the rod only what multiplies its readings acts.
        let rod = self.shaped.rod_sensor.is_some();
        let sensor = Sensor::new(&self.shaped.pendulum, self.columns, rod);
        let (moving, reading) = (self.columns.motion.len(), self.columns.reading.len());
        let width = moving + reading + 2;
        let mut residuals = Vec::with_capacity(states.len());
        let mut apart = Vec::with_capacity(states.len());
        let mut weights = Vec::with_capacity(states.len());
        let mut chi2 = 0.0;
        let mut rows = Vec::with_capacity(states.len() * width);
        for (k, given) in heard.iter().enumerate() {
            let sample = self.window.from + k;
            let weight = record.weights[sample];
            if weight == 0.0 {
                residuals.push(0.0);
                apart.push(0.0);
                weights.push(0.0);
                rows.extend(std::iter::repeat_n(0.0, width));
                continue;
            }
            let (of_angle, of_velocity) =
                slopes[2 * k * stride..2 * (k + 1) * stride].split_at(stride);
            let lab = self.shaped.pendulum.lab_time + record.times[sample];
            let read = sensor.read(*given, lab);
            let away = record.readings[sample] - read.value;
            let (weight, residual) = match &record.counts {
                None => {
                    let residual = weight * away;
                    chi2 += residual * residual;
                    (weight, residual)
                }
                Some(counts) => {
                    let Likelihood { deviance, residual, weight } =
                        likelihood(away, counts.step, weight);
                    chi2 += deviance - counts.surplus[sample];
                    (weight, residual)
                }
            };
            apart.push(away);
            residuals.push(residual);
            weights.push(weight);
            let by_state = [0, 1].map(|of| weight * read.slope[of]);
            let through = |range: Range<usize>| {
                let pairs = of_angle[range.clone()].iter().zip(&of_velocity[range]);
                pairs.map(|(angle, velocity)| by_state[0] * angle + by_state[1] * velocity)
            };
            rows.extend(through(0..moving));
            rows.extend(read.slope[2..2 + reading].iter().map(|slope| weight * slope));
            rows.extend(through(moving..moving + 2));
        }
        let counted = record.counts.is_some();
        Linear { states, apart, residuals, weights, rows, width, chi2, counted }
    }
}

/// The sensor, with derivatives by angle, velocity and its free parameters.
struct Sensor(Observation<Tangent<f64, READINGS>>);

impl Sensor {
    fn new(pendulum: &Pendulum, columns: &Columns, rod: bool) -> Self {
        let all = Observation::lift(pendulum, |parameter, value| {
            let place = columns.reading.iter().position(|(_, one)| *one == parameter);
            Tangent::seeded(value, place.map_or(usize::MAX, |place| place + 2))
        });
        Self(if rod { all.scaling() } else { all })
    }

    fn read(&self, state: State, lab: f64) -> Tangent<f64, READINGS> {
        let [theta, velocity] = [0, 1].map(|of| Tangent::seeded(state[of], of));
        self.0.read(theta, velocity, theta.like(lab))
    }
}
