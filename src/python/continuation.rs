//! Bindings of branches of orbits along a parameter.

use numpy::PyArray2;
use pendmap::attractor::Kind;
use pendmap::continuation::branch::Bounds;
use pendmap::continuation::course::{Course, Law};
use pendmap::continuation::cycle::{Closure, Orbit};
use pendmap::continuation::event::Event;
use pendmap::continuation::family::Branch;
use pendmap::error::Error;
use pendmap::maps::branches::{Branches as Found, Request, Sought, branches as search};
use pendmap::model::Parameter;
use pyo3::prelude::*;

use super::convert::{Array, array};
use super::long_calls::interruptible;
use super::model::Model;
use super::raise;

/// A velocity below this is rest.
const STILL: f64 = 1e-9;

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
    /// Its amplitude, not a number for a rotation, and how often it swings to and fro.
    amplitude: Array<f64>,
    swings: Array<i32>,
    /// Of each point: its orbit, angle and velocity.
    point_orbit: Array<i32>,
    theta: Array<f64>,
    velocity: Array<f64>,
    /// Of each event: its kind, its orbit, 1 where it is supercritical, 0 where subcritical, -1 where that has no meaning.
    event_kind: Vec<&'static str>,
    event_orbit: Array<i32>,
    supercritical: Array<i32>,
    smooth: Vec<bool>,
    /// Of each branch the kind of its orbits; of each region, where all were searched, its ends; its stable orbits, each
    /// by region and branch.
    kind: Vec<&'static str>,
    regions: Vec<(f64, f64)>,
    stable: Vec<(i32, i32)>,
    /// Coordinates at which orbits were searched, and how many were found.
    sections: Vec<(f64, usize)>,
}

/// All branches of orbits of a period and a winding, or of all up to the period, and up to `longest` what is born there, along parameters: each with its
/// values at places in the range, whose ends are the first and the last place. With `starts`, angles, velocities, periods and
/// coordinates, the branches through the orbits that Newton's method finds from there.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
#[pyo3(signature = (model, along, sought, longest, starts, threads, progress=None))]
pub fn continuation(
    py: Python<'_>,
    model: Model,
    along: (Vec<f64>, Vec<(String, Vec<f64>)>),
    sought: (usize, Option<i64>),
    longest: usize,
    starts: Option<Vec<(f64, f64, usize, f64)>>,
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
    let course = Course::new(base, vec![axis]);
    let (n, w) = sought;
    let sought = match (starts, w) {
        (Some(starts), _) => {
            Sought::Near(starts.into_iter().map(|(theta, v, n, at)| ([theta, v], n, at)).collect())
        }
        (None, Some(w)) => Sought::Type(n, w),
        (None, None) => Sought::UpTo(n),
    };
    let request = Request { sought, longest, threads };
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
        let first = |count: fn(&Branch) -> usize| {
            let counts = all.iter().map(count);
            counts.scan(0, |sum, count| Some(std::mem::replace(sum, *sum + count))).collect()
        };
        let orbits: Vec<usize> = first(|branch| branch.run.orbits.len());
        let events: Vec<usize> = first(|branch| branch.run.events.len());
        let meets = |of: Option<(usize, usize)>| {
            of.map_or(-1, |(branch, event)| (events[branch] + event) as i32)
        };
        let (mut owner, mut value, mut multipliers, mut phases) = (vec![], vec![], vec![], vec![]);
        let (mut amplitude, mut swings) = (vec![], vec![]);
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
                let (reach, count) = cycles.swing(orbit).unwrap_or((f64::NAN, 0));
                amplitude.push(reach);
                swings.push(count as i32);
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
        let kind = |branch: &Branch| {
            let cycles = family.cycles(branch.of);
            let orbits = &branch.run.orbits;
            let points = cycles.all_points(&orbits[orbits.len() / 2].place);
            let still = points.iter().all(|point| point[1].abs() < STILL);
            match (branch.of.w, still, points[0][0].cos() > 0.0) {
                (0, true, true) => Kind::Rest,
                (0, true, false) => Kind::InvertedRest,
                (0, false, _) => Kind::Oscillation,
                _ => Kind::Rotation,
            }
        };
        let stable = found.regions.iter().enumerate();
        let stable = stable.flat_map(|(k, region)| {
            region.stable.iter().map(move |branch| (k as i32, *branch as i32))
        });
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
            amplitude: array(py, amplitude),
            swings: array(py, swings),
            point_orbit: array(py, point_orbit),
            theta: array(py, theta),
            velocity: array(py, velocity),
            event_kind: happens.iter().map(|(_, event)| event.kind.word()).collect(),
            event_orbit: array(py, whole(happens.iter().map(|(orbit, _)| *orbit).collect())),
            supercritical: array(py, happens.iter().map(|(_, e)| sign(e.supercritical)).collect()),
            smooth: happens.iter().map(|(_, event)| event.smooth).collect(),
            kind: all.iter().map(|branch| kind(branch).word()).collect(),
            regions: found.regions.iter().map(|region| (region.from, region.to)).collect(),
            stable: stable.collect(),
            sections: found.sections.clone(),
        })
    }
}
