//! The attractors over a plane, block by block: each can be computed on another machine.
//!
//! Blocks of 16 by 16 cells are searched on their own. Within one, from a coarse grid to the finest, each
//! cell is searched from a few starts, different from the next one's, and from the attractors of its
//! neighbours on the coarser grids. Then, pass by pass over the whole plane, cells are searched from
//! attractors of neighbours that they lack. A pass uses only results of the one before, and a block those
//! of the blocks beside it: nothing depends on the order of the blocks, or on who computes which.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::cell::{Cell, Search};
use super::control::Control;
use super::parameter_map::{ParameterMap, Plane, Request};
use super::resolution::Resolution;
use super::starts::Starts;
use super::stored::{from_bytes, to_bytes};
use crate::error::Error;
use crate::integrate::Strobe;
use crate::lanes::InstructionSet;
use crate::memory;
use crate::model::Pendulum;

/// Cells along a side of a block: twice the distance over which cells exchange attractors.
pub const SIDE: usize = 16;
/// Spacing of the coarsest grid of a block, in cells.
const COARSEST: usize = 8;
/// Distances over which cells exchange their attractors in successive passes, then 1, there also diagonally: a
/// result of one cell reaches all that can have it.
const EXCHANGES: [usize; 3] = [8, 4, 2];
/// Largest number of passes between next neighbours; they end if no cell has gained an attractor.
const MOST_PASSES: usize = 64;
/// Memory of a cell, bytes: its attractors, and their arrays.
const EACH: usize = 4096;
/// Memory of each stored point of a non-periodic attractor, and of the end of each start, bytes.
const ROOM: usize = 64;
/// Starts at which steps are measured.
const PROBES: usize = 100;

/// A plane of pendulums, and how they are searched.
#[derive(Clone, Debug)]
pub struct Survey {
    base: Pendulum,
    request: Request,
    search: Search,
    /// The step lengths.
    pub resolution: Resolution,
}

/// The results in one block.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Block {
    /// Rows of equal second parameter, the first value first.
    pub cells: Vec<Cell>,
    /// The pass in which each cell last gained an attractor; 0 is the search.
    gained: Vec<usize>,
    /// Searches of its cells in exchanges.
    searched_again: usize,
}

impl Survey {
    /// The survey of a request, its steps measured on the threads of the current pool.
    ///
    /// # Errors
    /// Those of [`super::parameter_map::parameter_map`].
    pub fn new(base: &Pendulum, request: &Request) -> Result<Self, Error> {
        Self::with(base, request, |plane, simd| {
            let probes = Starts::List(request.starts.clone()).sampled_states(PROBES, 0);
            Resolution::new(plane, &probes, request.tol, simd)
        })
    }

    /// The survey of a request whose steps another one has measured: `state` is its [`Survey::state`].
    ///
    /// # Errors
    /// Those of [`Survey::new`], and [`Error::Stored`] for other bytes.
    pub fn restored(base: &Pendulum, request: &Request, state: &[u8]) -> Result<Self, Error> {
        Self::with(base, request, |plane, simd| {
            let stored: Resolution = from_bytes("state", state)?;
            stored.restored(plane, simd).ok_or(Error::Stored { what: "state" })
        })
    }

    fn with(
        base: &Pendulum,
        request: &Request,
        resolution: impl FnOnce(&Plane, InstructionSet) -> Result<Resolution, Error>,
    ) -> Result<Self, Error> {
        let plane = Plane { base, axes: &request.axes };
        let count = plane.size().iter().product();
        if count == 0 || request.starts.is_empty() || request.each == 0 {
            let name = if count == 0 { "cells" } else { "starts" };
            return Err(Error::Range { name, value: 0.0, allowed: "1 or more" });
        }
        memory::reckon("cells", count, EACH + ROOM * (request.kept + request.each))?;
        (0..count).try_for_each(|cell| plane.pendulum(cell).check_mappable())?;
        let resolution = resolution(&plane, InstructionSet::choose()?)?;
        let &Request { each, bound, kept, .. } = request;
        let search = Search { starts: request.starts.clone(), each, bound, kept };
        Ok(Self { base: base.clone(), request: request.clone(), search, resolution })
    }

    /// The measured steps, for [`Survey::restored`].
    #[must_use]
    pub fn state(&self) -> Vec<u8> {
        to_bytes(&self.resolution)
    }

    /// The bound of its request.
    #[must_use]
    pub fn bound(&self) -> Option<u32> {
        self.request.bound
    }

    /// Its plane.
    #[must_use]
    pub fn plane(&self) -> Plane<'_> {
        Plane { base: &self.base, axes: &self.request.axes }
    }

    /// The number of blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.sides().iter().product()
    }

    /// Numbers of columns and rows of blocks.
    fn sides(&self) -> [usize; 2] {
        self.plane().size().map(|cells| cells.div_ceil(SIDE))
    }

    /// The cells of a block, row by row.
    #[must_use]
    pub fn cells(&self, block: usize) -> Vec<usize> {
        let (plane, across) = (self.plane(), self.sides()[0]);
        let side = |at: usize, cells: usize| at * SIDE..cells.min((at + 1) * SIDE);
        let [columns, rows] = plane.size();
        let place =
            |row: usize| side(block % across, columns).map(move |column| row * columns + column);
        side(block / across, rows).flat_map(place).collect()
    }

    /// The block of a cell, and the cell's place in it.
    fn place(&self, cell: usize) -> (usize, usize) {
        let [i, j] = self.plane().place(cell);
        let [across, _] = self.sides();
        let first = i - i % SIDE;
        let width = SIDE.min(self.plane().size()[0] - first);
        ((j / SIDE) * across + i / SIDE, (j % SIDE) * width + i % SIDE)
    }

    /// The block and those whose cells it exchanges attractors with.
    #[must_use]
    pub fn around(&self, block: usize) -> Vec<usize> {
        let [across, up] = self.sides();
        let [i, j] = [block % across, block / across];
        let beside = |at: usize, count: usize| at.saturating_sub(1)..count.min(at + 2);
        beside(j, up).flat_map(|j| beside(i, across).map(move |i| j * across + i)).collect()
    }

    /// Largest number of exchanges.
    #[must_use]
    pub fn passes(&self) -> usize {
        EXCHANGES.len() + MOST_PASSES
    }

    fn strobe(&self, cell: usize) -> Strobe {
        let plane = self.plane();
        self.resolution.strobe(&plane.pendulum(cell), plane.place(cell))
    }

    /// The attractors of the cells of a block, from their starts and from one another, on the threads of the
    /// current pool.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `control` was cancelled.
    pub fn search(&self, block: usize, control: &Control) -> Result<Block, Error> {
        let (plane, own) = (self.plane(), self.cells(block));
        let mut found: Vec<Option<Cell>> = vec![None; own.len()];
        let mut stride = COARSEST;
        while stride > 0 {
            let known = &found;
            let hinted = |cell: usize| {
                let (own, at) = self.place(cell);
                if own == block { known[at].as_ref() } else { None }
            };
            let one = |at: usize| {
                control.check()?;
                let cell = own[at];
                let strobe = self.strobe(cell);
                let around = plane.neighbours(cell, stride, true);
                let others = around.iter().filter_map(|other| hinted(*other));
                let hints = Cell::hints(others, strobe.pendulum.is_mirror_symmetric());
                let found = self.search.cell(cell, &strobe, &hints, control.flag())?;
                control.add(1);
                Ok((at, found))
            };
            let on_grid = |at: &usize| {
                plane.place(own[*at]).iter().all(|k| k.is_multiple_of(stride))
                    && known[*at].is_none()
            };
            let wanted: Vec<usize> = (0..own.len()).filter(on_grid).collect();
            let new: Vec<_> = wanted.into_par_iter().map(one).collect::<Result<_, Error>>()?;
            for (at, cell) in new {
                found[at] = Some(cell);
            }
            stride /= 2;
        }
        let cells: Vec<Cell> = found.into_iter().flatten().collect();
        Ok(Block { gained: vec![0; cells.len()], cells, searched_again: 0 })
    }

    /// The results of a block after exchange `pass` (from 1), from those after the pass before that `known` gives of
    /// the block and those [`Survey::around`] it; `None` if no cell was searched again.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `control` was cancelled.
    pub fn exchange<'a>(
        &self,
        pass: usize,
        block: usize,
        known: impl Fn(usize) -> &'a Block + Sync,
        control: &Control,
    ) -> Result<Option<Block>, Error> {
        let stride = EXCHANGES.get(pass - 1).copied().unwrap_or(1);
        let (plane, own) = (self.plane(), self.cells(block));
        let old = known(block);
        let one = |at: usize| {
            control.check()?;
            let cell = own[at];
            let around: Vec<(&Block, usize)> = plane
                .neighbours(cell, stride, stride == 1)
                .into_iter()
                .map(|other| self.place(other))
                .map(|(block, at)| (known(block), at))
                .filter(|(block, at)| block.gained_in(pass - 1, *at))
                .collect();
            if around.is_empty() {
                return Ok(None);
            }
            let strobe = self.strobe(cell);
            let symmetric = strobe.pendulum.is_mirror_symmetric();
            let theirs = Cell::hints(around.iter().map(|(b, at)| &b.cells[*at]), symmetric);
            let lacking = self.search.promising(&strobe, &old.cells[at], theirs, stride == 1);
            if lacking.is_empty() {
                return Ok(None);
            }
            let again = self.search.again(cell, &strobe, &old.cells[at], &lacking, control.flag());
            let Some(found) = again? else { return Ok(None) };
            Ok(Some((at, found.has_more_than(&old.cells[at], symmetric), found)))
        };
        let all = (0..own.len()).into_par_iter().filter_map(|at| one(at).transpose());
        let again: Vec<(usize, bool, Cell)> = all.collect::<Result<_, Error>>()?;
        if again.is_empty() {
            return Ok(None);
        }
        let mut new = old.clone();
        new.searched_again += again.len();
        for (at, gains, cell) in again {
            new.cells[at] = cell;
            if gains {
                new.gained[at] = pass;
            }
        }
        Ok(Some(new))
    }

    /// The whole plane, from all blocks in their order.
    ///
    /// # Errors
    /// [`Error::Stored`] if these are not its blocks.
    pub fn result(&self, blocks: &[Block]) -> Result<ParameterMap, Error> {
        let sizes = (0..self.blocks()).map(|block| self.cells(block).len());
        if !sizes.eq(blocks.iter().map(|block| block.cells.len())) {
            return Err(Error::Stored { what: "blocks" });
        }
        let cell = |cell| {
            let (block, at) = self.place(cell);
            blocks[block].cells[at].clone()
        };
        let cells = (0..self.plane().size().iter().product()).map(cell).collect();
        let searched_again = blocks.iter().map(|block| block.searched_again).sum();
        Ok(ParameterMap { cells, searched_again, resolution: self.resolution.clone() })
    }

    /// The block of these bytes.
    ///
    /// # Errors
    /// [`Error::Stored`] if they are not those of this block of the survey.
    pub fn block(&self, block: usize, bytes: &[u8]) -> Result<Block, Error> {
        let stored: Block = from_bytes("block", bytes)?;
        let count = self.cells(block).len();
        let fits = stored.cells.len() == count && stored.gained.len() == count;
        if fits { Ok(stored) } else { Err(Error::Stored { what: "block" }) }
    }
}

impl Block {
    /// Its bytes, for [`Survey::block`].
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        to_bytes(self)
    }

    /// Whether a cell may give others something new after a pass.
    ///
    /// Before the first pass between next neighbours all may.
    fn gained_in(&self, pass: usize, at: usize) -> bool {
        pass <= EXCHANGES.len() || self.gained[at] == pass
    }

    /// Whether a cell of it may give others something new after a pass: if none of all blocks, that pass is the last.
    #[must_use]
    pub fn gained(&self, pass: usize) -> bool {
        (0..self.cells.len()).any(|at| self.gained_in(pass, at))
    }
}
