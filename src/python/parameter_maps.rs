//! Bindings of maps over parameters.

use std::collections::{BTreeMap, BTreeSet};

use pendmap::attractor::Attractor;
use pendmap::integrate::State;
use pendmap::lanes::InstructionSet;
use pendmap::maps::bifurcation as diagram;
use pendmap::maps::cell::Found;
use pendmap::maps::matching;
use pendmap::maps::parameter_map as maps;
use pendmap::model::Angle;
use pyo3::prelude::*;

use super::convert::{Array, Attractor as PyAttractor, array};
use super::model::Model;
use super::raise;

/// Names of parameters, each with its values at the places of an axis.
pub type RangeTuple = Vec<(String, Vec<f64>)>;

/// The attractors over a plane of two parameters: arrays over all attractors of all cells, one cell after
/// the other, and over cells.
#[pyclass(frozen, get_all, subclass, module = "pendmap._core")]
pub struct ParameterMap {
    /// The cell of each attractor.
    cell: Array<i32>,
    /// All plain names of attractors in order; those of mirror images are one in a plane.
    kinds: Vec<Py<PyAttractor>>,
    /// The place of each attractor in `kinds`.
    kind: Array<i16>,
    n: Array<i32>,
    w: Array<i32>,
    theta: Array<f64>,
    velocity: Array<f64>,
    exponent: Array<f64>,
    exponent_stderr: Array<f64>,
    /// Share of the cell's starts.
    share: Array<f64>,
    /// Share of undecided starts of each cell.
    undecided: Array<f64>,
    failed: Array<f64>,
    /// Periods for which chaos was observed in each cell.
    chaos_periods: Array<u32>,
    reached_error: f64,
    searched_again: usize,
    simd: &'static str,
}

/// The attractors along one parameter, their points, and the motions followed up and down.
#[pyclass(frozen, get_all, extends = ParameterMap, module = "pendmap._core")]
pub struct Bifurcation {
    /// The branch of each attractor.
    branch: Array<i32>,
    /// The attractor of each point.
    point_entry: Array<i32>,
    point_theta: Array<f64>,
    point_velocity: Array<f64>,
    up: Py<Followed>,
    down: Py<Followed>,
}

/// The motion under a slow change of the parameter.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Followed {
    /// The attractor at each value; -1 for none.
    on: Array<i32>,
    /// Index of the value, angle and velocity of points that are on no attractor.
    value: Array<i32>,
    theta: Array<f64>,
    velocity: Array<f64>,
}

impl ParameterMap {
    /// The arrays of a map; with `pairs` mirror images are of one kind.
    pub fn new(py: Python<'_>, map: &maps::ParameterMap, pairs: bool) -> PyResult<Self> {
        let cells = map.cells.iter();
        let each = cells.clone().enumerate();
        let all: Vec<(i32, &Found)> =
            each.flat_map(|(i, cell)| cell.found.iter().map(move |f| (i as i32, f))).collect();
        let number =
            |of: &dyn Fn(&Found) -> f64| array(py, all.iter().map(|(_, f)| of(f)).collect());
        let whole = |of: &dyn Fn(&Attractor) -> i64| {
            array(py, all.iter().map(|(_, f)| of(&f.attractor) as i32).collect())
        };
        let (kinds, kind) = kinds_of(all.iter().map(|(_, found)| &found.attractor), pairs);
        let kinds = kinds.iter().map(|one| Py::new(py, PyAttractor::new(one, f64::NAN)));
        let point = |f: &Found, k: usize| f.attractor.points.first().map_or(f64::NAN, |p| p[k]);
        Ok(Self {
            cell: array(py, all.iter().map(|(cell, _)| *cell).collect()),
            kinds: kinds.collect::<PyResult<_>>()?,
            kind: array(py, kind),
            n: whole(&|a| a.n.unwrap_or(0) as i64),
            w: whole(&|a| a.w),
            theta: number(&|f| point(f, 0)),
            velocity: number(&|f| point(f, 1)),
            exponent: number(&|f| f.attractor.exponent),
            exponent_stderr: number(&|f| f.attractor.exponent_stderr),
            share: number(&|f| f.share),
            undecided: array(py, cells.clone().map(|cell| cell.open).collect()),
            failed: array(py, cells.clone().map(|cell| cell.failed).collect()),
            chaos_periods: array(py, cells.map(|cell| cell.observed).collect()),
            reached_error: map.resolution.reached_error,
            searched_again: map.searched_again,
            simd: InstructionSet::choose().map_err(raise)?.name(),
        })
    }
}

impl Bifurcation {
    /// The arrays of a diagram.
    pub fn of(py: Python<'_>, found: &diagram::Diagram) -> PyResult<Py<Self>> {
        let all = found.map.cells.iter().flat_map(|cell| &cell.found).enumerate();
        let points: Vec<(i32, State)> = all
            .flat_map(|(i, f)| f.attractor.points.iter().map(move |point| (i as i32, *point)))
            .collect();
        let (point_entry, point_theta, point_velocity) = columns(py, &points);
        let branch = matching::linked(&found.map).into_iter().map(|k| k as i32).collect();
        let own = Self {
            branch: array(py, branch),
            point_entry,
            point_theta,
            point_velocity,
            up: Py::new(py, Followed::new(py, &found.up))?,
            down: Py::new(py, Followed::new(py, &found.down))?,
        };
        Py::new(py, (own, ParameterMap::new(py, &found.map, false)?))
    }
}

impl Followed {
    fn new(py: Python<'_>, all: &[diagram::Followed]) -> Self {
        let each = all.iter().enumerate();
        let loose = each.flat_map(|(k, f)| f.loose.iter().map(move |point| (k as i32, *point)));
        let (value, theta, velocity) = columns(py, &loose.collect::<Vec<_>>());
        let on = all.iter().map(|f| f.on.map_or(-1, |k| k as i32)).collect();
        Self { on: array(py, on), value, theta, velocity }
    }
}

/// The names of a model's parameters, in the order of their places.
#[pyfunction]
pub fn parameter_names(model: Model) -> PyResult<Vec<String>> {
    let pendulum = model.pendulum()?;
    Ok(pendulum.parameters().into_iter().map(|one| pendulum.name_of(one)).collect())
}

/// The descriptions of attractors in order, and the place of each attractor among them.
fn kinds_of<'a>(
    all: impl Iterator<Item = &'a Attractor>,
    pairs: bool,
) -> (Vec<Attractor>, Vec<i16>) {
    let key = |a: &Attractor| {
        if pairs { (a.kind, a.n, a.w.abs(), 0, 0) } else { (a.kind, a.n, a.w, a.lean, a.turn) }
    };
    let keys: Vec<_> = all.map(key).collect();
    let every: BTreeSet<_> = keys.iter().copied().collect();
    let place: BTreeMap<_, i16> = every.iter().copied().zip(0..).collect();
    let described = |(kind, n, w, lean, turn)| {
        let one = Attractor { lean, turn, ..Attractor::described(kind, n, w, Angle::Circle) };
        Attractor { name: if pairs { one.pair_name() } else { one.plain_name() }, ..one }
    };
    (every.into_iter().map(described).collect(), keys.iter().map(|key| place[key]).collect())
}

/// Numbers, angles and velocities of points.
fn columns(py: Python<'_>, points: &[(i32, State)]) -> (Array<i32>, Array<f64>, Array<f64>) {
    let column = |k: usize| array(py, points.iter().map(|(_, point)| point[k]).collect());
    (array(py, points.iter().map(|(i, _)| *i).collect()), column(0), column(1))
}
