//! Bindings of periodic orbits.

use std::sync::atomic::AtomicBool;

use pendmap::attractor;
use pendmap::attractor::catalogue::arrange;
use pendmap::continuation::branch::Bounds;
use pendmap::continuation::course::{Course, Law};
use pendmap::continuation::family::Family;
use pendmap::error::Error;
use pendmap::integrate::{State, Strobe};
use pendmap::lanes::InstructionSet;
use pendmap::maps::orbits::{Request, orbits as search};
use pendmap::orbit::symmetry::Mirror;
use pendmap::orbit::{PoincareMap, newton};
use pyo3::prelude::*;

use super::convert::Attractor;
use super::long_calls::interruptible;
use super::maps::{AxisTuple, axes};
use super::model::Model;
use super::raise;

/// A periodic orbit.
#[pyclass(frozen, get_all, extends = Attractor, module = "pendmap._core")]
pub struct Orbit {
    /// Its residual, the distance by which it fails to close.
    residual: f64,
    stable: bool,
}

/// The periodic orbits found by a search.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct OrbitSearch {
    orbits: Vec<Py<Orbit>>,
    /// States from which Newton's method began.
    begun: usize,
    /// Whether the pendulum has friction.
    friction: bool,
}

/// All periodic orbits of period `n` and winding `w` in a box, and the starting points of the
/// search.
#[pyfunction]
#[pyo3(signature = (model, winding, theta, velocity, threads, progress=None))]
pub fn orbits(
    py: Python<'_>,
    model: Model,
    winding: (usize, i64),
    theta: AxisTuple,
    velocity: AxisTuple,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<OrbitSearch> {
    let pendulum = model.pendulum()?;
    let [theta, velocity] = axes(theta, velocity)?;
    let request = Request { n: winding.0, w: [winding.1; 2], theta, velocity, threads };
    let found =
        interruptible(py, progress.as_ref(), |control| search(&pendulum, &request, control))?;
    let closed = found.closed.iter().map(|orbit| attractor::Attractor::periodic(&pendulum, orbit));
    let all: Vec<attractor::Attractor> =
        closed.chain(found.running.iter().map(attractor::Attractor::running)).collect();
    let (all, place) = arrange(&pendulum, all);
    let mut residuals = vec![0.0; all.len()];
    for (orbit, at) in found.closed.iter().zip(&place) {
        residuals[*at] = orbit.residual;
    }
    let listed = all.iter().zip(residuals).map(|(orbit, residual)| {
        let own = Orbit { residual, stable: orbit.is_stable(&pendulum) };
        Py::new(py, (own, Attractor::new(orbit, f64::NAN)))
    });
    Ok(OrbitSearch {
        orbits: listed.collect::<PyResult<_>>()?,
        begun: found.begun,
        friction: pendulum.has_friction(),
    })
}

/// Largest distance of Newton's method from where it begins.
const REACH: f64 = 0.3;

/// Turns, points of a periodic orbit.
type Near = (i64, Vec<(f64, f64)>);

/// The periodic orbits at the end of a line in the space of parameters, each with its two values, that continue orbits at
/// its beginning, each given by a state of it, its period n and whether it is its own mirror image (none where that has
/// no meaning). Where Newton's method finds no orbit of that period from there, or one of another symmetry or on
/// the other side ([`Mirror::continues`]), the branch is followed; none where it turns back or ends. They are orbits of
/// `steps` integration steps a period, with their error.
#[pyfunction]
pub fn orbits_near(
    py: Python<'_>,
    model: Model,
    along: Vec<(String, f64, f64)>,
    steps: usize,
    states: Vec<(f64, f64, usize, Option<bool>)>,
) -> PyResult<Vec<Option<Near>>> {
    let base = model.pendulum()?;
    let law = |(name, from, to): (String, f64, f64)| {
        Ok((base.parameter(&name)?, Law::Quadratic([from, to - from, 0.0])))
    };
    let axis = along.into_iter().map(law).collect::<Result<_, Error>>().map_err(raise)?;
    let course = Course::new(base, vec![axis]);
    let simd = InstructionSet::choose().map_err(raise)?;
    Ok(py.detach(|| {
        let pendulum = course.pendulum(&[1.0]);
        let map = PoincareMap::of_steps(&Strobe::new(&pendulum, steps, simd));
        let mirror = Mirror::of(&pendulum);
        let bounds = Bounds { low: 0.0, high: 1.0 };
        let carried = |start: State, n: usize| {
            let before =
                newton::find(&PoincareMap::new(&course.pendulum(&[0.0])), start, n, REACH)?;
            let family = Family::new(course.clone(), bounds, n).ok()?;
            family.carried(&before, &AtomicBool::new(false))
        };
        let near = |&(theta, velocity, n, symmetric): &(f64, f64, usize, Option<bool>)| {
            let from = |start: State| {
                let orbit = newton::find(&map, start, n, REACH).filter(|o| o.n == n)?;
                let continues =
                    mirror.as_ref().is_none_or(|m| m.continues(&orbit, start, symmetric));
                let points = || orbit.points.iter().map(|p| (p[0], p[1])).collect();
                continues.then(|| (orbit.w, points()))
            };
            let start = [theta, velocity];
            from(start).or_else(|| from(carried(start, n)?))
        };
        states.iter().map(near).collect()
    }))
}
