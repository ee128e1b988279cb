//! All branches of orbits of one type along a parameter.
//!
//! Orbits are searched as by [`super::orbits`] at sections of the range, each in the largest gap that the golden section
//! leaves. A branch is followed through each orbit that none passes through yet, until several sections in a row have
//! had none. What a branch sheds is followed too.

use super::control::Control;
use super::orbits::{self, LONGEST, Request as Search};
use super::starts::Axis;
use crate::continuation::branch::Bounds;
use crate::continuation::course::Course;
use crate::continuation::family::Family;
use crate::error::Error;
use crate::integrate::State;
use crate::model::Pendulum;
use crate::orbit::{PoincareMap, newton};

/// Sections at least, at most, and in a row without a new branch.
const LEAST: usize = 5;
const MOST: usize = 40;
const QUIET: usize = 3;
/// Cells along a side of the box of a search, a period, and periods counted.
const CELLS: usize = 200;
const FINER: usize = 4;
/// Largest distance of Newton's method from a given start.
const REACH: f64 = 0.5;

/// A request for branches.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Smallest period of the orbits searched, in forcing periods.
    pub n: usize,
    /// Net turns over it.
    pub w: i64,
    /// Longest period of the orbits of branches that are begun at doublings.
    pub longest: usize,
    /// A state from which Newton's method finds the one orbit to be followed, at the course's own pendulum and this
    /// coordinate; none for all.
    pub start: Option<(State, f64)>,
    /// Workers; 0 for one a processor.
    pub threads: usize,
}

/// Branches, and what was searched for them.
#[derive(Clone, Debug)]
pub struct Branches {
    /// The branches.
    pub family: Family,
    /// The sections, and the number of orbits found at each.
    pub sections: Vec<(f64, usize)>,
}

/// All branches of a type in the range.
///
/// # Errors
/// [`Error::Range`] for a number out of its range, [`Error::NotMappable`] for effects that a map cannot have,
/// [`Error::NoOrbit`] if Newton's method finds none from the start, [`Error::Interrupted`] if `control` was cancelled.
pub fn branches(
    course: &Course,
    bounds: Bounds,
    request: &Request,
    control: &Control,
) -> Result<Branches, Error> {
    for (name, value) in [("n", request.n), ("longest", request.longest)] {
        if !(1..=LONGEST).contains(&value) {
            let allowed = "a whole number from 1 to 64";
            return Err(Error::Range { name, value: value as f64, allowed });
        }
    }
    let mut family = Family::new(course.clone(), bounds, request.longest)?;
    let mut sections = Vec::new();
    if let Some((start, at)) = request.start {
        let map = PoincareMap::new(&family.pendulum(at));
        let found = newton::find(&map, start, request.n, REACH);
        let orbit = found.ok_or(Error::NoOrbit { n: request.n, start })?;
        family.add(&orbit, at, control.flag())?;
        family.mirror();
        return Ok(Branches { family, sections });
    }
    let mut quiet = 0;
    for k in 0..MOST {
        if k >= LEAST && quiet >= QUIET {
            break;
        }
        control.check()?;
        let part = (0.5 + 0.618_033_988_749_895 * k as f64).fract();
        let at = bounds.low + part * (bounds.high - bounds.low);
        let pendulum = family.pendulum(at);
        let found = orbits::orbits(&pendulum, &window(&pendulum, request)?, control)?.closed;
        let mut new = false;
        for orbit in &found {
            if !family.passes(orbit, at) {
                new |= family.add(orbit, at, control.flag())?;
            }
        }
        sections.push((at, found.len()));
        quiet = if new { 0 } else { quiet + 1 };
    }
    family.mirror();
    Ok(Branches { family, sections })
}

/// The box of a search: velocities to that of the rotation and of a fall from the top under the drive's largest
/// acceleration.
fn window(pendulum: &Pendulum, request: &Request) -> Result<Search, Error> {
    let Request { n, w, threads, .. } = *request;
    let turning = w.unsigned_abs() as f64 / n as f64 * std::f64::consts::TAU / pendulum.period();
    let reach = turning + 2.0 * (1.0 + pendulum.drive.p.abs()).sqrt();
    let cells = CELLS * n.min(FINER);
    let pi = std::f64::consts::PI;
    let theta = Axis::new("theta", -pi, pi, cells)?;
    let velocity = Axis::new("velocity", -reach, reach, cells)?;
    Ok(Search { n, w, theta, velocity, threads })
}
