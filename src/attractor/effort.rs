//! The budget of a search for attractors.

use serde::{Deserialize, Serialize};

use crate::integrate::Strobe;
use crate::orbit::PoincareMap;

/// The budget of a search for attractors: thorough for a single plane of starts, brisk for each of many
/// thousand pendulums.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Whether orbits are refined on the precise map, to rounding of the exact motion. Otherwise
    /// they are orbits of the integration steps, with the error of these.
    pub precise: bool,
    /// Longest cycle that is sought, in forcing periods.
    pub longest_cycle: usize,
    /// Periods before the first cycle test; each later round is twice as long as the preceding one.
    pub first_round: u32,
    /// Failures of Newton's method after which a round ends.
    pub tries: usize,
    /// Number of uncaptured trajectories that are observed.
    pub observed: usize,
    /// Number of uncaptured trajectories that are observed while no attractor is known.
    pub observed_alone: usize,
    /// Uncaptured trajectories are observed for this multiple of the first bound.
    pub observation: u32,
    /// Runs that a chaotic set requires; if fewer have reached it, more runs from its points must
    /// stay.
    pub proved: usize,
    /// Points of a set from which its exponent is measured.
    pub exponents: usize,
    /// Cells around the circle of a set's region: few enough for its points to fill the visited
    /// part.
    pub cells: usize,
    /// Extent of traps.
    pub trap: Sampling,
}

/// Sampling of the extent of an ellipse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sampling {
    /// Points of a cycle that get an ellipse: a trajectory passes each once a cycle.
    pub points: usize,
    /// Directions.
    pub rays: usize,
    /// Levels, each `ratio` of the preceding one in radius.
    pub levels: usize,
    /// Ratio of the radii of successive levels.
    pub ratio: f64,
    /// Number of further sets of as many levels if all preceding levels were too wide.
    pub rounds: usize,
    /// Number of returns within which a sample must become lower.
    pub returns: usize,
}

impl Effort {
    /// The map of which orbits are periodic points.
    #[must_use]
    pub fn map(&self, strobe: &Strobe) -> PoincareMap {
        if self.precise {
            PoincareMap::new(&strobe.pendulum)
        } else {
            PoincareMap::of_steps(strobe)
        }
    }

    /// The budget for a single pendulum.
    pub const THOROUGH: Self = Self {
        precise: true,
        longest_cycle: 32,
        first_round: 32,
        tries: 24,
        observed: 256,
        observed_alone: 256,
        observation: 4,
        proved: 16,
        exponents: 256,
        cells: 96,
        trap: Sampling { points: 8, rays: 64, levels: 54, ratio: 0.82, rounds: 2, returns: 4 },
    };
    /// The budget for a pendulum whose attractors are mostly known from a similar one: what else the starts reach
    /// is found as by a thorough search, but only from those that no trap captures within a long first round,
    /// and chaos that nothing could end is confirmed by fewer runs.
    pub const CONTINUED: Self = Self {
        first_round: 1024,
        observed_alone: 16,
        exponents: 16,
        trap: Sampling { levels: 14, rounds: 8, ..Self::THOROUGH.trap },
        ..Self::THOROUGH
    };
    /// The budget for one pendulum among thousands.
    pub const BRISK: Self = Self {
        precise: false,
        longest_cycle: 32,
        first_round: 24,
        tries: 6,
        observed: 24,
        observed_alone: 24,
        observation: 4,
        proved: 16,
        exponents: 16,
        cells: 24,
        trap: Sampling { points: 3, rays: 12, levels: 8, ratio: 0.5, rounds: 2, returns: 2 },
    };
}
