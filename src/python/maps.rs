//! Bindings of `maps`.

use numpy::PyReadonlyArray1;
use pendmap::error::Error;
use pendmap::maps::basin_entropy::{Texture as Entropies, TextureSum as Sum, texture};
use pendmap::maps::basin_plan::{Labelling, Options, Plan};
use pendmap::maps::basins::{LEAST_CELLS, ends};
use pendmap::maps::boundary_distance::Thinned;
use pendmap::maps::control::pool;
use pendmap::maps::finite_time::FiniteTime;
use pendmap::maps::label::Labels;
use pendmap::maps::reliability::{reliability, sample};
use pendmap::maps::starts::{Axis, Starts};
use pendmap::maps::uncertainty::{Uncertainty as Uncertain, uncertainty};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::convert::{Array, Attractor, array, states};
use super::long_calls::interruptible;
use super::model::Model;
use super::raise;

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

#[pymethods]
impl Texture {
    /// The values of a list of starts, which have no neighbours; without labels, those of a plane
    /// without basins.
    #[staticmethod]
    fn without_cells(labelled: bool) -> Self {
        Self::new(&if labelled { Entropies::of_list() } else { Entropies::plain() })
    }
}

/// Starts of a basin map as Python passes them: the axes of a grid, or angles and velocities.
#[derive(FromPyObject)]
pub enum GivenStarts<'py> {
    Grid((AxisTuple, AxisTuple)),
    List((PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>)),
}

impl GivenStarts<'_> {
    fn starts(self) -> PyResult<Starts> {
        match self {
            Self::Grid((theta, velocity)) => {
                let [theta, velocity] = axes(theta, velocity)?;
                Ok(Starts::Grid { theta, velocity })
            }
            Self::List((theta, velocity)) => {
                let states = states(&theta, &velocity)?;
                if let Some(value) = states.iter().flatten().find(|x| !x.is_finite()) {
                    let allowed = "a finite number";
                    return Err(raise(Error::Range { name: "start", value: *value, allowed }));
                }
                Ok(Starts::List(states))
            }
        }
    }
}

/// What the starts of a basin map share: step length, attractors and bounds.
#[pyclass(module = "pendmap._core")]
pub struct BasinPlan {
    plan: Plan,
    starts: Starts,
    seed: u64,
    threads: usize,
}

/// Labels of some starts; arrays have one entry for each.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct LabelledStarts {
    label: Array<i16>,
    settle: Array<i32>,
    turns: Array<i32>,
    finite_time_exponent: Option<Array<f32>>,
    /// Number of periods integrated.
    work: u64,
    /// States of the undecided starts at the bound.
    open_theta: Array<f64>,
    open_velocity: Array<f64>,
}

impl LabelledStarts {
    fn new(py: Python<'_>, labels: Labels, layers: Option<FiniteTime>) -> Self {
        let open = |k: usize| array(py, labels.open.iter().map(|(_, state)| state[k]).collect());
        Self {
            open_theta: open(0),
            open_velocity: open(1),
            label: array(py, labels.label),
            settle: array(py, labels.settle),
            turns: array(py, labels.turns),
            finite_time_exponent: layers.map(|layers| array(py, layers.exponent)),
            work: labels.work,
        }
    }
}

/// Shares of sampled labels that half the step or mirroring changes.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Reliability {
    unreliable: f64,
    unreliable_half_step: f64,
    unreliable_mirror: Option<f64>,
    labels_sampled: usize,
}

/// Starts whose label changes nearby.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Uncertainty {
    eps: Array<f64>,
    uncertain: Array<u64>,
    tried: Array<u64>,
}

#[pymethods]
impl BasinPlan {
    /// Searches for the attractors; `state` restores the plan that another process has made.
    #[new]
    ///
    /// `near` is the plan of a similar model, whose attractors are continued.
    #[pyo3(signature = (model, starts, choices, state=None, progress=None, near=None))]
    fn new(
        py: Python<'_>,
        model: Model,
        starts: GivenStarts<'_>,
        choices: Choices,
        state: Option<&[u8]>,
        progress: Option<Py<PyAny>>,
        near: Option<PyRef<'_, Self>>,
    ) -> PyResult<Self> {
        let (pendulum, starts) = (model.pendulum()?, starts.starts()?);
        let options = Options::from(choices);
        let known = near.map(|near| near.plan.clone());
        let plan = match state {
            Some(bytes) => Plan::restored(&pendulum, bytes).map_err(raise)?,
            None => interruptible(py, progress.as_ref(), |control| match known {
                Some(known) => known.continued(&pendulum, &starts, &options, control),
                None => Plan::new(&pendulum, &starts, &options, control),
            })?,
        };
        Ok(Self { plan, starts, seed: options.seed, threads: options.threads })
    }

    /// The plan as bytes.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.plan.stored())
    }

    /// `basins`, `conservative` or `only_chaos`.
    #[getter]
    fn plane(&self) -> &'static str {
        match self.plan.facts.labelling {
            Labelling::Basins => "basins",
            Labelling::Conservative => "conservative",
            Labelling::OnlyChaos => "only_chaos",
        }
    }

    #[getter]
    fn layer_periods(&self) -> u32 {
        if self.labelled() { 0 } else { self.plan.facts.bound }
    }

    #[getter]
    fn bound(&self) -> u32 {
        self.plan.facts.bound
    }

    #[getter]
    fn chaos_bound(&self) -> u32 {
        self.plan.chaos_bound()
    }

    #[getter]
    fn searched_starts(&self) -> usize {
        self.plan.facts.searched
    }

    #[getter]
    fn steps_per_period(&self) -> usize {
        self.plan.facts.steps
    }

    #[getter]
    fn reached_error(&self) -> f64 {
        self.plan.facts.reached_error
    }

    #[getter]
    fn simd(&self) -> &'static str {
        self.plan.strobe.simd.name()
    }

    /// Labels the starts from the index `first` to before `last`.
    #[pyo3(signature = (first, last, progress=None))]
    fn label(
        &self,
        py: Python<'_>,
        first: usize,
        last: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<LabelledStarts> {
        if first > last || last > self.starts.len() {
            return Err(PyIndexError::new_err("starts beyond the last one"));
        }
        let (labels, layers) = interruptible(py, progress.as_ref(), |control| {
            let states = (first..last).map(|i| self.starts.get(i)).collect();
            let pool = pool(self.threads)?;
            self.plan.cells(&Starts::List(states), &pool, control)
        })?;
        Ok(LabelledStarts::new(py, labels, layers))
    }

    /// Labels all starts, with as many further searches as are required; of a grid also the texture.
    #[pyo3(signature = (progress=None))]
    fn map(
        &mut self,
        py: Python<'_>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(LabelledStarts, Texture)> {
        let Self { plan, starts, threads, .. } = self;
        let (labels, layers, found) = interruptible(py, progress.as_ref(), |control| {
            let pool = pool(*threads)?;
            let (labels, layers) = ends(plan, starts, &pool, control)?;
            let found = match starts {
                Starts::Grid { theta, .. } if layers.is_none() => {
                    texture(&labels.label, theta.count, &pool)
                }
                Starts::List(_) if layers.is_none() => Entropies::of_list(),
                _ => Entropies::plain(),
            };
            Ok((labels, layers, found))
        })?;
        Ok((LabelledStarts::new(py, labels, layers), Texture::new(&found)))
    }

    /// Labels the starts with these indices again.
    #[pyo3(signature = (picks, progress=None))]
    fn label_again(
        &self,
        py: Python<'_>,
        picks: PyReadonlyArray1<'_, i64>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<LabelledStarts> {
        let picks: Vec<usize> = picks.as_slice()?.iter().map(|k| *k as usize).collect();
        if picks.iter().any(|k| *k >= self.starts.len()) {
            return Err(PyIndexError::new_err("starts beyond the last one"));
        }
        let labels = interruptible(py, progress.as_ref(), |control| {
            let pool = pool(self.threads)?;
            self.plan.label(&self.starts, Some(&picks), &pool, control)
        })?;
        Ok(LabelledStarts::new(py, labels, None))
    }

    /// Searches from states of open trajectories; None if labels are final, else the new label of
    /// what has been labelled k + 1 before.
    fn further(
        &mut self,
        py: Python<'_>,
        theta: PyReadonlyArray1<'_, f64>,
        velocity: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Option<Array<i16>>> {
        let states = states(&theta, &velocity)?;
        let plan = &mut self.plan;
        let moved = interruptible(py, None, |control| plan.further(&states, control))?;
        Ok(moved.map(|moved| array(py, moved)))
    }

    /// Indices of the starts whose labels are checked.
    fn checked_starts(&self, py: Python<'_>) -> Array<i64> {
        array(py, sample(&self.starts, self.seed).into_iter().map(|k| k as i64).collect())
    }

    /// Whether labels are reliable, from those of `checked_starts`.
    fn reliability(
        &self,
        py: Python<'_>,
        labels: PyReadonlyArray1<'_, i16>,
    ) -> PyResult<Reliability> {
        let own = labels.as_slice()?.to_vec();
        let found = interruptible(py, None, |control| {
            let pool = pool(self.threads)?;
            reliability(&self.plan, &self.starts, &own, self.seed, &pool, control)
        })?;
        Ok(Reliability {
            unreliable: found.either,
            unreliable_half_step: found.half_step,
            unreliable_mirror: found.mirror,
            labels_sampled: found.sampled,
        })
    }

    /// Starts whose label changes nearby, from the labels of a thinned grid in rows of `columns`.
    fn uncertainty(
        &self,
        py: Python<'_>,
        labels: PyReadonlyArray1<'_, i16>,
        columns: usize,
    ) -> PyResult<Option<Uncertainty>> {
        let Starts::Grid { theta, velocity } = &self.starts else { return Ok(None) };
        if self.starts.len() < LEAST_CELLS {
            return Ok(None);
        }
        let thinned = Thinned { labels: labels.as_slice()?.to_vec(), columns };
        let Uncertain { eps, uncertain, tried } = interruptible(py, None, |control| {
            let pool = pool(self.threads)?;
            uncertainty([theta, velocity], &thinned, self.seed, |states| {
                Ok(self.plan.label(&Starts::List(states), None, &pool, control)?.label)
            })
        })?;
        let [uncertain, tried] = [uncertain, tried].map(|counts| array(py, counts));
        Ok(Some(Uncertainty { eps: array(py, eps), uncertain, tried }))
    }

    /// The attractors with the number of starts that end on each, after sets at rest of further turns that no start
    /// reaches are left out; with the new label of what has been labelled k + 1 before.
    fn finish(
        &mut self,
        py: Python<'_>,
        counts: PyReadonlyArray1<'_, i64>,
    ) -> PyResult<(Vec<Py<Attractor>>, Array<i16>)> {
        let counts = counts.as_slice()?.to_vec();
        let count = |label: i16| counts.get(label as usize - 1).copied().unwrap_or(0);
        let moved = self.plan.drop_unreached_turns(|label| count(label) > 0);
        let all = self.starts.len().max(1) as f64;
        let mut fractions = vec![0.0; self.plan.catalogue.attractors.len()];
        for (label, now) in (1..).zip(&moved) {
            if let Some(fraction) = fractions.get_mut((*now as usize).wrapping_sub(1)) {
                *fraction += count(label) as f64 / all;
            }
        }
        let each = self.plan.catalogue.attractors.iter().zip(fractions);
        let attractors = each.map(|(one, fraction)| Py::new(py, Attractor::new(one, fraction)));
        Ok((attractors.collect::<PyResult<_>>()?, array(py, moved)))
    }
}

impl BasinPlan {
    fn labelled(&self) -> bool {
        self.plan.facts.labelling == Labelling::Basins
    }
}

/// The texture of a plane whose rows come in parts.
#[pyclass(module = "pendmap._core")]
pub struct TextureSum(Sum);

#[pymethods]
impl TextureSum {
    #[new]
    fn new(columns: usize, rows: usize) -> Self {
        Self(Sum::new(columns, rows))
    }

    /// Adds the labels of the next rows, and of the row after them unless it is beyond the last.
    fn add(&mut self, py: Python<'_>, labels: PyReadonlyArray1<'_, i16>) -> PyResult<()> {
        let cells = labels.as_slice()?.to_vec();
        let sum = &mut self.0;
        interruptible(py, None, |_| {
            let pool = pool(0)?;
            sum.add(&cells, &pool);
            Ok(())
        })
    }

    /// The texture of all rows.
    fn total(&self) -> Texture {
        Texture::new(&self.0.total())
    }
}

/// The indices that a thinned map keeps along a side of `count` cells, the other side having `others`.
#[pyfunction]
pub fn thinned(py: Python<'_>, count: usize, others: usize) -> Array<i64> {
    array(py, Thinned::picks(count, others, 0).map(|k| k as i64).collect())
}
