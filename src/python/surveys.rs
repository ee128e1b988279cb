//! Bindings of surveys: maps over parameters, block by block.

use std::collections::BTreeMap;

use numpy::PyReadonlyArray1;
use pendmap::error::Error;
use pendmap::maps::bifurcation::{Request as DiagramRequest, followed};
use pendmap::maps::cell::HINTED;
use pendmap::maps::parameter_map::Request;
use pendmap::maps::survey;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::convert::states;
use super::long_calls::pooled;
use super::model::{Model, range};
use super::parameter_maps::{Bifurcation, ParameterMap, RangeTuple};
use super::raise;

/// The blocks of a plane of two parameters, or of a line of one.
#[pyclass(frozen, module = "pendmap._core")]
pub struct Survey {
    own: survey::Survey,
    threads: usize,
}

impl Survey {
    /// The blocks of these bytes.
    fn stored(&self, blocks: &[Vec<u8>]) -> Result<Vec<survey::Block>, Error> {
        blocks.iter().enumerate().map(|(k, bytes)| self.own.block(k, bytes)).collect()
    }
}

#[pymethods]
impl Survey {
    /// `axes` has one range for a diagram, two for a map; `state` is that of an equal survey.
    #[new]
    #[pyo3(signature = (model, axes, theta, velocity, each, tol, bound, threads, state=None))]
    #[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
    fn new(
        py: Python<'_>,
        model: Model,
        axes: Vec<RangeTuple>,
        theta: PyReadonlyArray1<'_, f64>,
        velocity: PyReadonlyArray1<'_, f64>,
        each: usize,
        tol: f64,
        bound: Option<u32>,
        threads: usize,
        state: Option<Vec<u8>>,
    ) -> PyResult<Self> {
        let pendulum = model.pendulum()?;
        let starts = states(&theta, &velocity)?;
        let axes: Vec<_> =
            axes.into_iter().map(|axis| range(&pendulum, axis)).collect::<PyResult<_>>()?;
        let request = match <[_; 2]>::try_from(axes) {
            Ok(axes) => Request { axes, starts, each, tol, bound, kept: HINTED, threads },
            Err(axes) => {
                let [axis] = <[_; 1]>::try_from(axes).map_err(|axes| {
                    let value = axes.len() as f64;
                    raise(Error::Range { name: "axes", value, allowed: "1 or 2" })
                })?;
                let first = None;
                let line = DiagramRequest { axis, starts, each, first, tol, bound, threads };
                line.of_map()
            }
        };
        let own = pooled(py, threads, None, |_| match state {
            Some(state) => survey::Survey::restored(&pendulum, &request, &state),
            None => survey::Survey::new(&pendulum, &request),
        })?;
        Ok(Self { own, threads })
    }

    /// The measured steps, for a survey of the same arguments.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.own.state())
    }

    /// The number of blocks.
    #[getter]
    fn blocks(&self) -> usize {
        self.own.blocks()
    }

    /// The largest number of exchanges.
    #[getter]
    fn passes(&self) -> usize {
        self.own.passes()
    }

    /// The cells of a block, row by row.
    fn cells(&self, block: usize) -> PyResult<Vec<usize>> {
        self.checked(block)?;
        Ok(self.own.cells(block))
    }

    /// The block and those that an exchange in it reads.
    fn around(&self, block: usize) -> PyResult<Vec<usize>> {
        self.checked(block)?;
        Ok(self.own.around(block))
    }

    /// The results of a block on its own.
    #[pyo3(signature = (block, progress=None))]
    fn search<'py>(
        &self,
        py: Python<'py>,
        block: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        self.checked(block)?;
        let found = pooled(py, self.threads, progress.as_ref(), |control| {
            control.begin(self.own.cells(block).len());
            self.own.search(block, control)
        })?;
        Ok(PyBytes::new(py, &found.to_bytes()))
    }

    /// The results of a block after exchange `pass_number` (from 1); none if they are those before it.
    ///
    /// `known` has the results before it of the block and those around it.
    #[pyo3(signature = (pass_number, block, known, progress=None))]
    fn exchange<'py>(
        &self,
        py: Python<'py>,
        pass_number: usize,
        block: usize,
        known: BTreeMap<usize, Vec<u8>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        self.checked(block)?;
        if !(1..=self.own.passes()).contains(&pass_number) {
            let value = pass_number as f64;
            return Err(raise(Error::Range { name: "pass_number", value, allowed: "1 to passes" }));
        }
        let missing = || raise(Error::Stored { what: "known" });
        let one = |other: usize| {
            let bytes = known.get(&other).ok_or_else(missing)?;
            Ok((other, self.own.block(other, bytes).map_err(raise)?))
        };
        let known: BTreeMap<usize, survey::Block> =
            self.own.around(block).into_iter().map(one).collect::<PyResult<_>>()?;
        let found = pooled(py, self.threads, progress.as_ref(), |control| {
            self.own.exchange(pass_number, block, |other| &known[&other], control)
        })?;
        Ok(found.map(|found| PyBytes::new(py, &found.to_bytes())))
    }

    /// Whether, after exchange `pass_number`, a cell of this block may give others something new.
    ///
    /// If none of all blocks, that exchange is the last.
    fn gained(&self, pass_number: usize, block: usize, found: Vec<u8>) -> PyResult<bool> {
        self.checked(block)?;
        Ok(self.own.block(block, &found).map_err(raise)?.gained(pass_number))
    }

    /// The whole map, from the results of all blocks after the last exchange.
    fn result(&self, py: Python<'_>, blocks: Vec<Vec<u8>>) -> PyResult<ParameterMap> {
        let map = self.stored(&blocks).and_then(|blocks| self.own.result(&blocks));
        ParameterMap::new(py, &map.map_err(raise)?, true)
    }

    /// The whole diagram, from the results of all blocks; what is followed starts from `first`.
    #[pyo3(signature = (blocks, first=None))]
    fn diagram(
        &self,
        py: Python<'_>,
        blocks: Vec<Vec<u8>>,
        first: Option<[f64; 2]>,
    ) -> PyResult<Py<Bifurcation>> {
        let found = pooled(py, self.threads, None, |control| {
            let map = self.own.result(&self.stored(&blocks)?)?;
            followed(map, &self.own.plane(), first, self.own.bound(), control)
        })?;
        Bifurcation::of(py, &found)
    }
}

impl Survey {
    fn checked(&self, block: usize) -> PyResult<()> {
        if block < self.own.blocks() {
            return Ok(());
        }
        let value = block as f64;
        Err(raise(Error::Range { name: "block", value, allowed: "one of the survey" }))
    }
}
