//! Bindings of branches of orbits along a parameter.

use numpy::PyArray2;
use pendmap::continuation::branch::Bounds;
use pendmap::continuation::course::{Course, Law};
use pendmap::continuation::cycle::{Closure, Orbit};
use pendmap::continuation::event::Event;
use pendmap::error::Error;
use pendmap::maps::branches::{Branches as Found, Request, branches as search};
use pendmap::model::Parameter;
use pyo3::prelude::*;

use super::convert::{Array, array};
use super::long_calls::interruptible;
use super::model::Model;
use super::raise;

/// Branches as columns: of the branches, of their orbits, of the points of those, and of what happens.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct Continuation {
    /// Of each branch: period, net turns, whether the orbits are their own mirror images, why it ends on both sides, the
    /// event that either end is at and the branch of the mirror images, -1 where there is none.
    n: Array<i32>,
    w: Array<i32>,
    symmetric: Vec<bool>,
    ends: Vec<(&'static str, &'static str)>,
    meets: Vec<(i32, i32)>,
    twin: Array<i32>,
    /// Of each orbit: its branch, the coordinate, real and imaginary parts of its two multipliers, its slips and sticks.
    orbit_branch: Array<i32>,
    value: Array<f64>,
    multipliers: Py<PyArray2<f64>>,
    phases: Vec<String>,
    /// Of each point: its orbit, angle and velocity.
    point_orbit: Array<i32>,
    theta: Array<f64>,
    velocity: Array<f64>,
    /// Of each event: its kind, its orbit, 1 where it is supercritical, 0 where subcritical, -1 where that has no meaning.
    event_kind: Vec<&'static str>,
    event_orbit: Array<i32>,
    supercritical: Array<i32>,
    smooth: Vec<bool>,
    /// Coordinates at which orbits were searched, and how many were found.
    sections: Vec<(f64, usize)>,
}

/// All branches of orbits of period `n` and winding `w`, up to the period `longest`, along parameters: each with its
/// values at places in the range, whose ends are the first and the last place. With `start`, an angle, a velocity and a
/// coordinate, the one branch through the orbit that Newton's method finds from there.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
#[pyo3(signature = (model, along, winding, longest, start, threads, progress=None))]
pub fn continuation(
    py: Python<'_>,
    model: Model,
    along: (Vec<f64>, Vec<(String, Vec<f64>)>),
    winding: (usize, i64),
    longest: usize,
    start: Option<(f64, f64, f64)>,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Continuation> {
    let base = model.pendulum()?;
    let (places, parameters) = along;
    let one = |(name, values): (String, Vec<f64>)| -> Result<(Parameter, Law), Error> {
        Ok((base.parameter(&name)?, Law::through(&places, &values)?))
    };
    let axis = parameters.into_iter().map(one).collect::<Result<_, Error>>().map_err(raise)?;
    let [low, high] = [places.first(), places.last()].map(|end| end.copied().unwrap_or(f64::NAN));
    let course = Course { base, axes: vec![axis] };
    let (n, w) = winding;
    let start = start.map(|(theta, velocity, at)| ([theta, velocity], at));
    let request = Request { n, w, longest, start, threads };
    let found = interruptible(py, progress.as_ref(), |control| {
        search(&course, Bounds { low, high }, &request, control)
    })?;
    Continuation::new(py, &found)
}

impl Continuation {
    fn new(py: Python<'_>, found: &Found) -> PyResult<Self> {
        let family = &found.family;
        let all = &family.branches;
        let angle = family.course.base.angle();
        let whole = |numbers: Vec<usize>| numbers.into_iter().map(|x| x as i32).collect::<Vec<_>>();
        // Numbers of the first orbit and event of each branch.
        let first = |count: fn(&pendmap::continuation::family::Branch) -> usize| {
            let counts = all.iter().map(count);
            counts.scan(0, |sum, count| Some(std::mem::replace(sum, *sum + count))).collect()
        };
        let orbits: Vec<usize> = first(|branch| branch.run.orbits.len());
        let events: Vec<usize> = first(|branch| branch.run.events.len());
        let meets = |of: Option<(usize, usize)>| {
            of.map_or(-1, |(branch, event)| (events[branch] + event) as i32)
        };
        let (mut owner, mut value, mut multipliers, mut phases) = (vec![], vec![], vec![], vec![]);
        let (mut point_orbit, mut theta, mut velocity) = (vec![], vec![], vec![]);
        for (number, branch) in all.iter().enumerate() {
            let cycles = family.cycles(branch.of);
            let mut add = |orbit: &Orbit| {
                let pairs = cycles.multipliers(orbit).0;
                multipliers.push(pairs.iter().flat_map(|m| [m.re, m.im]).collect::<Vec<f64>>());
                phases.push(orbit.phases.iter().map(|phase| phase.sign()).collect::<String>());
                for point in cycles.all_points(&orbit.place) {
                    point_orbit.push(owner.len() as i32);
                    theta.push(angle.wrapped(point[0]));
                    velocity.push(point[1]);
                }
                owner.push(number as i32);
                value.push(cycles.at(&orbit.place));
            };
            branch.run.orbits.iter().for_each(&mut add);
        }
        let happens: Vec<(usize, &Event)> = all
            .iter()
            .zip(&orbits)
            .flat_map(|(branch, first)| branch.run.events.iter().map(move |e| (first + e.orbit, e)))
            .collect();
        let sign = |known: Option<bool>| known.map_or(-1, i32::from);
        Ok(Self {
            n: array(py, whole(all.iter().map(|branch| branch.of.n).collect())),
            w: array(py, all.iter().map(|branch| branch.of.w as i32).collect()),
            symmetric: all.iter().map(|branch| branch.of.closure != Closure::Whole).collect(),
            ends: all.iter().map(|b| (b.ends[0].words(), b.ends[1].words())).collect(),
            meets: all.iter().map(|b| (meets(b.meets[0]), meets(b.meets[1]))).collect(),
            twin: array(py, all.iter().map(|b| b.twin.map_or(-1, |t| t as i32)).collect()),
            orbit_branch: array(py, owner),
            value: array(py, value),
            multipliers: PyArray2::from_vec2(py, &multipliers)?.unbind(),
            phases,
            point_orbit: array(py, point_orbit),
            theta: array(py, theta),
            velocity: array(py, velocity),
            event_kind: happens.iter().map(|(_, event)| event.kind.word()).collect(),
            event_orbit: array(py, whole(happens.iter().map(|(orbit, _)| *orbit).collect())),
            supercritical: array(py, happens.iter().map(|(_, e)| sign(e.supercritical)).collect()),
            smooth: happens.iter().map(|(_, event)| event.smooth).collect(),
            sections: found.sections.clone(),
        })
    }
}
