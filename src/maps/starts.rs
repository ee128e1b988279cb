//! Initial conditions of a map: the cells of a grid, or a list.

use crate::error::Error;
use crate::integrate::State;

/// Equal cells between two bounds, the value at each cell's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Number of cells.
    pub count: usize,
}

impl Axis {
    /// Checks that the bounds are finite and in order and that there is a cell.
    ///
    /// # Errors
    /// [`Error::Range`] naming what is wrong.
    pub fn new(name: &'static str, low: f64, high: f64, count: usize) -> Result<Self, Error> {
        if !(low.is_finite() && high.is_finite() && low < high) {
            let allowed = "two finite bounds, the lower one first";
            return Err(Error::Range {
                name,
                value: if low.is_finite() { high } else { low },
                allowed,
            });
        }
        if count == 0 || count > 100_000 {
            return Err(Error::Range { name, value: count as f64, allowed: "1 to 100000 cells" });
        }
        Ok(Self { low, high, count })
    }

    /// The centre of cell `i`.
    #[must_use]
    pub fn centre(&self, i: usize) -> f64 {
        self.between(i as f64)
    }

    /// The value `cells` cells after the centre of the first one.
    #[must_use]
    pub fn between(&self, cells: f64) -> f64 {
        self.low + (cells + 0.5) * (self.high - self.low) / self.count as f64
    }

    /// Whether a value lies between the bounds.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// Initial conditions of the trajectories of a map.
#[derive(Clone, Debug)]
pub enum Starts {
    /// Every cell of a grid, rows of equal velocity, the lowest first.
    Grid {
        /// Angles, rad.
        theta: Axis,
        /// Velocities.
        velocity: Axis,
    },
    /// These states.
    List(Vec<State>),
}

impl Starts {
    /// Number of starts.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Grid { theta, velocity } => theta.count * velocity.count,
            Self::List(states) => states.len(),
        }
    }

    /// Whether it is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Start number `index`.
    #[must_use]
    pub fn get(&self, index: usize) -> State {
        match self {
            Self::Grid { theta, velocity } => {
                [theta.centre(index % theta.count), velocity.centre(index / theta.count)]
            }
            Self::List(states) => states[index],
        }
    }

    /// Indices of about `count` starts spread evenly over all, in a fixed order that `seed` shifts.
    ///
    /// On a grid an additive recurrence with the plastic number covers the plane without the rows
    /// and columns that every k-th cell would give.
    #[must_use]
    pub fn sample(&self, count: usize, seed: u64) -> Vec<usize> {
        const PLASTIC: f64 = 1.324_717_957_244_746;
        if self.len() <= count {
            return (0..self.len()).collect();
        }
        let offset = (seed as f64 * 0.618_033_988_749_895).fract();
        let at = |k: usize, ratio: f64| (offset + 0.5 + k as f64 * ratio).fract();
        (0..count)
            .map(|k| match self {
                Self::Grid { theta, velocity } => {
                    let i = (at(k, 1.0 / PLASTIC) * theta.count as f64) as usize;
                    let j = (at(k, 1.0 / (PLASTIC * PLASTIC)) * velocity.count as f64) as usize;
                    j.min(velocity.count - 1) * theta.count + i.min(theta.count - 1)
                }
                Self::List(states) => (at(k, 0.618_033_988_749_895) * states.len() as f64) as usize,
            })
            .collect()
    }

    /// The states of [`Starts::sample`].
    #[must_use]
    pub fn sampled_states(&self, count: usize, seed: u64) -> Vec<State> {
        self.sample(count, seed).into_iter().map(|i| self.get(i)).collect()
    }
}
