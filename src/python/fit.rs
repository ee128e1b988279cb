//! Bindings of `fit`.

use std::sync::Arc;

use nalgebra::DMatrix;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pendmap::error::Error;
use pendmap::fit::levenberg_marquardt::Point;
use pendmap::fit::normal::linearised;
use pendmap::fit::profile::intervals;
use pendmap::fit::replay::replay as replayed;
use pendmap::fit::window::Window;
use pendmap::fit::{Counts, Free, Problem, Record, RodSensor, Settings, Slot, fit};
use pendmap::model::Recorded;
use pendmap::model::recorded::{Quantity, Samples};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::convert::{Array, array, states};
use super::long_calls::pooled;
use super::model::Model;
use super::{raise, reckon};

/// Bytes of a reading that is made: its state, itself in a row, and in the array of all.
const EACH_READING: usize = 40;

type Floats<'py> = PyReadonlyArray1<'py, f64>;

/// `([(record, name), ...], start)`: the name of the number in each of its records, a parameter of the
/// pendulum, `gravity`, or the `bias` of a gyroscope; where the search starts.
type FreeTuple = (Vec<(usize, String)>, f64);

/// `(record, first sample, one after the last, angle, velocity)`.
type WindowTuple = (usize, usize, usize, f64, f64);

/// A recorded motion of the pivot as Python passes it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Pivot<'py> {
    quantity: String,
    time: Floats<'py>,
    vertical: Option<Floats<'py>>,
    horizontal: Option<Floats<'py>>,
}

impl Pivot<'_> {
    fn recorded(&self) -> PyResult<Recorded> {
        let quantity = match self.quantity.as_str() {
            "position" => Quantity::Position,
            "velocity" => Quantity::Velocity,
            _ => Quantity::Acceleration,
        };
        let slice = |values: &Option<Floats<'_>>| {
            values.as_ref().map(|values| values.as_slice().map(<[f64]>::to_vec)).transpose()
        };
        let (vertical, horizontal) = (slice(&self.vertical)?, slice(&self.horizontal)?);
        let vertical = vertical.as_deref().map(|values| Samples { quantity, values });
        let horizontal = horizontal.as_deref().map(|values| Samples { quantity, values });
        Recorded::new(self.time.as_slice()?, vertical, horizontal).map_err(raise)
    }
}

/// A gyroscope on the rod as Python passes it: its factor, and the approximate angles at its readings.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Sensor<'py> {
    rate: f64,
    angle: Floats<'py>,
}

/// A record as Python passes it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Run<'py> {
    model: Model,
    time: Floats<'py>,
    reading: Floats<'py>,
    weight: Floats<'py>,
    count: Option<f64>,
    longest: f64,
    pivot: Option<Pivot<'py>>,
    rod_sensor: Option<Sensor<'py>>,
}

impl Run<'_> {
    fn record(self) -> PyResult<Record> {
        let recorded = self.pivot.as_ref().map(Pivot::recorded).transpose()?;
        let angles = |sensor: &Sensor<'_>| Ok::<_, PyErr>(sensor.angle.as_slice()?.to_vec());
        let angles = self.rod_sensor.as_ref().map(angles).transpose()?;
        let rod_sensor = self.rod_sensor.map(|Sensor { rate, .. }| RodSensor { rate, bias: 0.0 });
        let weights = self.weight.as_slice()?.to_vec();
        let counts =
            self.count.map(|step| Counts::new(step, &weights)).transpose().map_err(raise)?;
        Ok(Record {
            pendulum: self.model.pendulum()?,
            recorded: recorded.map(Arc::new),
            times: self.time.as_slice()?.to_vec(),
            readings: self.reading.as_slice()?.to_vec(),
            weights,
            counts,
            rod_sensor,
            angles,
            longest: self.longest,
        })
    }
}

/// Choices of a fit as Python passes them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FitChoices {
    tolerance: f64,
    shortest: f64,
    growth: f64,
    steps: usize,
    gain: f64,
    hold: usize,
    target: f64,
    profiled: Vec<usize>,
    level: f64,
    doubt: f64,
}

fn problem(runs: Vec<Run<'_>>, free: &[FreeTuple], tolerance: f64) -> PyResult<Problem> {
    let records = runs.into_iter().map(Run::record).collect::<PyResult<Vec<_>>>()?;
    let slot = |(record, name): &(usize, String)| {
        let pendulum = records.get(*record).map(|record| &record.pendulum);
        let slot = match (name.as_str(), pendulum) {
            ("bias", _) => Slot::Bias,
            (name, Some(pendulum)) if name != "gravity" => {
                Slot::Parameter(pendulum.parameter(name)?)
            }
            _ => Slot::Gravity,
        };
        Ok((*record, slot))
    };
    let free = free.iter().map(|(places, start)| {
        let places = places.iter().map(slot).collect::<Result<_, Error>>()?;
        Ok(Free { places, start: *start })
    });
    let free = free.collect::<Result<_, Error>>();
    free.and_then(|free| Problem::new(records, free, tolerance)).map_err(raise)
}

fn windows(given: Vec<WindowTuple>, problem: &Problem) -> PyResult<Vec<Window>> {
    let window = |(record, from, to, theta, velocity): WindowTuple| {
        let length = problem.records.get(record).map_or(0, |record| record.times.len());
        if from < to && to <= length {
            return Ok(Window { record, from, to, start: [theta, velocity] });
        }
        Err(PyValueError::new_err(format!(
            "window of run {record} must be samples of a run, the first before the last, got \
             {from} to {to} of {length}"
        )))
    };
    given.into_iter().map(window).collect()
}

/// The equations at some values of the free parameters.
#[pyclass(frozen, get_all, subclass, module = "pendmap._core")]
pub struct FitPoint {
    values: Array<f64>,
    chi2: f64,
    samples: usize,
    degrees: usize,
    /// Half the curvature of the sum of squares by the free parameters, the states following.
    information: Py<PyArray2<f64>>,
    /// Half the slope of the sum of squares.
    pull: Array<f64>,
    windows: Vec<WindowTuple>,
    runs: Vec<Py<FittedRun>>,
}

/// The best values of the free parameters.
#[pyclass(frozen, get_all, extends = FitPoint, module = "pendmap._core")]
pub struct Fit {
    covariance: Py<PyArray2<f64>>,
    /// Intervals of the profiled parameters.
    intervals: Vec<(f64, f64)>,
    widening: f64,
    steps: usize,
    stages: usize,
    converged: bool,
    given_up: bool,
}

/// The model at each sample of a record; no numbers where there is no window.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct FittedRun {
    theta: Array<f64>,
    velocity: Array<f64>,
    residual: Array<f64>,
    /// The residual over its standard error.
    white: Array<f64>,
}

/// The derivatives in one window.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct WindowRows {
    /// The free parameters of its record.
    free: Vec<usize>,
    /// Derivatives of the model at each sample, times its weight, by these parameters and by the initial
    /// angle and velocity.
    rows: Py<PyArray2<f64>>,
    residuals: Array<f64>,
    weights: Array<f64>,
}

impl FitPoint {
    fn new(py: Python<'_>, problem: &Problem, at: &Point) -> PyResult<Self> {
        let (information, pull) = at.normal.reduced(0.0);
        let window = |w: &Window| (w.record, w.from, w.to, w.start[0], w.start[1]);
        let runs =
            (0..problem.records.len()).map(|k| Py::new(py, FittedRun::new(py, problem, at, k)));
        Ok(Self {
            values: array(py, at.values.clone()),
            chi2: at.normal.chi2,
            samples: problem.samples(),
            degrees: at.degrees(problem),
            information: matrix(py, &information)?,
            pull: array(py, pull.as_slice().to_vec()),
            windows: at.windows.iter().map(window).collect(),
            runs: runs.collect::<PyResult<_>>()?,
        })
    }
}

impl FittedRun {
    fn new(py: Python<'_>, problem: &Problem, at: &Point, record: usize) -> Self {
        let mut curve = [(); 4].map(|()| vec![f64::NAN; problem.records[record].times.len()]);
        for (place, window) in at.windows.iter().enumerate().filter(|(_, w)| w.record == record) {
            let (apart, white) = (&at.normal.apart[place], &at.normal.white[place]);
            for (k, state) in at.normal.states[place].iter().enumerate() {
                let values = [state[0], state[1], apart[k], white[k]];
                for (column, value) in curve.iter_mut().zip(values) {
                    column[window.from + k] = value;
                }
            }
        }
        let [theta, velocity, residual, white] = curve.map(|column| array(py, column));
        Self { theta, velocity, residual, white }
    }
}

/// The best values of the free parameters, and derived results.
#[pyfunction]
#[pyo3(signature = (runs, free, choices, windows=None))]
pub fn fit_runs(
    py: Python<'_>,
    runs: Vec<Run<'_>>,
    free: Vec<FreeTuple>,
    choices: FitChoices,
    windows: Option<Vec<WindowTuple>>,
) -> PyResult<Py<Fit>> {
    let problem = problem(runs, &free, choices.tolerance)?;
    let given = windows.map(|given| self::windows(given, &problem)).transpose()?;
    let FitChoices { shortest, growth, steps, gain, hold, target, .. } = choices;
    let settings = Settings { shortest, growth, steps, gain, hold, target };
    let (found, ends) = pooled(py, 0, None, |control| {
        let found = fit(&problem, settings, given, control.flag())?;
        let level = choices.level * found.widening(&problem, choices.doubt);
        let ends = intervals(&problem, &found.point, &choices.profiled, level, control.flag())?;
        Ok((found, ends))
    })?;
    let own = Fit {
        covariance: matrix(py, &found.point.normal.covariance())?,
        intervals: ends.iter().map(|[a, b]| (*a, *b)).collect(),
        widening: found.widening(&problem, choices.doubt),
        steps: found.steps,
        stages: found.stages,
        converged: found.converged,
        given_up: found.given_up,
    };
    Py::new(py, (own, FitPoint::new(py, &problem, &found.point)?))
}

/// The derivatives at the starts of the free parameters and of the windows, window by window.
#[pyfunction]
pub fn fit_rows(
    py: Python<'_>,
    runs: Vec<Run<'_>>,
    free: Vec<FreeTuple>,
    tolerance: f64,
    windows: Vec<WindowTuple>,
) -> PyResult<Vec<WindowRows>> {
    let problem = problem(runs, &free, tolerance)?;
    let windows = self::windows(windows, &problem)?;
    let all = pooled(py, 0, None, |_| {
        linearised(&problem, &problem.start(), &windows).ok_or(Error::Diverges)
    })?;
    let each = all.into_iter().zip(&windows).map(|(linear, window)| {
        let rows = linear.rows.into_pyarray(py).reshape([linear.residuals.len(), linear.width])?;
        Ok(WindowRows {
            free: problem.columns(window.record).places().collect(),
            rows: rows.unbind(),
            residuals: array(py, linear.residuals),
            weights: array(py, linear.weights),
        })
    });
    each.collect()
}

/// Readings of the record's sensor of the angle at `times` from each start, all at the first of
/// these: a row for each.
#[pyfunction]
#[pyo3(signature = (run, theta, velocity, times, tolerance, threads, progress=None))]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
pub fn replay<'py>(
    py: Python<'py>,
    run: Run<'py>,
    theta: Floats<'py>,
    velocity: Floats<'py>,
    times: Floats<'py>,
    tolerance: f64,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let record = run.record()?;
    let starts = states(&theta, &velocity)?;
    let times = times.as_slice()?.to_vec();
    reckon("readings", starts.len().saturating_mul(times.len()), EACH_READING)?;
    let all = pooled(py, threads, progress.as_ref(), |control| {
        control.begin(starts.len());
        let done = || control.add(1);
        replayed(&record, &starts, &times, tolerance, control.flag(), &done)
    })?;
    let flat: Vec<f64> = all.into_iter().flatten().collect();
    flat.into_pyarray(py).reshape([starts.len(), times.len()])
}

fn matrix(py: Python<'_>, matrix: &DMatrix<f64>) -> PyResult<Py<PyArray2<f64>>> {
    let rows: Vec<Vec<f64>> = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    Ok(PyArray2::from_vec2(py, &rows)?.unbind())
}
