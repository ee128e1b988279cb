//! The attractors over a plane of two parameters.
//!
//! From a coarse grid to the finest, each cell is searched from a few starts, different from the
//! next one's, and from the attractors of its neighbours on the coarser grids; then cells are
//! searched from attractors of neighbours that they lack. A cell uses only results of earlier
//! passes, so nothing depends on the order of the threads.

use rayon::prelude::*;

use super::cell::{Cell, Search};
use super::control::{Control, pool};
use super::resolution::Resolution;
use super::starts::Starts;
use crate::error::Error;
use crate::integrate::State;
use crate::lanes::InstructionSet;
use crate::memory;
use crate::model::Pendulum;

/// Spacing of the coarsest grid, in cells.
const COARSEST: usize = 8;
/// Distances over which cells exchange their attractors in successive passes: a result of one cell
/// reaches all that can have it.
const EXCHANGES: [usize; 3] = [8, 4, 2];
/// Largest number of passes between next neighbours; they end if no cell has gained an attractor.
const MOST_PASSES: usize = 64;
/// Memory of a cell, bytes: its attractors, and their arrays.
const EACH: usize = 4096;
/// Memory of each stored point of a non-periodic attractor, bytes.
const ROOM: usize = 64;
/// Starts of that measurement.
const PROBES: usize = 100;

/// A parameter and the values that it takes.
#[derive(Clone, Debug)]
pub struct Range {
    /// Its index in [`Pendulum::parameters`].
    pub index: usize,
    /// The values.
    pub values: Vec<f64>,
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
        [self.axes[0].values.len(), self.axes[1].values.len()]
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

    /// The pendulum of a cell.
    #[must_use]
    pub fn pendulum(&self, cell: usize) -> Pendulum {
        let mut pendulum = self.base.clone();
        for (axis, at) in self.axes.iter().zip(self.place(cell)) {
            pendulum.set_parameter(axis.index, axis.values[at]);
        }
        pendulum
    }

    /// The existing cells at the distance `stride` in both directions, or in one.
    fn neighbours(&self, cell: usize, stride: usize, diagonal: bool) -> Vec<usize> {
        let [columns, rows] = self.size();
        let [i, j] = self.place(cell);
        let mut found = Vec::with_capacity(8);
        for b in [j.checked_sub(stride), Some(j), Some(j + stride)] {
            for a in [i.checked_sub(stride), Some(i), Some(i + stride)] {
                let (Some(a), Some(b)) = (a, b) else { continue };
                let own = a == i && b == j;
                if !own && a < columns && b < rows && (diagonal || a == i || b == j) {
                    found.push(b * columns + a);
                }
            }
        }
        found
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
    let plane = Plane { base, axes: &request.axes };
    let [columns, rows] = plane.size();
    let count = columns * rows;
    if count == 0 || request.starts.is_empty() || request.each == 0 {
        let name = if count == 0 { "cells" } else { "starts" };
        return Err(Error::Range { name, value: 0.0, allowed: "1 or more" });
    }
    memory::reckon("cells", count, EACH + ROOM * request.kept)?;
    (0..count).try_for_each(|cell| plane.pendulum(cell).check_mappable())?;
    let pool = pool(request.threads)?;
    let probes = Starts::List(request.starts.clone()).sampled_states(PROBES, 0);
    let simd = InstructionSet::choose()?;
    let resolution = pool.install(|| Resolution::new(&plane, &probes, request.tol, simd))?;
    let &Request { each, bound, kept, .. } = request;
    let search = Search { starts: request.starts.clone(), each, bound, kept };
    let strobe = |cell: usize| resolution.strobe(&plane.pendulum(cell), plane.place(cell));
    control.begin(count);
    let mut cells: Vec<Option<Cell>> = vec![None; count];
    let mut stride = COARSEST;
    while stride > 0 {
        let on_grid = |cell: usize| {
            (cell % columns).is_multiple_of(stride) && (cell / columns).is_multiple_of(stride)
        };
        let wanted: Vec<usize> =
            (0..count).filter(|cell| on_grid(*cell) && cells[*cell].is_none()).collect();
        let known = &cells;
        let found: Vec<Cell> = pool.install(|| {
            let one = |cell: &usize| {
                control.check()?;
                let strobe = strobe(*cell);
                let around = plane.neighbours(*cell, stride, true);
                let others = around.iter().filter_map(|other| known[*other].as_ref());
                let hints = Cell::hints(others, strobe.pendulum.is_mirror_symmetric());
                let cell = search.cell(*cell, &strobe, &hints, control.flag());
                control.add(1);
                Ok(cell)
            };
            wanted.par_iter().map(one).collect::<Result<_, Error>>()
        })?;
        for (cell, found) in wanted.into_iter().zip(found) {
            cells[cell] = Some(found);
        }
        stride /= 2;
    }
    let mut cells: Vec<Cell> = cells.into_iter().flatten().collect();
    let mut searched_again = 0;
    let mut gained = vec![true; count];
    for stride in EXCHANGES.into_iter().chain([1; MOST_PASSES]) {
        let known = &cells;
        let gains = &gained;
        let again: Vec<(usize, Cell)> = pool.install(|| {
            let one = |cell: usize| {
                control.check()?;
                let strobe = strobe(cell);
                let symmetric = strobe.pendulum.is_mirror_symmetric();
                let around = plane.neighbours(cell, stride, false);
                if !around.iter().any(|other| gains[*other]) {
                    return Ok(None);
                }
                let theirs = Cell::hints(around.iter().map(|c| &known[*c]), symmetric);
                let lacking = search.promising(&strobe, &known[cell], theirs, stride == 1);
                if lacking.is_empty() {
                    return Ok(None);
                }
                let mut hints = Cell::hints(std::iter::once(&known[cell]), symmetric);
                hints.extend(lacking);
                Ok(Some((cell, search.cell(cell, &strobe, &hints, control.flag()))))
            };
            (0..count)
                .into_par_iter()
                .filter_map(|cell| one(cell).transpose())
                .collect::<Result<_, Error>>()
        })?;
        searched_again += again.len();
        // The first pass between next neighbours includes all of them.
        gained.fill(stride > 1);
        for (cell, found) in again {
            let symmetric = plane.pendulum(cell).is_mirror_symmetric();
            gained[cell] |= found.has_more_than(&cells[cell], symmetric);
            cells[cell] = found;
        }
        if !gained.contains(&true) {
            break;
        }
    }
    control.check()?;
    Ok(ParameterMap { cells, searched_again, resolution })
}
