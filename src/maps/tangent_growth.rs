//! Growth of tangents along many trajectories, on all threads, window by window.

use rayon::prelude::*;

use super::control::Control;
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::memory;

/// Trajectories per task.
const BLOCK: usize = 32;

/// Trajectories with a tangent each.
#[derive(Clone, Debug)]
pub struct Bundle {
    theta: Vec<f64>,
    velocity: Vec<f64>,
    turns: Vec<f64>,
    tangents: (Vec<f64>, Vec<f64>),
}

impl Bundle {
    /// The bundle at these states, every tangent along `(1, 1)/sqrt 2`.
    #[must_use]
    pub fn new(states: &[State]) -> Self {
        let part = vec![std::f64::consts::FRAC_1_SQRT_2; states.len()];
        Self {
            theta: states.iter().map(|s| s[0]).collect(),
            velocity: states.iter().map(|s| s[1]).collect(),
            turns: vec![0.0; states.len()],
            tangents: (part.clone(), part),
        }
    }

    /// Number of trajectories.
    #[must_use]
    pub fn len(&self) -> usize {
        self.theta.len()
    }

    /// Whether it is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.theta.is_empty()
    }

    /// The present states, angles in [-pi, pi].
    #[must_use]
    pub fn states(&self) -> Vec<State> {
        self.theta.iter().zip(&self.velocity).map(|(a, b)| [*a, *b]).collect()
    }

    /// Advances `windows` times by `window` periods; returns the natural logarithms of the growth
    /// factors of the tangents, one row of windows for each trajectory.
    ///
    /// Adds the trajectories to `control` when they are done.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `control` was cancelled.
    pub fn grow(
        &mut self,
        strobe: &Strobe,
        windows: usize,
        window: usize,
        pool: &rayon::ThreadPool,
        control: &Control,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let parts = self
            .theta
            .par_chunks_mut(BLOCK)
            .zip(self.velocity.par_chunks_mut(BLOCK))
            .zip(self.turns.par_chunks_mut(BLOCK))
            .zip(self.tangents.0.par_chunks_mut(BLOCK))
            .zip(self.tangents.1.par_chunks_mut(BLOCK));
        let rows: Result<Vec<Vec<Vec<f64>>>, Error> = pool.install(|| {
            parts
                .map(|((((theta, velocity), turns), across), along)| {
                    let count = theta.len();
                    let mut rows = vec![Vec::with_capacity(windows); count];
                    for _ in 0..windows {
                        control.check()?;
                        let mut growth = vec![0.0; count];
                        let states = (&mut *theta, &mut *velocity);
                        let tangents = (&mut *across, &mut *along);
                        strobe.stretch(states, turns, tangents, &mut growth, window)?;
                        for (row, gain) in rows.iter_mut().zip(growth) {
                            row.push(gain);
                        }
                    }
                    control.add(count);
                    Ok(rows)
                })
                .collect()
        });
        Ok(rows?.into_iter().flatten().collect())
    }
}

/// One trajectory with its tangent, period by period from its start.
#[derive(Clone, Debug)]
pub struct TangentTrajectory {
    bundle: Bundle,
    /// Logarithm of the growth of its tangent in each period.
    pub growth: Vec<f64>,
    /// The state after each period, the start first; angles in [-pi, pi].
    pub states: Vec<State>,
}

impl TangentTrajectory {
    /// The trajectory from this start.
    #[must_use]
    pub fn new(start: State) -> Self {
        Self { bundle: Bundle::new(&[start]), growth: Vec::new(), states: vec![start] }
    }

    /// Advances until `periods` after the start.
    ///
    /// # Errors
    /// Those of [`Bundle::grow`].
    pub fn extend(
        &mut self,
        strobe: &Strobe,
        periods: usize,
        pool: &rayon::ThreadPool,
        control: &Control,
    ) -> Result<(), Error> {
        while self.growth.len() < periods {
            let rows = self.bundle.grow(strobe, 1, 1, pool, control)?;
            memory::room("periods", &mut self.growth, 1)?;
            memory::room("periods", &mut self.states, 1)?;
            self.growth.extend(rows.into_iter().flatten());
            self.states.extend(self.bundle.states());
        }
        Ok(())
    }
}
