//! Which attractors exist over a plane of two parameters.
//!
//! From a coarse grid to the finest, each cell is searched from the same starts and from the
//! attractors of its neighbours on the coarser grids; then cells take over what their neighbours have and
//! they lack. A cell sees only what earlier passes have left, so nothing depends on the order in which threads
//! work.

use rayon::prelude::*;

use super::cell::{Cell, Search};
use super::control::{Control, pool};
use super::starts::Starts;
use crate::error::Error;
use crate::integrate::State;
use crate::lanes::Path;
use crate::model::Pendulum;

/// Cells between those of the coarsest grid.
const COARSEST: usize = 8;
/// Passes in which neighbours exchange their attractors.
const EXCHANGES: usize = 2;
/// Cells along each side whose step error is measured.
const MEASURED: usize = 5;
/// Starts of that measurement.
const PROBES: usize = 100;

/// A parameter and the values that it takes.
#[derive(Clone, Debug)]
pub struct Range {
    /// Its place in [`Pendulum::parameters`].
    pub index: usize,
    /// The values.
    pub values: Vec<f64>,
}

/// What to compute, and how well.
#[derive(Clone, Debug)]
pub struct Request {
    /// The parameters of columns and rows.
    pub axes: [Range; 2],
    /// Where the trajectories start.
    pub starts: Vec<State>,
    /// The 95th percentile of the error after five periods, on sampled cells.
    pub tol: f64,
    /// Periods after which a trajectory that nothing captures is watched for as long again; by default
    /// what damping asks for.
    pub bound: Option<u32>,
    /// Workers; 0 for one a processor.
    pub threads: usize,
}

/// The plane.
#[derive(Clone, Debug)]
pub struct ParameterMap {
    /// Rows of equal second parameter, the first value first.
    pub cells: Vec<Cell>,
    /// The greatest error on the sampled cells.
    pub reached_error: f64,
    /// Cells that were searched once more for what a neighbour has.
    pub searched_again: usize,
    /// The instruction set.
    pub path: Path,
}

/// A grid of pendulums.
struct Plane<'a> {
    base: &'a Pendulum,
    axes: &'a [Range; 2],
}

impl Plane<'_> {
    fn size(&self) -> [usize; 2] {
        [self.axes[0].values.len(), self.axes[1].values.len()]
    }

    fn pendulum(&self, cell: usize) -> Pendulum {
        let columns = self.size()[0];
        let mut pendulum = self.base.clone();
        let at = [cell % columns, cell / columns];
        for (axis, at) in self.axes.iter().zip(at) {
            pendulum.set_parameter(axis.index, axis.values[at]);
        }
        pendulum
    }

    /// Those cells at the distance `stride` in both directions, or in one, that exist.
    fn neighbours(&self, cell: usize, stride: usize, diagonal: bool) -> Vec<usize> {
        let [columns, rows] = self.size();
        let (i, j) = (cell % columns, cell / columns);
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
/// range, [`Error::Tolerance`] for a `tol` that no step reaches, [`Error::Interrupted`] if `control` was
/// cancelled.
pub fn parameter_map(
    base: &Pendulum,
    request: &Request,
    control: &Control,
) -> Result<ParameterMap, Error> {
    base.check_mappable()?;
    let plane = Plane { base, axes: &request.axes };
    let [columns, rows] = plane.size();
    let count = columns * rows;
    if count == 0 || request.starts.is_empty() {
        let name = if count == 0 { "cells" } else { "starts" };
        return Err(Error::Range { name, value: 0.0, allowed: "1 or more" });
    }
    let pool = pool(request.threads)?;
    let samples: Vec<Pendulum> = sampled(columns)
        .into_iter()
        .flat_map(|i| sampled(rows).into_iter().map(move |j| j * columns + i))
        .map(|cell| plane.pendulum(cell))
        .collect();
    let probes = Starts::List(request.starts.clone()).sampled_states(PROBES, 0);
    let (search, reached_error) = pool.install(|| {
        Search::calibrated(request.starts.clone(), request.bound, &samples, &probes, request.tol)
    })?;
    control.begin(count);
    let symmetric = |pendulum: &Pendulum| pendulum.is_mirror_symmetric();
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
                let pendulum = plane.pendulum(*cell);
                let around = plane.neighbours(*cell, stride, true);
                let others = around.iter().filter_map(|other| known[*other].as_ref());
                let hints = Cell::hints(others, symmetric(&pendulum));
                let cell = search.cell(&pendulum, &hints, control.flag());
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
    for _ in 0..EXCHANGES {
        let known = &cells;
        let again: Vec<(usize, Cell)> = pool.install(|| {
            let one = |cell: usize| {
                control.check()?;
                let pendulum = plane.pendulum(cell);
                let symmetric = symmetric(&pendulum);
                let around = plane.neighbours(cell, 1, false);
                let theirs = Cell::hints(around.iter().map(|c| &known[*c]), symmetric);
                let lacking = search.promising(&pendulum, &known[cell], theirs);
                if lacking.is_empty() {
                    return Ok(None);
                }
                let mut hints = Cell::hints(std::iter::once(&known[cell]), symmetric);
                hints.extend(lacking);
                Ok(Some((cell, search.cell(&pendulum, &hints, control.flag()))))
            };
            (0..count)
                .into_par_iter()
                .filter_map(|cell| one(cell).transpose())
                .collect::<Result<_, Error>>()
        })?;
        searched_again += again.len();
        for (cell, found) in again {
            cells[cell] = found;
        }
    }
    control.check()?;
    Ok(ParameterMap { cells, reached_error, searched_again, path: search.path })
}

/// Places spread over a side, its ends among them.
fn sampled(count: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..MEASURED).map(|k| k * (count - 1) / (MEASURED - 1)).collect();
    places.dedup();
    places
}
