//! Bindings of `maps`.

use numpy::PyReadonlyArray1;
use pendmap::error::Error;
use pendmap::maps::basin_entropy::{Texture as Entropies, of_cells};
use pendmap::maps::basins::{BasinMap as Found, Labelling, Options, basins};
use pendmap::maps::control::pool;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::maps::uncertainty::Uncertainty;
use pyo3::prelude::*;

use super::convert::{Array, Attractor, array, states};
use super::long_calls::watched;
use super::model::Model;
use super::{raise, reckon};

/// `(low, high, count)` as Python passes it.
pub type AxisTuple = (f64, f64, usize);

/// The axes of a grid of starts.
pub fn axes(theta: AxisTuple, velocity: AxisTuple) -> PyResult<[Axis; 2]> {
    let axis = |name, (low, high, count)| Axis::new(name, low, high, count).map_err(raise);
    Ok([axis("theta", theta)?, axis("velocity", velocity)?])
}

/// Numerical choices as Python passes them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Choices {
    tol: f64,
    max_periods: Option<u32>,
    layer_periods: Option<u32>,
    threads: usize,
    seed: u64,
    check: bool,
}

impl From<Choices> for Options {
    fn from(choices: Choices) -> Self {
        let Choices { tol, max_periods, layer_periods, threads, seed, check } = choices;
        Self { tol, max_periods, layer_periods, threads, seed, check }
    }
}

/// Entropies of a plane of labels, and the share of agreeing neighbours.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Texture {
    basin_entropy: f64,
    boundary_basin_entropy: f64,
    boundary_stderr: f64,
    boxes: usize,
    boundary_boxes: usize,
    neighbours_agree: f64,
    /// The expected share of agreeing neighbours by chance.
    chance: f64,
}

impl Texture {
    fn new(found: &Entropies) -> Self {
        Self {
            basin_entropy: found.basin_entropy,
            boundary_basin_entropy: found.boundary_basin_entropy,
            boundary_stderr: found.boundary_stderr,
            boxes: found.boxes,
            boundary_boxes: found.boundary_boxes,
            neighbours_agree: found.neighbours_agree,
            chance: found.chance,
        }
    }
}

/// Basins of attraction; arrays have one entry for each start.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct BasinMap {
    attractors: Vec<Py<Attractor>>,
    /// Shares of the starts that are undecided, and that failed.
    undecided: f64,
    failed: f64,
    mean_periods: f64,
    /// `basins`, `conservative` or `only_chaos`.
    plane: &'static str,
    chaos_bound: u32,
    searched_starts: usize,
    layer_periods: u32,
    bound: u32,
    steps_per_period: usize,
    reached_error: f64,
    simd: &'static str,
    texture: Py<Texture>,
    uncertainty_eps: Array<f64>,
    uncertain: Array<u64>,
    uncertainty_tried: Array<u64>,
    unreliable: f64,
    unreliable_half_step: f64,
    unreliable_mirror: Option<f64>,
    labels_sampled: usize,
    label: Array<i16>,
    settle: Array<i32>,
    turns: Array<i32>,
    finite_time_exponent: Option<Array<f32>>,
}

impl BasinMap {
    fn new(py: Python<'_>, map: Found) -> PyResult<Self> {
        let each = map.attractors.iter().zip(&map.fractions);
        let attractors = each.map(|(one, fraction)| Py::new(py, Attractor::new(one, *fraction)));
        let Uncertainty { eps, uncertain, tried } = map.uncertainty.clone().unwrap_or_default();
        Ok(Self {
            attractors: attractors.collect::<PyResult<_>>()?,
            undecided: if map.labelling == Labelling::Conservative { 1.0 } else { map.share(0) },
            failed: map.share(-1),
            mean_periods: map.mean_periods(),
            plane: match map.labelling {
                Labelling::Basins => "basins",
                Labelling::Conservative => "conservative",
                Labelling::OnlyChaos => "only_chaos",
            },
            chaos_bound: map.chaos_bound,
            searched_starts: map.searched,
            layer_periods: map.layer_periods,
            bound: map.bound,
            steps_per_period: map.steps,
            reached_error: map.reached_error,
            simd: map.simd.name(),
            texture: Py::new(py, Texture::new(&map.texture))?,
            uncertainty_eps: array(py, eps),
            uncertain: array(py, uncertain),
            uncertainty_tried: array(py, tried),
            unreliable: map.reliability.either,
            unreliable_half_step: map.reliability.half_step,
            unreliable_mirror: map.reliability.mirror,
            labels_sampled: map.reliability.sampled,
            label: array(py, map.labels.label),
            settle: array(py, map.labels.settle),
            turns: array(py, map.labels.turns),
            finite_time_exponent: map.layers.map(|layers| array(py, layers.exponent)),
        })
    }
}

/// Basins over a grid.
#[pyfunction]
#[pyo3(signature = (model, theta, velocity, choices, progress=None))]
pub fn basins_grid(
    py: Python<'_>,
    model: Model,
    theta: AxisTuple,
    velocity: AxisTuple,
    choices: Choices,
    progress: Option<Py<PyAny>>,
) -> PyResult<BasinMap> {
    let [theta, velocity] = axes(theta, velocity)?;
    run(py, model, Starts::Grid { theta, velocity }, choices, progress)
}

/// Basins of a list of starts.
#[pyfunction]
#[pyo3(signature = (model, theta, velocity, choices, progress=None))]
pub fn basins_list(
    py: Python<'_>,
    model: Model,
    theta: PyReadonlyArray1<'_, f64>,
    velocity: PyReadonlyArray1<'_, f64>,
    choices: Choices,
    progress: Option<Py<PyAny>>,
) -> PyResult<BasinMap> {
    let states = states(&theta, &velocity)?;
    if let Some(value) = states.iter().flatten().find(|x| !x.is_finite()) {
        let allowed = "a finite number";
        return Err(raise(Error::Range { name: "start", value: *value, allowed }));
    }
    // Angle and velocity, and all that a map and its dataset have of a start.
    reckon("starts", states.len(), 100)?;
    run(py, model, Starts::List(states), choices, progress)
}

/// The texture of labels in rows of `columns` cells.
#[pyfunction]
pub fn texture(
    py: Python<'_>,
    labels: PyReadonlyArray1<'_, i16>,
    columns: usize,
) -> PyResult<Texture> {
    let cells = labels.as_slice()?.to_vec();
    let found = watched(py, None, |_| Ok(of_cells(&cells, columns, &pool(0)?)))?;
    Ok(Texture::new(&found))
}

fn run(
    py: Python<'_>,
    model: Model,
    starts: Starts,
    choices: Choices,
    progress: Option<Py<PyAny>>,
) -> PyResult<BasinMap> {
    let pendulum = model.pendulum()?;
    let options = Options::from(choices);
    let map =
        watched(py, progress.as_ref(), |control| basins(&pendulum, &starts, &options, control))?;
    BasinMap::new(py, map)
}
