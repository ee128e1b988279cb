//! The equations of all windows, with their initial states eliminated.
//!
//! A window's derivatives by its initial state, by the parameters, and its residuals are columns
//! `[S J r]` that an orthogonal transformation makes triangular (Householder). The first two rows
//! then determine the initial state, the others are equations of the parameters alone: their `J~'
//! J~` is `R = J' J - C' D^-1 C` of the normal equations (the Schur complement, `C = S' J`, `D = S'
//! S`), without the cancellation in the difference if motions are chaotic.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use super::block::{Block, STATE};
use super::linear::{Linear, linearise};
use super::problem::{Columns, Problem, Shaped};
use super::window::Window;
use crate::integrate::State;

/// A direction whose information is this part of the greatest is not determined.
const BLIND: f64 = 1e-13;

/// All windows at `values` with their derivatives; none where a value is out of its range or a motion
/// leaves the range of numbers.
#[must_use]
pub fn linearised(problem: &Problem, values: &[f64], windows: &[Window]) -> Option<Vec<Linear>> {
    over(problem, values, windows, |linear, _| linear)
}

/// The results of `make` for all windows, in their order.
fn over<T: Send>(
    problem: &Problem,
    values: &[f64],
    windows: &[Window],
    make: impl Fn(Linear, &Columns) -> T + Sync,
) -> Option<Vec<T>> {
    // Of the records that the windows are of.
    let mut records: Vec<Option<(Shaped, Columns)>> = vec![None; problem.records.len()];
    for window in windows {
        if records[window.record].is_none() {
            let shaped = problem.shaped(window.record, values)?;
            records[window.record] = Some((shaped, problem.columns(window.record)));
        }
    }
    let each = |window: &Window| {
        let (shaped, columns) = records[window.record].as_ref()?;
        let linear = linearise(problem, shaped, columns, window);
        let sound = linear.rows.iter().all(|slope| slope.is_finite());
        (sound && linear.chi2.is_finite()).then(|| make(linear, columns))
    };
    // A thread costs more than a window of a few samples.
    match windows {
        [only] => Some(vec![each(only)?]),
        _ => windows.par_iter().map(each).collect(),
    }
}

/// All windows at one point of the search.
#[derive(Clone, Debug)]
pub struct Normal {
    /// The sum of the squared residuals, or of the deviances of readings rounded to counts.
    pub chi2: f64,
    /// The part of each window in it.
    pub parts: Vec<f64>,
    /// For each window the states at its samples.
    pub states: Vec<Vec<State>>,
    /// The residuals of each window over the standard errors.
    pub residuals: Vec<Vec<f64>>,
    /// Reading less model for each window.
    pub apart: Vec<Vec<f64>>,
    /// For each window what [`Linear::white`] makes of the residuals.
    pub white: Vec<Vec<f64>>,
    blocks: Vec<Block>,
    count: usize,
}

/// A step of the parameters and of the initial states.
#[derive(Clone, Debug)]
pub struct Step {
    /// The steps of the free parameters.
    pub values: Vec<f64>,
    /// The steps of the initial states of all windows.
    pub starts: Vec<State>,
    /// The predicted decrease of the sum of squares by the linear model.
    pub gain: f64,
    /// The contribution of each window to it.
    pub gains: Vec<f64>,
}

impl Normal {
    /// Puts the equations of one window, found by themselves, in the place of window `index`.
    pub fn replace(&mut self, index: usize, mut only: Self) {
        self.parts[index] = only.chi2;
        self.states[index] = only.states.swap_remove(0);
        self.residuals[index] = only.residuals.swap_remove(0);
        self.apart[index] = only.apart.swap_remove(0);
        self.white[index] = only.white.swap_remove(0);
        self.blocks[index] = only.blocks.swap_remove(0);
        self.chi2 = self.parts.iter().sum();
    }

    /// The normal equations at `values`, with the windows' initial states; none where a value is out
    /// of its range or a motion leaves the range of numbers.
    #[must_use]
    pub fn at(problem: &Problem, values: &[f64], windows: &[Window]) -> Option<Self> {
        let each = |linear: Linear, columns: &Columns| {
            let block = Block::new(&linear, columns.places().collect());
            let white = linear.white();
            (linear.chi2, linear.states, [linear.residuals, linear.apart, white], block)
        };
        let all = over(problem, values, windows, each)?;
        let count = problem.free.len();
        let mut normal = Self {
            chi2: 0.0,
            parts: Vec::with_capacity(all.len()),
            states: Vec::with_capacity(all.len()),
            residuals: Vec::with_capacity(all.len()),
            apart: Vec::with_capacity(all.len()),
            white: Vec::with_capacity(all.len()),
            blocks: Vec::with_capacity(all.len()),
            count,
        };
        // In the order of the windows: a sum does not depend on threads.
        for (chi2, states, [residuals, apart, white], block) in all {
            normal.chi2 += chi2;
            normal.parts.push(chi2);
            normal.states.push(states);
            normal.residuals.push(residuals);
            normal.apart.push(apart);
            normal.white.push(white);
            normal.blocks.push(block);
        }
        Some(normal)
    }

    /// `R` and `g`: the information about the free parameters alone, and the pull on them. With
    /// `damping` every diagonal is raised by that part before.
    #[must_use]
    pub fn reduced(&self, damping: f64) -> (DMatrix<f64>, DVector<f64>) {
        let mut information = DMatrix::zeros(self.count, self.count);
        let mut pull = DVector::zeros(self.count);
        for block in &self.blocks {
            let triangle = block.damped(damping);
            let count = block.places.len();
            let blind = Block::blind(&triangle);
            for (row, line) in triangle.row_iter().enumerate() {
                if row < STATE && !blind[row] {
                    continue;
                }
                for (i, a) in block.places.iter().enumerate() {
                    let slope = line[STATE + i];
                    pull[*a] += slope * line[STATE + count];
                    for (j, b) in block.places.iter().enumerate() {
                        information[(*a, *b)] += slope * line[STATE + j];
                    }
                }
            }
        }
        (information, pull)
    }

    /// The step that solves the damped equations, with the parameters `held` fixed.
    #[must_use]
    pub fn step(&self, damping: f64, held: &[usize]) -> Step {
        self.step_between(damping, held, &[])
    }

    /// The step with the parameters kept between `ends`: one that would lead beyond its end leads to the
    /// end, and the others follow. A step cut short as a whole would creep along there.
    #[must_use]
    pub fn step_between(&self, damping: f64, held: &[usize], ends: &[[f64; 2]]) -> Step {
        let (information, pull) = self.reduced(damping);
        let mut fixed = held.to_vec();
        let mut known = DVector::zeros(self.count);
        loop {
            let rest = &pull - &information * &known;
            let values = pseudo_inverse(&information, &fixed) * rest + &known;
            let beyond = |k: &usize| {
                let outside =
                    ends.get(*k).is_some_and(|[low, high]| values[*k] < *low || values[*k] > *high);
                outside && !fixed.contains(k)
            };
            let found: Vec<usize> = (0..self.count).filter(beyond).collect();
            if found.is_empty() {
                return self.completed(&values, damping);
            }
            for k in found {
                known[k] = values[k].clamp(ends[k][0], ends[k][1]);
                fixed.push(k);
            }
        }
    }

    /// The step with that of the parameters given: the initial states are adapted.
    #[must_use]
    pub fn completed(&self, values: &DVector<f64>, damping: f64) -> Step {
        let mut starts = Vec::with_capacity(self.blocks.len());
        let mut gains = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let triangle = block.damped(damping);
            let blind = Block::blind(&triangle);
            let last = triangle.ncols() - 1;
            // The whole step of this window, initial state first.
            let mut step = DVector::zeros(last);
            for (k, place) in block.places.iter().enumerate() {
                step[STATE + k] = values[*place];
            }
            for k in (0..STATE).rev() {
                if !blind[k] {
                    let known: f64 = (k + 1..last).map(|j| triangle[(k, j)] * step[j]).sum();
                    step[k] = (triangle[(k, last)] - known) / triangle[(k, k)];
                }
            }
            // |r|^2 - |r - A x|^2 with the equations as they are without damping.
            let moved = block.triangle.columns(0, last) * &step;
            gains.push(moved.dot(&(block.triangle.column(last) * 2.0 - &moved)));
            starts.push([step[0], step[1]]);
        }
        let gain = gains.iter().sum();
        Step { values: values.iter().copied().collect(), starts, gain, gains }
    }

    /// The covariance of the free parameters; infinite for undetermined ones.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        let (information, _) = self.reduced(0.0);
        let mut covariance = pseudo_inverse(&information, &[]);
        // Directions that change nothing are those missing in A^+ A.
        let seen = &covariance * &information;
        for i in 0..self.count {
            if seen[(i, i)] < 0.99 {
                covariance[(i, i)] = f64::INFINITY;
            }
        }
        covariance
    }
}

/// The inverse of a positive matrix on the directions that it determines, scaled to a unit diagonal
/// first; 0 in the rows and columns `held`.
#[must_use]
pub fn pseudo_inverse(matrix: &DMatrix<f64>, held: &[usize]) -> DMatrix<f64> {
    let count = matrix.nrows();
    if count == 0 {
        // Only the states are free: a model is compared with a record.
        return matrix.clone();
    }
    let scale: Vec<f64> = (0..count)
        .map(|i| {
            let size = matrix[(i, i)];
            if size > 0.0 && !held.contains(&i) { 1.0 / size.sqrt() } else { 0.0 }
        })
        .collect();
    let scaled = DMatrix::from_fn(count, count, |i, j| scale[i] * matrix[(i, j)] * scale[j]);
    let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(scaled);
    let mut inverse = DMatrix::zeros(count, count);
    for (value, direction) in eigenvalues.iter().zip(eigenvectors.column_iter()) {
        if *value > BLIND {
            inverse += direction * direction.transpose() / *value;
        }
    }
    DMatrix::from_fn(count, count, |i, j| scale[i] * inverse[(i, j)] * scale[j])
}
