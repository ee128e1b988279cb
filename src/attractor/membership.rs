//! Assignment of uncaptured trajectories to attractors.

use std::sync::atomic::AtomicBool;

use super::capture::Traps;
use super::catalogue::Attractor;
use super::find::{Catalogue, Ending, REACH, open};
use super::long_runs::{Window, WindowPlan, long_runs};
use super::near_returns::{nearest_return, tracks};
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::orbit::newton::{self, PeriodicOrbit};

/// Number of stroboscopic points that determine the set of a trajectory.
const LAST_POINTS: usize = 64;

impl Catalogue {
    /// The index of the only chaotic attractor, if there is no other attractor.
    #[must_use]
    pub fn only_chaos(&self) -> Option<usize> {
        match self.attractors.as_slice() {
            [one] if one.kind.is_chaotic() => Some(0),
            _ => None,
        }
    }

    /// Whether some attractor is identified only by the region of its trajectories.
    #[must_use]
    pub fn has_chaos(&self) -> bool {
        self.attractors.iter().any(|a| a.kind.is_chaotic())
    }

    /// The least rate at which a deviation from an attractor shrinks, per unit of tau; `None` if no attractor has
    /// multipliers.
    #[must_use]
    pub fn slowest(&self) -> Option<f64> {
        let rate = |a: &Attractor| {
            let slow = a.multipliers.iter().map(|m| m.norm()).fold(0.0, f64::max);
            a.period.filter(|_| !a.multipliers.is_empty()).map(|period| -slow.ln() / period)
        };
        self.attractors.iter().filter_map(rate).min_by(f64::total_cmp)
    }

    /// The attractors of open trajectories, if Newton's method from a near return leads to a known
    /// orbit, or the region of a known set contains the last points.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn place(
        &self,
        strobe: &Strobe,
        states: &[State],
        cancel: &AtomicBool,
    ) -> Result<Vec<Option<usize>>, Error> {
        let map = self.effort.map(strobe);
        let longest = self.effort.longest_cycle;
        let own =
            |orbit: PeriodicOrbit| self.attractors.iter().position(|a| a.is_orbit(&orbit.points));
        let tracks = tracks(strobe, states, longest);
        let mut places = self.chaos_of(strobe, states, cancel)?;
        let nearest = |track: &Vec<State>| nearest_return(strobe.angle, track, longest);
        let (which, returns): (Vec<usize>, Vec<(State, usize)>) = tracks
            .iter()
            .enumerate()
            .filter_map(|(k, track)| nearest(track).map(|(_, start, n)| (k, (start, n))))
            .unzip();
        for (k, orbit) in which.into_iter().zip(newton::find_each(&map, &returns, REACH)) {
            places[k] = orbit.and_then(own).or(places[k]);
        }
        Ok(places)
    }

    /// Whether all starts are open and stay on chaotic attractors.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn holds_all(
        &self,
        strobe: &Strobe,
        endings: &[Ending],
        cancel: &AtomicBool,
    ) -> Result<bool, Error> {
        let open = open(endings);
        let all_open = open.len() == endings.len();
        Ok(all_open && self.chaos_of(strobe, &open, cancel)?.iter().all(Option::is_some))
    }

    /// The chaotic attractors of open trajectories, by their next stroboscopic points and the sense
    /// of their turns.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn chaos_of(
        &self,
        strobe: &Strobe,
        states: &[State],
        cancel: &AtomicBool,
    ) -> Result<Vec<Option<usize>>, Error> {
        if !self.has_chaos() {
            return Ok(vec![None; states.len()]);
        }
        let plan = WindowPlan { windows: 1, length: LAST_POINTS, side: self.effort.cells };
        let runs = long_runs(strobe, &Traps::default(), states, plan, cancel)?;
        let set = |window: &Window| {
            self.attractors.iter().position(|a| a.keeps(&window.points, window.senses))
        };
        Ok(runs.iter().map(|run| run.windows.last().and_then(set)).collect())
    }
}
