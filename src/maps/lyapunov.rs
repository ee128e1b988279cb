//! The largest Lyapunov exponent of the attractor that a start reaches.
//!
//! Of a closed orbit it is exact, from the multipliers; of chaos the mean growth of tangents along an
//! ensemble of trajectories on the attractor, with a standard error from their spread. A chaotic
//! transient has a positive exponent too: what counts is what captured it.

use rayon::prelude::*;

use super::basins::{MAX_PERIODS, SEARCH_BOUND, SEARCH_SAMPLE};
use super::control::{Control, pool};
use super::growth::Bundle;
use super::starts::{Axis, Starts};
use crate::attractor::capture::{Fate, Outcome, outcomes};
use crate::attractor::chaos::mean_and_error;
use crate::attractor::{Attractor, Catalogue, Effort};
use crate::error::Error;
use crate::integrate::{State, Strobe, accuracy};
use crate::lanes::Path;
use crate::model::Pendulum;
use crate::model::pendulum::Route;
use crate::orbit::PoincareMap;

/// Trajectories of an ensemble.
pub const TRAJECTORIES: usize = 256;
/// Periods of a window: what a finite-time exponent of the result is over.
pub const WINDOW: usize = 20;
/// Windows between two looks at the error.
const ROUND: usize = 10;
/// Rounds at least.
const LEAST_ROUNDS: usize = 2;
/// Periods that each trajectory is followed for at the most, where nothing is said.
const MOST: u32 = 20_000;
/// Where nothing is damped the tangent of regular motion grows in proportion to time, and no number
/// of periods is enough.
const MOST_UNDAMPED: u32 = 2_000;
/// Members of the ensemble begin so near points of the attractor.
const NEAR: f64 = 1e-6;
/// Periods dropped at least: tangents turn into the direction of growth, the members part.
const DROPPED: f64 = 100.0;
/// Beyond growing from [`NEAR`] to 1, members grow apart by this power of e before they count.
const APART: f64 = 12.0;
/// Periods dropped at the most.
const MOST_DROPPED: f64 = 5_000.0;
/// Periods of the start's own growth after it has been captured, and at the most.
const COURSE: [usize; 2] = [100, 4_000];
/// Periods within which a trap takes what lies in it.
const TAKEN: u32 = 64;
/// Last points of a trajectory that say in which region it lives.
const LAST_POINTS: usize = 16;
/// Trajectories and periods whose shrinking of phase area gives the sum of both exponents.
const AREA: [usize; 2] = [32, 60];

/// What to compute, and how well.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Angle and velocity at `tau = 0`.
    pub start: State,
    /// Standard error over the exponent that the ensemble goes on for.
    pub precision: f64,
    /// The 95th percentile of the error after five periods.
    pub tol: f64,
    /// Periods within which the start must be captured, and that each member is followed for.
    pub max_periods: Option<u32>,
    /// Workers; 0 for one a processor.
    pub threads: usize,
    /// Chooses the ensemble.
    pub seed: u64,
}

/// Where the start ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// On an attractor with traps: its exponent is known.
    Captured,
    /// On a chaotic attractor.
    Chaotic,
    /// Nowhere: nothing is damped.
    Undamped,
    /// On nothing within the bound.
    Undecided,
    /// Out of the range of numbers, or ever faster.
    Failed,
}

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

/// The exponent of what a start reaches.
#[derive(Clone, Debug)]
pub struct Exponent {
    /// How the start ended.
    pub end: End,
    /// What it reached.
    pub attractor: Option<Attractor>,
    /// Periods until that captured it.
    pub transient: Option<u32>,
    /// Of chaos, and of undamped motion.
    pub ensemble: Option<Ensemble>,
    /// Members of an ensemble that something captured after all: what looked like an attractor is a
    /// transient.
    pub lost: usize,
    /// Logarithm of the growth of the start's own tangent in each period from the first.
    pub course: Vec<f64>,
    /// Periods after which the start counted as undecided.
    pub bound: u32,
    /// Steps a period.
    pub steps: usize,
    /// The error that was reached, as [`accuracy::error_reached`] defines it.
    pub reached_error: f64,
    /// The instruction set.
    pub path: Path,
}

/// The largest exponent of the attractor that `request.start` reaches.
///
/// # Errors
/// [`Error::NotMappable`] for effects that a map cannot have, [`Error::Range`] and
/// [`Error::Tolerance`] for requests that cannot be met, [`Error::Interrupted`] if `control` was
/// cancelled.
pub fn lyapunov(
    pendulum: &Pendulum,
    request: &Request,
    control: &Control,
) -> Result<Exponent, Error> {
    pendulum.check_mappable()?;
    let pi = std::f64::consts::PI;
    let plane = Starts::Grid {
        theta: Axis::new("theta", -pi, pi, 1000)?,
        velocity: Axis::new("velocity", -3.0, 3.0, 1000)?,
    };
    let start = request.start;
    let mut seeds = plane.sampled_states(SEARCH_SAMPLE, 0);
    let path = Path::choose()?;
    let (strobe, reached_error) = accuracy::choose(pendulum, &seeds, request.tol, path)?;
    seeds.insert(0, start);
    let pool = pool(request.threads)?;
    let bound = request.max_periods.unwrap_or(MAX_PERIODS).max(1);
    let mut result = Exponent {
        end: End::Undamped,
        attractor: None,
        transient: None,
        ensemble: None,
        lost: 0,
        course: Vec::new(),
        bound,
        steps: strobe.steps(),
        reached_error,
        path,
    };
    let mut run = Run { strobe: &strobe, request, pool: &pool, control };
    if pendulum.is_dissipative() {
        run.reach(&seeds, &mut result)?;
    } else {
        let most = request.max_periods.unwrap_or(MOST_UNDAMPED);
        let states = run.members(&[start]);
        result.ensemble = Some(run.ensemble(&states, DROPPED as u32, most)?.0);
    }
    let length = result.transient.map_or(COURSE[1] / 4, |t| t as usize + COURSE[0]);
    let mut own = Bundle::new(&[start]);
    let rows = own.grow(&strobe, length.min(COURSE[1]), 1, &pool, control)?;
    result.course = rows.into_iter().next().unwrap_or_default();
    Ok(result)
}

struct Run<'a> {
    strobe: &'a Strobe,
    request: &'a Request,
    pool: &'a rayon::ThreadPool,
    control: &'a Control,
}

impl Run<'_> {
    /// Follows the start to its end.
    fn reach(&mut self, seeds: &[State], result: &mut Exponent) -> Result<(), Error> {
        let mut catalogue = Catalogue::new(self.strobe, Effort::THOROUGH);
        catalogue.search(self.strobe, seeds, SEARCH_BOUND, self.control.flag());
        self.control.check()?;
        let mut outcome = self.capture(&catalogue, seeds[0], result.bound)?;
        let mut home = self.region(&catalogue, &outcome)?;
        if outcome.fate == Fate::Open && home.is_none() {
            // Something that the search has not met: it begins anew where the start has come to.
            catalogue.search(self.strobe, &[outcome.state], SEARCH_BOUND, self.control.flag());
            self.control.check()?;
            outcome = self.capture(&catalogue, seeds[0], result.bound)?;
            home = self.region(&catalogue, &outcome)?;
        }
        if let (Fate::Open, Some(index)) = (outcome.fate, home) {
            let chaos = catalogue.attractors[index].clone();
            let per_period = chaos.exponent * self.strobe.pendulum.period();
            let apart = (APART - NEAR.ln()) / per_period;
            let dropped = apart.clamp(DROPPED, MOST_DROPPED).ceil() as u32;
            let most = self.request.max_periods.unwrap_or(MOST);
            let states = self.members(&chaos.points);
            let (ensemble, ends) = self.ensemble(&states, dropped, most)?;
            result.lost = self.lost(&mut catalogue, &ensemble, &ends)?;
            result.ensemble = Some(ensemble);
            if result.lost == 0 {
                result.end = End::Chaotic;
                result.attractor = Some(chaos);
                return Ok(());
            }
            // A long transient: the start itself will be captured, sooner or later.
            outcome = self.capture(&catalogue, seeds[0], result.bound.max(MOST))?;
        }
        match outcome.fate {
            Fate::Captured(index) => {
                result.end = End::Captured;
                result.attractor = Some(catalogue.attractors[index].clone());
                result.transient = Some(outcome.periods);
            }
            Fate::Open => result.end = End::Undecided,
            Fate::Failed => result.end = End::Failed,
        }
        Ok(())
    }

    fn capture(&self, catalogue: &Catalogue, start: State, bound: u32) -> Result<Outcome, Error> {
        let found = outcomes(self.strobe, &catalogue.traps, bound, &[start], self.control.flag());
        found.and_then(|all| all.into_iter().next()).ok_or(Error::Interrupted)
    }

    /// The chaotic attractor in whose region an open trajectory goes on.
    fn region(&self, catalogue: &Catalogue, outcome: &Outcome) -> Result<Option<usize>, Error> {
        if outcome.fate != Fate::Open || !catalogue.has_chaos() {
            return Ok(None);
        }
        let (mut theta, mut velocity) = ([outcome.state[0]], [outcome.state[1]]);
        let mut points = Vec::with_capacity(LAST_POINTS);
        for _ in 0..LAST_POINTS {
            self.strobe.advance(&mut theta, &mut velocity, &mut [0.0], 1)?;
            points.push([theta[0], velocity[0]]);
        }
        Ok(catalogue.region_of(&points))
    }

    /// States near `points`, drawn by the seed.
    fn members(&self, points: &[State]) -> Vec<State> {
        let mut draw = Draw(self.request.seed);
        let near = |x: f64, part: f64| x + NEAR * (2.0 * part - 1.0);
        (0..TRAJECTORIES)
            .map(|_| {
                let [theta, velocity] = points[(draw.next() * points.len() as f64) as usize];
                [near(theta, draw.next()), near(velocity, draw.next())]
            })
            .collect()
    }

    /// Growth along trajectories from `states`, until the error is small enough or `most` periods are
    /// over; and where they are then.
    fn ensemble(
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
                all.extend(row);
            }
            let done = done + new;
            let time = (done * WINDOW) as f64 * period;
            let means: Vec<f64> = growth.iter().map(|row| row.iter().sum::<f64>() / time).collect();
            let (exponent, stderr) = mean_and_error(&means);
            let enough =
                done >= LEAST_ROUNDS * ROUND && stderr <= self.request.precision * exponent.abs();
            if enough || done >= most_windows || !exponent.is_finite() {
                let ends = bundle.states();
                let sum = self.sum(&ends)?;
                return Ok((Ensemble { growth, dropped, exponent, stderr, sum }, ends));
            }
        }
    }

    /// How many of the `ends` of an ensemble are captured: by what is known, or by what a search finds
    /// from those whose neighbours come together.
    fn lost(
        &self,
        catalogue: &mut Catalogue,
        ensemble: &Ensemble,
        ends: &[State],
    ) -> Result<usize, Error> {
        let settled = |row: &Vec<f64>| row.iter().rev().take(ROUND).sum::<f64>() <= 0.0;
        let suspects: Vec<State> = ensemble
            .growth
            .iter()
            .zip(ends)
            .filter(|(row, _)| settled(row))
            .map(|(_, end)| *end)
            .collect();
        if !suspects.is_empty() {
            catalogue.search(self.strobe, &suspects, SEARCH_BOUND, self.control.flag());
        }
        let found = outcomes(self.strobe, &catalogue.traps, TAKEN, ends, self.control.flag());
        let found = found.ok_or(Error::Interrupted)?;
        Ok(found.iter().filter(|o| o.fate != Fate::Open).count())
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

/// Numbers in [0, 1) that a seed decides: Steele, Lea & Flood (2014), "Fast splittable pseudorandom
/// number generators" (SplitMix64).
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
