//! Growth along many trajectories on one attractor, until its mean has a given standard error.

use rayon::prelude::*;

use super::control::Control;
use super::tangent_growth::Bundle;
use crate::attractor::chaos::mean_and_error;
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::memory;
use crate::model::pendulum::Route;
use crate::orbit::PoincareMap;

/// Number of trajectories of an ensemble.
pub const TRAJECTORIES: usize = 256;
/// Periods of a window, over which finite-time exponents of the result are.
pub const WINDOW: usize = 20;
/// Windows between two tests of the error.
pub(super) const ROUND: usize = 10;
/// Least number of rounds.
const LEAST_ROUNDS: usize = 2;
/// Distance of the initial members from points of the attractor.
pub(super) const NEAR: f64 = 1e-6;
/// Numbers of trajectories and periods from which the sum of both exponents is computed.
const AREA: [usize; 2] = [32, 60];

/// Growth along an ensemble.
#[derive(Clone, Debug)]
pub struct Ensemble {
    /// Logarithms of the growth over [`WINDOW`] periods, a row for each trajectory.
    pub growth: Vec<Vec<f64>>,
    /// Periods dropped before.
    pub dropped: u32,
    /// Mean exponent per unit of tau.
    pub exponent: f64,
    /// Its standard error, from the spread of the trajectories.
    pub stderr: f64,
    /// Sum of both exponents, and its standard error; minus infinity where friction stops the motion.
    pub sum: (f64, f64),
}

/// The arguments of an ensemble.
pub(super) struct Run<'a> {
    pub(super) strobe: &'a Strobe,
    /// Relative standard error of the exponent at which the ensemble ends.
    pub(super) precision: f64,
    /// Seed of the members.
    pub(super) seed: u64,
    pub(super) pool: &'a rayon::ThreadPool,
    pub(super) control: &'a Control,
}

impl Run<'_> {
    /// States near `points`, drawn by the seed.
    pub(super) fn members(&self, points: &[State]) -> Vec<State> {
        let mut draw = Draw(self.seed);
        let near = |x: f64, part: f64| x + NEAR * (2.0 * part - 1.0);
        (0..TRAJECTORIES)
            .map(|_| {
                let [theta, velocity] = points[(draw.next() * points.len() as f64) as usize];
                [near(theta, draw.next()), near(velocity, draw.next())]
            })
            .collect()
    }

    /// Growth along trajectories from `states`, until the error is small enough or after `most`
    /// periods; and their final states.
    pub(super) fn ensemble(
        &self,
        states: &[State],
        dropped: u32,
        most: u32,
    ) -> Result<(Ensemble, Vec<State>), Error> {
        let (pool, control) = (self.pool, self.control);
        let period = self.strobe.pendulum.period();
        let most_windows = (most as usize / WINDOW).max(LEAST_ROUNDS);
        let mut bundle = Bundle::new(states);
        control.begin(0);
        bundle.grow(self.strobe, 1, dropped as usize, pool, control)?;
        let mut growth: Vec<Vec<f64>> = vec![Vec::new(); states.len()];
        loop {
            let done = growth[0].len();
            let new = ROUND.min(most_windows - done);
            control.begin(done + new);
            let rows = bundle.grow(self.strobe, new, WINDOW, pool, control)?;
            for (all, row) in growth.iter_mut().zip(rows) {
                memory::room("windows", all, row.len())?;
                all.extend(row);
            }
            let done = done + new;
            let time = (done * WINDOW) as f64 * period;
            let means: Vec<f64> = growth.iter().map(|row| row.iter().sum::<f64>() / time).collect();
            let (exponent, stderr) = mean_and_error(&means);
            let enough = done >= LEAST_ROUNDS * ROUND && stderr <= self.precision * exponent.abs();
            if enough || done >= most_windows || !exponent.is_finite() {
                let ends = bundle.states();
                let sum = self.sum(&ends)?;
                return Ok((Ensemble { growth, dropped, exponent, stderr, sum }, ends));
            }
        }
    }

    /// The sum of both exponents: the mean rate at which phase area grows, with its standard error.
    ///
    /// Viscous damping shrinks it evenly, by `exp(-gamma tau)`. At a turn under friction it jumps by
    /// the ratio of the accelerations, and a stick leaves none.
    fn sum(&self, states: &[State]) -> Result<(f64, f64), Error> {
        let pendulum = &self.strobe.pendulum;
        if pendulum.route() == Route::Smooth {
            return Ok((-pendulum.gamma, 0.0));
        }
        let map = PoincareMap::new(pendulum);
        let stride = states.len().div_ceil(AREA[0]);
        let some: Vec<State> = states.iter().step_by(stride).copied().collect();
        let rates: Vec<f64> = self.pool.install(|| {
            some.par_iter()
                .map(|start| {
                    self.control.check()?;
                    let (mut state, mut sum) = (*start, 0.0);
                    for _ in 0..AREA[1] {
                        let image = map.once(state);
                        let area = image.product.unwrap_or_else(|| image.derivative.determinant());
                        sum += area.abs().ln();
                        state = image.state;
                    }
                    Ok(sum / (AREA[1] as f64 * pendulum.period()))
                })
                .collect::<Result<_, Error>>()
        })?;
        Ok(mean_and_error(&rates))
    }
}

/// Reproducible numbers in [0, 1): Steele, Lea & Flood (2014), "Fast splittable pseudorandom number
/// generators" (`SplitMix64`).
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
