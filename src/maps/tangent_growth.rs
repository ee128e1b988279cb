//! Growth of tangents along many trajectories, on all threads, window by window.

use std::f64::consts::FRAC_1_SQRT_2;

use rayon::prelude::*;

use super::control::Control;
use crate::error::Error;
use crate::integrate::{State, Strobe, TangentStates};
use crate::memory;

/// Trajectories per task.
const BLOCK: usize = 32;

/// Trajectories with a tangent each, in blocks of one task.
#[derive(Clone, Debug)]
pub struct Bundle {
    blocks: Vec<TangentStates>,
}

impl Bundle {
    /// The bundle at these states, every tangent along `(1, 1)/sqrt 2`.
    #[must_use]
    pub fn new(states: &[State]) -> Self {
        let block = |states: &[State]| TangentStates::along(states, [FRAC_1_SQRT_2; 2]);
        Self { blocks: states.chunks(BLOCK).map(block).collect() }
    }

    /// The present states, angles in [-pi, pi].
    #[must_use]
    pub fn states(&self) -> Vec<State> {
        self.blocks.iter().flat_map(|block| block.states().iter()).collect()
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
        let rows = |block: &mut TangentStates| {
            let count = block.states().len();
            let mut rows = vec![Vec::with_capacity(windows); count];
            for _ in 0..windows {
                control.check()?;
                block.reset_growth();
                strobe.stretch(block, window);
                for (row, gain) in rows.iter_mut().zip(block.growth()) {
                    row.push(*gain);
                }
            }
            control.add(count);
            Ok(rows)
        };
        let blocks = self.blocks.par_iter_mut();
        let all: Vec<Vec<Vec<f64>>> =
            pool.install(|| blocks.map(rows).collect::<Result<_, Error>>())?;
        Ok(all.into_iter().flatten().collect())
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
