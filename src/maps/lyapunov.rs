//! The largest Lyapunov exponent of the attractor that a start reaches.
//!
//! For a periodic orbit it is exact, from the multipliers; for chaos it is the mean growth of
//! tangents along an ensemble of trajectories on the attractor, with a standard error from their
//! spread. A chaotic transient has a positive exponent too: the result is that of the attractor
//! that captures it.

use super::basin_plan::SEARCH_SAMPLE;
use super::bounds::{chaos_periods, max_periods, search_periods, settling_periods};
use super::control::{Control, pool};
use super::ensemble::{Ensemble, NEAR, ROUND, Run};
use super::starts::{Axis, Starts};
use super::tangent_growth::TangentTrajectory;
use crate::attractor::capture::{Fate, outcomes};
use crate::attractor::{Attractor, Catalogue, Effort};
use crate::error::Error;
use crate::integrate::{State, accuracy};
use crate::lanes::InstructionSet;
use crate::model::Pendulum;

/// Default of the largest number of periods of each trajectory.
const MOST: u32 = 20_000;
/// Without damping the tangent of regular motion grows in proportion to time, and no number of
/// periods is sufficient.
const MOST_UNDAMPED: u32 = 2_000;
/// Least number of dropped periods: tangents align with the direction of growth, the members
/// diverge.
const DROPPED: f64 = 100.0;
/// Power of e by which members diverge, beyond growing from [`NEAR`] to 1, before averaging begins.
const APART: f64 = 12.0;
/// Largest number of dropped periods.
const MOST_DROPPED: f64 = 5_000.0;
/// Periods of the start's own growth after its capture, or without one.
const COURSE: [usize; 2] = [100, 1_000];
/// Periods between two tests of whether a trap has captured the start.
const STRETCH: usize = 64;
/// Periods in which a trap captures a state inside it: two hits.
const AT_ONCE: u32 = 2;
/// Periods within which a trap captures a nearby state.
const TAKEN: u32 = 64;

/// A request and its numerical choices.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Angle and velocity at `tau = 0`.
    pub start: State,
    /// Relative standard error of the exponent at which the ensemble ends.
    pub precision: f64,
    /// The 95th percentile of the error after five periods.
    pub tol: f64,
    /// Bound on the periods to capture, and on those of each member.
    pub max_periods: Option<u32>,
    /// Workers; 0 for one a processor.
    pub threads: usize,
    /// Seed of the ensemble.
    pub seed: u64,
}

/// Fate of the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// On an attractor with traps: its exponent is known.
    Captured,
    /// On a chaotic attractor.
    Chaotic,
    /// On none: nothing is damped.
    Undamped,
    /// On none within the bound.
    Undecided,
    /// Left the range of numbers, or accelerates for ever.
    Failed,
}

/// The exponent of the attractor of a start.
#[derive(Clone, Debug)]
pub struct Exponent {
    /// How the start ended.
    pub end: End,
    /// How the search ended.
    pub attractor: Option<Attractor>,
    /// Periods until capture.
    pub transient: Option<u32>,
    /// The ensemble, for chaos and undamped motion.
    pub ensemble: Option<Ensemble>,
    /// Number of members of an ensemble that were captured after all: the apparent attractor is a
    /// transient.
    pub lost: usize,
    /// Logarithm of the growth of the start's own tangent in each period from the first.
    pub growth: Vec<f64>,
    /// Periods after which the start was classified as undecided.
    pub bound: u32,
    /// Periods without capture after which a trajectory is classified as chaotic.
    pub chaos_bound: u32,
    /// Steps a period.
    pub steps: usize,
    /// The reached error, as [`accuracy::error_reached`] defines it.
    pub reached_error: f64,
    /// The instruction set.
    pub simd: InstructionSet,
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
    let simd = InstructionSet::choose()?;
    let (strobe, reached_error) = accuracy::choose(pendulum, &seeds, request.tol, simd)?;
    seeds.insert(0, start);
    let pool = pool(request.threads)?;
    let bound = request.max_periods.unwrap_or_else(|| max_periods(pendulum)).max(1);
    let mut result = Exponent {
        end: End::Undamped,
        attractor: None,
        transient: None,
        ensemble: None,
        lost: 0,
        growth: Vec::new(),
        bound,
        chaos_bound: chaos_periods(&strobe, request.max_periods),
        steps: strobe.steps(),
        reached_error,
        simd,
    };
    let Request { precision, seed, .. } = *request;
    let run = Run { strobe: &strobe, precision, seed, pool: &pool, control };
    let mut trajectory = TangentTrajectory::new(start);
    if pendulum.is_dissipative() {
        run.reach(&seeds, &mut trajectory, request.max_periods, &mut result)?;
    } else {
        let most = request.max_periods.unwrap_or(MOST_UNDAMPED);
        let states = run.members(&[start]);
        result.ensemble = Some(run.ensemble(&states, DROPPED as u32, most)?.0);
    }
    let length = result.transient.map_or(COURSE[1], |t| t as usize + COURSE[0]);
    trajectory.extend(&strobe, length, &pool, control)?;
    result.growth = trajectory.growth;
    result.growth.truncate(length);
    Ok(result)
}

impl Run<'_> {
    /// Integrates the start to its end.
    fn reach(
        &self,
        seeds: &[State],
        trajectory: &mut TangentTrajectory,
        max_periods: Option<u32>,
        result: &mut Exponent,
    ) -> Result<(), Error> {
        let pendulum = &self.strobe.pendulum;
        let searched = search_periods(self.strobe, max_periods);
        let cancel = self.control.flag();
        let mut catalogue = Catalogue::new(self.strobe, Effort::THOROUGH, cancel)?;
        catalogue.progress = self.control.shared();
        catalogue.search(self.strobe, seeds, searched, cancel)?;
        let (mut fate, mut periods) = self.follow(trajectory, &catalogue, result.bound)?;
        let mut set = self.chaos_of(trajectory, &catalogue, fate)?;
        if fate == Fate::Open && set.is_none() {
            // An attractor that the search has not found: it is repeated from the present state.
            let here: Vec<State> = trajectory.states.last().copied().into_iter().collect();
            catalogue.search(self.strobe, &here, searched, cancel)?;
            if max_periods.is_none() {
                result.bound = settling_periods(pendulum, catalogue.slowest());
            }
            (fate, periods) = self.follow(trajectory, &catalogue, result.bound)?;
            set = self.chaos_of(trajectory, &catalogue, fate)?;
        }
        if let (Fate::Open, Some(index)) = (fate, set) {
            let chaos = catalogue.attractors[index].clone();
            let per_period = chaos.exponent * self.strobe.pendulum.period();
            let apart = (APART - NEAR.ln()) / per_period;
            let dropped = apart.clamp(DROPPED, MOST_DROPPED).ceil() as u32;
            let most = max_periods.unwrap_or(MOST);
            let states = self.members(&chaos.points);
            let (ensemble, ends) = self.ensemble(&states, dropped, most)?;
            result.lost = self.lost(&mut catalogue, &ensemble, &ends)?;
            result.ensemble = Some(ensemble);
            if result.lost == 0 {
                result.end = End::Chaotic;
                result.attractor = Some(chaos);
                return Ok(());
            }
            // A long transient: the start itself will be captured eventually.
            (fate, periods) = self.follow(trajectory, &catalogue, result.bound.max(MOST))?;
        }
        match fate {
            Fate::Captured(index) => {
                result.end = End::Captured;
                result.attractor = Some(catalogue.attractors[index].clone());
                result.transient = Some(periods);
            }
            Fate::Open => result.end = End::Undecided,
            Fate::Failed => result.end = End::Failed,
        }
        Ok(())
    }

    /// Integrates the start until a trap captures it, or for `bound` periods; returns its fate and
    /// the number of periods.
    ///
    /// With other rounding errors a chaotic transient ends elsewhere: the growth shown and the
    /// capture are of one trajectory.
    fn follow(
        &self,
        trajectory: &mut TangentTrajectory,
        catalogue: &Catalogue,
        bound: u32,
    ) -> Result<(Fate, u32), Error> {
        let (bound, flag) = (bound as usize, self.control.flag());
        let mut looked = 0;
        while looked < bound {
            let to = (looked + STRETCH).min(bound);
            trajectory.extend(self.strobe, to, self.pool, self.control)?;
            let states = &trajectory.states[looked..to];
            let ends = outcomes(self.strobe, &catalogue.traps, AT_ONCE, states, flag)?;
            for (k, end) in ends.iter().enumerate() {
                if end.fate != Fate::Open {
                    return Ok((end.fate, (looked + k) as u32 + end.periods));
                }
            }
            looked = to;
        }
        Ok((Fate::Open, bound as u32))
    }

    /// The chaotic attractor that an unsettled trajectory stays on.
    fn chaos_of(
        &self,
        trajectory: &TangentTrajectory,
        catalogue: &Catalogue,
        fate: Fate,
    ) -> Result<Option<usize>, Error> {
        let last: Vec<State> = trajectory.states.last().copied().into_iter().collect();
        if fate != Fate::Open {
            return Ok(None);
        }
        let sets = catalogue.chaos_of(self.strobe, &last, self.control.flag())?;
        Ok(sets.into_iter().next().flatten())
    }

    /// Number of the `ends` of an ensemble that are captured: by known attractors, or by those that
    /// a search finds from ends whose neighbours converge.
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
            let searched = search_periods(self.strobe, None);
            catalogue.search(self.strobe, &suspects, searched, self.control.flag())?;
        }
        let outcomes = outcomes(self.strobe, &catalogue.traps, TAKEN, ends, self.control.flag())?;
        Ok(outcomes.iter().filter(|o| o.fate != Fate::Open).count())
    }
}
