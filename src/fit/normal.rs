//! The normal equations, with the initial states of the windows eliminated.
//!
//! Each window adds `J' J` to the parameters' part, and brings a part `D` (2 by 2) for its initial
//! state and `C` that couples the two: the parameters alone obey
//! `R = sum J' J - C' D^-1 C`, `g = sum J' r - C' D^-1 d` (the Schur complement).

use nalgebra::{DMatrix, DVector, Matrix2, RowDVector, SymmetricEigen, Vector2};
use rayon::prelude::*;

use super::linear::{Linear, linearise};
use super::problem::{Columns, Problem, Shaped};
use super::window::Window;
use crate::integrate::State;

/// Directions whose information is this part of the greatest are not determined.
const BLIND: f64 = 1e-13;

/// What one window says.
#[derive(Clone, Debug)]
struct Block {
    /// The free parameters that it depends on.
    places: Vec<usize>,
    /// `J' J`.
    own: DMatrix<f64>,
    /// `C`: a row for the angle and one for the velocity.
    coupling: [RowDVector<f64>; 2],
    /// `D`.
    initial: Matrix2<f64>,
    /// `J' r`.
    pull: DVector<f64>,
    /// `d`.
    push: Vector2<f64>,
}

impl Block {
    fn new(linear: &Linear, places: Vec<usize>) -> Self {
        let (count, width) = (places.len(), linear.width);
        let mut all = vec![0.0; width * width];
        let mut right = vec![0.0; width];
        for (row, residual) in linear.rows.chunks_exact(width).zip(&linear.residuals) {
            for (i, a) in row.iter().enumerate() {
                right[i] += a * residual;
                for (sum, b) in all[i * width..].iter_mut().zip(&row[..=i]) {
                    *sum += a * b;
                }
            }
        }
        let at = |i: usize, j: usize| all[i.max(j) * width + i.min(j)];
        Self {
            places,
            own: DMatrix::from_fn(count, count, at),
            coupling: [0, 1].map(|k| RowDVector::from_fn(count, |_, j| at(count + k, j))),
            initial: Matrix2::from_fn(|i, j| at(count + i, count + j)),
            pull: DVector::from_column_slice(&right[..count]),
            push: Vector2::new(right[count], right[count + 1]),
        }
    }

    /// `D^-1` with the diagonal raised by the part `damping`; 0 in a direction that the window
    /// says nothing about, as while the pendulum is stuck.
    fn inverse(&self, damping: f64) -> Matrix2<f64> {
        let mut raised = self.initial;
        raised[(0, 0)] *= 1.0 + damping;
        raised[(1, 1)] *= 1.0 + damping;
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(raised);
        let limit = BLIND * eigenvalues.max();
        let mut inverse = Matrix2::zeros();
        for (value, direction) in eigenvalues.iter().zip(eigenvectors.column_iter()) {
            if *value > limit {
                inverse += direction * direction.transpose() / *value;
            }
        }
        inverse
    }

    fn coupling(&self) -> DMatrix<f64> {
        DMatrix::from_rows(&self.coupling)
    }
}

/// All windows at one point of the search.
#[derive(Clone, Debug)]
pub struct Normal {
    /// The sum of the squared residuals.
    pub chi2: f64,
    /// For each window the states at its samples.
    pub states: Vec<Vec<State>>,
    /// For each window the residuals over the standard errors.
    pub residuals: Vec<Vec<f64>>,
    blocks: Vec<Block>,
    count: usize,
}

/// A step of the parameters and of the initial states.
#[derive(Clone, Debug)]
pub struct Step {
    /// Of the free parameters.
    pub values: Vec<f64>,
    /// Of each window's initial state.
    pub starts: Vec<State>,
    /// By how much the sum of squares falls if all is linear.
    pub gain: f64,
}

impl Normal {
    /// The normal equations at `values`, with the windows' initial states; none where a value is out
    /// of its range or a motion leaves the range of numbers.
    #[must_use]
    pub fn at(problem: &Problem, values: &[f64], windows: &[Window]) -> Option<Self> {
        let of_record =
            |index: usize| Some((problem.shaped(index, values)?, problem.columns(index)));
        let records: Vec<(Shaped, Columns)> =
            (0..problem.records.len()).map(of_record).collect::<Option<_>>()?;
        let each = |window: &Window| {
            let (shaped, columns) = &records[window.record];
            let linear = linearise(problem, shaped, columns, window);
            let sound = linear.rows.iter().all(|slope| slope.is_finite());
            let (chi2, block) = (linear.chi2(), Block::new(&linear, columns.places().collect()));
            let Linear { states, residuals, .. } = linear;
            (sound && chi2.is_finite()).then_some((chi2, states, residuals, block))
        };
        // A thread costs more than a window of a few samples.
        let all: Option<Vec<_>> = match windows {
            [only] => Some(vec![each(only)?]),
            _ => windows.par_iter().map(each).collect(),
        };
        let all = all?;
        let count = problem.free.len();
        let mut normal = Self {
            chi2: 0.0,
            states: Vec::with_capacity(all.len()),
            residuals: Vec::with_capacity(all.len()),
            blocks: Vec::with_capacity(all.len()),
            count,
        };
        // In the order of the windows: a sum does not depend on threads.
        for (chi2, states, residuals, block) in all {
            normal.chi2 += chi2;
            normal.states.push(states);
            normal.residuals.push(residuals);
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
            let coupling = block.coupling();
            let through = coupling.transpose() * block.inverse(damping);
            let mut own = block.own.clone();
            for i in 0..own.nrows() {
                own[(i, i)] *= 1.0 + damping;
            }
            own -= &through * coupling;
            let right = &block.pull - through * block.push;
            for (i, a) in block.places.iter().enumerate() {
                pull[*a] += right[i];
                for (j, b) in block.places.iter().enumerate() {
                    information[(*a, *b)] += own[(i, j)];
                }
            }
        }
        (information, pull)
    }

    /// The step that the damped equations ask for, `held` parameters kept where they are.
    #[must_use]
    pub fn step(&self, damping: f64, held: &[usize]) -> Step {
        let (information, pull) = self.reduced(damping);
        let inverse = pseudo_inverse(&information, held);
        self.completed(&(inverse * pull), damping)
    }

    /// The same with the step of the parameters given: the initial states follow.
    #[must_use]
    pub fn completed(&self, values: &DVector<f64>, damping: f64) -> Step {
        let mut starts = Vec::with_capacity(self.blocks.len());
        // 2 x' b - x' A x with the equations as they are without damping.
        let mut gain = 0.0;
        for block in &self.blocks {
            let own =
                DVector::from_iterator(block.places.len(), block.places.iter().map(|p| values[*p]));
            let coupling = block.coupling();
            let coupled = Vector2::new((coupling.row(0) * &own)[0], (coupling.row(1) * &own)[0]);
            let start = block.inverse(damping) * (block.push - coupled);
            gain += 2.0 * (own.dot(&block.pull) + start.dot(&block.push))
                - own.dot(&(&block.own * &own))
                - 2.0 * start.dot(&coupled)
                - start.dot(&(block.initial * start));
            starts.push([start[0], start[1]]);
        }
        Step { values: values.iter().copied().collect(), starts, gain }
    }

    /// The covariance of the free parameters; infinite for those that nothing determines.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        let (information, _) = self.reduced(0.0);
        let mut covariance = pseudo_inverse(&information, &[]);
        // What a parameter can do without changing anything is what is missing in A^+ A.
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
        // Nothing is free but the states: a model is compared with a record.
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
