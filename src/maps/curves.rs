//! The bifurcation set of a plane: curves of folds, doublings, symmetry breakings and changes of slips and sticks.
//!
//! Branches are followed along sections of the plane: first along its edges, where every curve ends that does not end within,
//! then in both directions in turn, each in the largest gap that the golden section leaves. On a section all orbits are
//! searched at some places, as by `every_orbit`. Each event on their branches is a point of a curve, which is followed
//! if none passes there yet, until sections in a row have had no new one.

use super::control::Control;
use super::every_orbit::every_orbit;
use crate::continuation::branch::Bounds;
use crate::continuation::course::Course;
use crate::continuation::event::Kind;
use crate::continuation::family::Family;
use crate::continuation::plane::{Plane, Seed};
use crate::error::Error;
use crate::orbit::PeriodicOrbit;

/// Sections at least, at most, and in a row without a new curve.
const LEAST: usize = 6;
const MOST: usize = 9;
const QUIET: usize = 2;
/// Distance of the first sections from the edges.
const EDGE: f64 = 1e-3;
/// Places along a section at which orbits are searched: at least, at most, and in a row without a new branch.
const PLACES: [usize; 3] = [4, 8, 2];
/// Lengths of steps, in units of the fastest small oscillation, of curves and of what they are begun from: they err by 1e-11
/// and 1e-9 in a few periods.
const STEP: f64 = 0.055;
const SEED_STEP: f64 = 0.085;
/// The longest period of a request.
const LONGEST: usize = 16;
/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A request for curves.
#[derive(Clone, Debug)]
pub struct Request {
    /// Longest period of orbits.
    pub longest: usize,
    /// Periods and net turns of the orbits that are searched and whose curves are followed; none for all.
    pub only: Option<Vec<(usize, i64)>>,
    /// Workers; 0 for one a processor.
    pub threads: usize,
}

/// Where orbits were searched.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// The coordinate that is held there, 0 or 1, and its value.
    pub held: (usize, f64),
    /// Places at which orbits were searched.
    pub places: usize,
    /// Orbits found.
    pub orbits: usize,
    /// New curves.
    pub new: usize,
}

/// Curves, and what was searched for them.
#[derive(Clone, Debug)]
pub struct Curves {
    /// The curves.
    pub plane: Plane,
    /// The sections.
    pub sections: Vec<Section>,
}

/// The curves in the plane of a course of two coordinates, which run from 0 to 1.
///
/// # Errors
/// [`Error::Range`] for a number out of its range, [`Error::NotMappable`] for effects that a map cannot have,
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn curves(course: &Course, request: &Request, control: &Control) -> Result<Curves, Error> {
    let longest = request.longest;
    if !(1..=LONGEST).contains(&longest) {
        let allowed = "a whole number from 1 to 16";
        return Err(Error::Range { name: "longest", value: longest as f64, allowed });
    }
    let mut found =
        Curves { plane: Plane::new(course.clone().by(STEP), longest)?, sections: Vec::new() };
    let mut quiet = 0;
    control.begin(MOST);
    for k in 0..MOST {
        if k >= LEAST && quiet >= QUIET {
            break;
        }
        let section = found.search(section(k), request, control)?;
        quiet = if section.new > 0 { 0 } else { quiet + 1 };
        found.sections.push(section);
        control.add(1);
    }
    Ok(found)
}

/// The coordinate held on a section, and its value: the edges first, where all curves end that do not end within.
fn section(k: usize) -> (usize, f64) {
    match k {
        0 => (1, 1.0 - EDGE),
        1 => (0, 1.0 - EDGE),
        2 => (1, EDGE),
        3 => (0, EDGE),
        _ => (1 - k % 2, (0.5 + GOLDEN * ((k - 4) / 2) as f64).fract()),
    }
}

impl Curves {
    /// Searches one section.
    fn search(
        &mut self,
        held: (usize, f64),
        request: &Request,
        control: &Control,
    ) -> Result<Section, Error> {
        let axis = 1 - held.0;
        let course = self.plane.course.along(axis, held.1).by(SEED_STEP);
        let mut family = Family::new(course, Bounds { low: 0.0, high: 1.0 }, request.longest)?;
        let mut section = Section { held, places: 0, orbits: 0, new: 0 };
        let [least, most, quiet] = PLACES;
        let mut idle = 0;
        for k in 0..most {
            if k >= least && idle >= quiet {
                break;
            }
            let at = (0.5 + GOLDEN * k as f64).fract();
            let known = family.branches.len();
            let pendulum = family.pendulum(at);
            let all = every_orbit(&pendulum, request.longest, request.threads, control)?;
            let wants = |orbit: &&PeriodicOrbit| {
                request.only.as_ref().is_none_or(|types| types.contains(&(orbit.n, orbit.w)))
            };
            for orbit in all.iter().filter(wants) {
                section.orbits += 1;
                if !family.passes(orbit, at) {
                    family.add(orbit, at, control.flag())?;
                }
            }
            section.places += 1;
            idle = if family.branches.len() > known { 0 } else { idle + 1 };
        }
        section.new = self.add(&family, (axis, held.1), control)?;
        Ok(section)
    }

    /// Adds the curves through the events of the branches; the number of new ones.
    pub(super) fn add(
        &mut self,
        family: &Family,
        (axis, held): (usize, f64),
        control: &Control,
    ) -> Result<usize, Error> {
        let before = self.plane.curves.len();
        for branch in &family.branches {
            let cycles = family.cycles(branch.of);
            for event in &branch.run.events {
                // What a jump of a multiplier does is said by the curve of the jump.
                if event.smooth == event.kind.is_of_friction() || event.kind == Kind::NeimarkSacker
                {
                    continue;
                }
                let orbit = &branch.run.orbits[event.orbit];
                let mut at = [held; 2];
                at[axis] = cycles.at(&orbit.place);
                let points = cycles.points(&orbit.place);
                let seed = Seed { of: branch.of, kind: event.kind, points, at, along: 1 - axis };
                self.plane.add(&seed, control.flag())?;
            }
        }
        Ok(self.plane.curves.len() - before)
    }
}
