//! All branches of orbits of one type, or of all types up to a period, along a parameter.
//!
//! Orbits are searched as by `every_orbit` at sections of the range: in its middle, beside its ends, where every branch
//! ends that does not end within, then each in the largest gap that the golden section leaves. A branch is followed through each orbit that none passes through yet, until several sections in a row have
//! had none. What a branch sheds is followed too.

use super::control::Control;
use super::every_orbit::{ANY_TURNS, of_types};
use super::orbits::{LONGEST, MOST_CELLS};
use crate::continuation::branch::Bounds;
use crate::continuation::course::Course;
use crate::continuation::family::Family;
use crate::continuation::regions::Region;
use crate::error::Error;
use crate::integrate::State;
use crate::model::Pendulum;
use crate::model::pendulum::Symmetry;
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit, SAME};

/// Sections at least, at most, and in a row without a new branch.
const LEAST: usize = 6;
const MOST: usize = 40;
const QUIET: usize = 3;
/// Distance of the sections beside the ends from these, in parts of the range.
const EDGE: f64 = 1e-3;
/// Largest distance of Newton's method from a given start.
const REACH: f64 = 0.5;

/// The orbits that are searched.
#[derive(Clone, Debug)]
pub enum Sought {
    /// Those of this smallest period, in forcing periods, and these net turns over it.
    Type(usize, i64),
    /// All up to this period, with the mirror images of those that turn.
    UpTo(usize),
    /// Those that Newton's method finds from these states, with their periods and coordinates.
    Near(Vec<(State, usize, f64)>),
}

/// A request for branches.
#[derive(Clone, Debug)]
pub struct Request {
    /// The orbits searched.
    pub sought: Sought,
    /// Longest period of the orbits of branches that are begun at doublings.
    pub longest: usize,
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
    /// The regions with the same stable orbits; none where not all were searched.
    pub regions: Vec<Region>,
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
    let n = match &request.sought {
        Sought::Type(n, _) | Sought::UpTo(n) => *n,
        Sought::Near(starts) => starts.iter().map(|(_, n, _)| *n).max().unwrap_or(1),
    };
    for (name, value) in [("n", n), ("longest", request.longest)] {
        if !(1..=LONGEST).contains(&value) {
            let allowed = "a whole number from 1 to 64";
            return Err(Error::Range { name, value: value as f64, allowed });
        }
    }
    let mut family = Family::new(course.clone(), bounds, request.longest)?;
    let mut sections = Vec::new();
    if let Sought::Near(starts) = &request.sought {
        for &(start, n, at) in starts {
            let map = PoincareMap::new(&family.pendulum(at));
            let found = newton::find(&map, start, n, REACH);
            if let Some(orbit) = found.filter(|orbit| !family.passes(orbit, at)) {
                family.add(&orbit, at, control.flag())?;
            }
        }
        if let (true, Some(&(start, n, _))) = (family.branches.is_empty(), starts.first()) {
            return Err(Error::NoOrbit { n, start });
        }
        family.mirror(false);
        return Ok(Branches { family, sections, regions: Vec::new() });
    }
    let mut quiet = 0;
    for k in 0..MOST {
        if k >= LEAST && quiet >= QUIET {
            break;
        }
        control.check()?;
        let part = match k {
            0 => 0.5,
            1 => EDGE,
            2 => 1.0 - EDGE,
            _ => (0.5 + 0.618_033_988_749_895 * (k - 2) as f64).fract(),
        };
        let at = bounds.low + part * (bounds.high - bounds.low);
        let found = orbits(&family.pendulum(at), request, family.symmetry, control)?;
        let mut new = false;
        for orbit in &found {
            if !family.passes(orbit, at) {
                new |= family.add(orbit, at, control.flag())?;
            }
        }
        sections.push((at, found.len()));
        quiet = if new { 0 } else { quiet + 1 };
    }
    let all = matches!(request.sought, Sought::UpTo(_));
    family.mirror(all);
    let regions = if all { family.regions() } else { Vec::new() };
    Ok(Branches { family, sections, regions })
}

/// The orbits searched, at one section; of mirror images of all one.
fn orbits(
    pendulum: &Pendulum,
    request: &Request,
    symmetry: Option<Symmetry>,
    control: &Control,
) -> Result<Vec<PeriodicOrbit>, Error> {
    let types: Vec<_> = match &request.sought {
        Sought::Type(n, w) => vec![(*n, [*w; 2])],
        Sought::UpTo(most) => (1..=*most).map(|n| (n, ANY_TURNS)).collect(),
        Sought::Near(_) => Vec::new(),
    };
    let mirrored = symmetry == Some(Symmetry::AtOnce) && types.iter().all(|(_, [a, b])| *a == -b);
    let mut all = of_types(pendulum, &types, mirrored, MOST_CELLS, request.threads, control)?;
    // Where nothing drives the pendulum, orbits close after a given time only by coincidence.
    let rests = |orbit: &PeriodicOrbit| orbit.points[0][1].abs() < SAME;
    all.retain(|orbit| {
        let asked = |(n, [least, most]): &(usize, [i64; 2])| {
            *n == orbit.n && (*least..=*most).contains(&orbit.w)
        };
        types.iter().any(asked) && (!pendulum.is_autonomous() || rests(orbit))
    });
    Ok(all)
}

/// The velocity of a fall from the top under the drive's largest acceleration.
pub(super) fn falling(pendulum: &Pendulum) -> f64 {
    2.0 * (1.0 + pendulum.drive.p.abs()).sqrt()
}
