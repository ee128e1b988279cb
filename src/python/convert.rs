//! Results as Python dictionaries of numpy arrays and numbers.

use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::attractor::Attractor;
use crate::integrate::trajectory::Trajectory;
use crate::maps::basins::{BasinMap, Plane};
use crate::maps::texture::Texture;
use crate::maps::uncertainty::Uncertainty;

pub fn basin_map<'py>(py: Python<'py>, map: BasinMap) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let attractors = PyList::empty(py);
    for (attractor, fraction) in map.attractors.iter().zip(&map.fractions) {
        attractors.append(attractor_dict(py, attractor, *fraction)?)?;
    }
    dict.set_item("attractors", attractors)?;
    dict.set_item("undecided", if map.plane == Plane::Conservative { 1.0 } else { map.share(0) })?;
    dict.set_item("failed", map.share(-1))?;
    dict.set_item("mean_periods", map.mean_periods())?;
    let plane = match map.plane {
        Plane::Basins => "basins",
        Plane::Conservative => "conservative",
        Plane::OnlyChaos => "only_chaos",
    };
    dict.set_item("plane", plane)?;
    dict.set_item("chaos_bound", map.chaos_bound)?;
    dict.set_item("searched_starts", map.searched)?;
    dict.set_item("layer_periods", map.layer_periods)?;
    dict.set_item("bound", map.bound)?;
    dict.set_item("steps_per_period", map.steps)?;
    dict.set_item("reached_error", map.reached_error)?;
    dict.set_item("simd", map.path.name())?;
    texture(&dict, &map.texture)?;
    let Uncertainty { eps, uncertain, tried } = map.uncertainty.unwrap_or_default();
    dict.set_item("uncertainty_eps", eps.into_pyarray(py))?;
    dict.set_item("uncertain", uncertain.into_pyarray(py))?;
    dict.set_item("uncertainty_tried", tried.into_pyarray(py))?;
    dict.set_item("unreliable", map.reliability.either)?;
    dict.set_item("unreliable_half_step", map.reliability.half_step)?;
    dict.set_item("unreliable_mirror", map.reliability.mirror)?;
    dict.set_item("labels_sampled", map.reliability.sampled)?;
    dict.set_item("label", map.labels.label.into_pyarray(py))?;
    dict.set_item("settle", map.labels.settle.into_pyarray(py))?;
    dict.set_item("turns", map.labels.turns.into_pyarray(py))?;
    let exponent = map.layers.map(|layers| layers.exponent.into_pyarray(py));
    dict.set_item("finite_time_exponent", exponent)?;
    Ok(dict)
}

pub fn texture(dict: &Bound<'_, PyDict>, texture: &Texture) -> PyResult<()> {
    dict.set_item("basin_entropy", texture.basin_entropy)?;
    dict.set_item("boundary_basin_entropy", texture.boundary_basin_entropy)?;
    dict.set_item("boundary_stderr", texture.boundary_stderr)?;
    dict.set_item("boxes", texture.boxes)?;
    dict.set_item("boundary_boxes", texture.boundary_boxes)?;
    dict.set_item("neighbours_agree", texture.neighbours_agree)?;
    dict.set_item("chance", texture.chance)
}

pub fn attractor_dict<'py>(
    py: Python<'py>,
    attractor: &Attractor,
    fraction: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("name", &attractor.name)?;
    dict.set_item("kind", attractor.kind.word())?;
    dict.set_item("n", attractor.n)?;
    dict.set_item("w", attractor.w)?;
    dict.set_item("points", attractor.points.iter().map(|p| (p[0], p[1])).collect::<Vec<_>>())?;
    let pairs: Vec<(f64, f64)> = attractor.multipliers.iter().map(|m| (m.re, m.im)).collect();
    dict.set_item("multipliers", pairs)?;
    dict.set_item("exponent", attractor.exponent)?;
    dict.set_item("exponent_stderr", attractor.exponent_stderr)?;
    dict.set_item("period", attractor.period)?;
    dict.set_item("twin", attractor.twin.map(|t| t + 1))?;
    dict.set_item("fraction", fraction)?;
    Ok(dict)
}

pub fn trajectory<'py>(py: Python<'py>, run: Trajectory) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("time", run.time.into_pyarray(py))?;
    dict.set_item("theta", run.theta.into_pyarray(py))?;
    dict.set_item("velocity", run.velocity.into_pyarray(py))?;
    dict.set_item("reached_error", run.reached_error)?;
    dict.set_item("end_error", run.end_error)?;
    dict.set_item("steps_per_period", run.steps)?;
    dict.set_item("exponent", run.exponent)?;
    dict.set_item("stuck", run.stuck)?;
    dict.set_item("interrupted", run.interrupted)?;
    let events = &run.events;
    let times: Vec<f64> = events.iter().map(|event| event.tau).collect();
    let thetas: Vec<f64> = events.iter().map(|event| event.theta).collect();
    dict.set_item("event_time", times.into_pyarray(py))?;
    dict.set_item("event_theta", thetas.into_pyarray(py))?;
    dict.set_item("event_kind", events.iter().map(|e| e.kind.words()).collect::<Vec<_>>())?;
    Ok(dict)
}
