//! The attractors over a plane of two parameters: all blocks of a [`Survey`] in one process.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::cell::Cell;
use super::control::{Control, Spread, pool};
use super::resolution::Resolution;
use super::survey::{Block, Survey};
use crate::error::Error;
use crate::integrate::State;
use crate::model::{Parameter, Pendulum};

/// Places along a curve in the space of the parameters.
#[derive(Clone, Debug, Default)]
pub struct Range {
    /// Each with its value at every place; without any there is one place, the pendulum itself.
    pub parameters: Vec<(Parameter, Vec<f64>)>,
}

impl Range {
    /// One parameter and the values that it takes.
    #[must_use]
    pub fn of(parameter: Parameter, values: Vec<f64>) -> Self {
        Self { parameters: vec![(parameter, values)] }
    }

    /// The number of places.
    #[must_use]
    pub fn places(&self) -> usize {
        self.parameters.first().map_or(1, |(_, values)| values.len())
    }
}

/// A request and its numerical choices.
#[derive(Clone, Debug)]
pub struct Request {
    /// The parameters of columns and rows.
    pub axes: [Range; 2],
    /// Initial conditions: cells take different ones, so that they complement one another.
    pub starts: Vec<State>,
    /// Number of starts of each cell, in turn.
    pub each: usize,
    /// The 95th percentile of the error after five periods, on sampled cells.
    pub tol: f64,
    /// Periods after which an uncaptured trajectory is observed for as long again; by default from
    /// the damping.
    pub bound: Option<u32>,
    /// Number of points stored of a non-periodic attractor.
    pub kept: usize,
    /// Workers; 0 for one a processor.
    pub threads: usize,
}

/// The plane.
#[derive(Clone, Debug)]
pub struct ParameterMap {
    /// Rows of equal second parameter, the first value first.
    pub cells: Vec<Cell>,
    /// Cells that were searched again for attractors of a neighbour.
    pub searched_again: usize,
    /// The step lengths.
    pub resolution: Resolution,
}

/// A grid of pendulums.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'a> {
    /// The parameters that do not vary.
    pub base: &'a Pendulum,
    /// Columns and rows.
    pub axes: &'a [Range; 2],
}

impl Plane<'_> {
    /// Numbers of columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.axes[0].places(), self.axes[1].places()]
    }

    /// Column and row of a cell.
    #[must_use]
    pub fn place(&self, cell: usize) -> [usize; 2] {
        let columns = self.size()[0];
        [cell % columns, cell / columns]
    }

    /// The cell at a column and row.
    #[must_use]
    pub fn cell(&self, column: usize, row: usize) -> usize {
        row * self.size()[0] + column
    }

    /// The pendulum of a cell; a parameter of both axes is the product of its values.
    #[must_use]
    pub fn pendulum(&self, cell: usize) -> Pendulum {
        let mut pendulum = self.base.clone();
        let [i, j] = self.place(cell);
        let [columns, rows] = self.axes;
        for (parameter, values) in &columns.parameters {
            pendulum.set(*parameter, values[i]);
        }
        for (parameter, values) in &rows.parameters {
            let other = columns.parameters.iter().find(|(known, _)| known == parameter);
            let factor = other.map_or(1.0, |(_, values)| values[i]);
            pendulum.set(*parameter, factor * values[j]);
        }
        pendulum
    }

    /// The existing cells at the distance `stride` in one direction, then, if `diagonal`, in both: nearest
    /// first.
    pub(super) fn neighbours(&self, cell: usize, stride: usize, diagonal: bool) -> Vec<usize> {
        let [columns, rows] = self.size();
        let [i, j] = self.place(cell);
        let mut found: [Vec<usize>; 2] = [Vec::with_capacity(8), Vec::with_capacity(4)];
        for b in [j.checked_sub(stride), Some(j), Some(j + stride)] {
            for a in [i.checked_sub(stride), Some(i), Some(i + stride)] {
                let (Some(a), Some(b)) = (a, b) else { continue };
                let own = a == i && b == j;
                if !own && a < columns && b < rows {
                    found[usize::from(a != i && b != j)].push(b * columns + a);
                }
            }
        }
        let [mut nearest, far] = found;
        nearest.extend(if diagonal { far } else { Vec::new() });
        nearest
    }
}

/// The attractors of every pendulum of a plane.
///
/// # Errors
/// [`Error::NotMappable`] for effects that a map cannot have, [`Error::Range`] for a value outside its
/// range, [`Error::Memory`] for too many cells, [`Error::Tolerance`] for a `tol` that no step reaches, [`Error::Interrupted`] if `control` was
/// cancelled.
pub fn parameter_map(
    base: &Pendulum,
    request: &Request,
    control: &Control,
) -> Result<ParameterMap, Error> {
    let pool = pool(request.threads)?;
    pool.install(|| {
        let survey = Survey::new(base, request)?;
        control.begin(survey.plane().size().iter().product());
        let all = 0..survey.blocks();
        let order = Spread::of(survey.blocks());
        let search = |k| Ok((order.part(k), survey.search(order.part(k), control)?));
        let found = all.clone().into_par_iter().map(search);
        let found: BTreeMap<usize, Block> = found.collect::<Result<_, Error>>()?;
        let mut blocks: Vec<Block> = found.into_values().collect();
        for pass in 1..=survey.passes() {
            let known = &blocks;
            let exchange = |block| survey.exchange(pass, block, |other| &known[other], control);
            let new: Vec<Option<Block>> =
                all.clone().into_par_iter().map(exchange).collect::<Result<_, Error>>()?;
            for (block, new) in blocks.iter_mut().zip(new) {
                if let Some(new) = new {
                    *block = new;
                }
            }
            if !blocks.iter().any(|block| block.gained(pass)) {
                break;
            }
        }
        survey.result(&blocks)
    })
}
