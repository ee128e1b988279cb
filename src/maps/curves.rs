//! The bifurcation set of a plane: curves of folds, doublings and symmetry breakings.
//!
//! Branches are followed along sections of the plane, in both directions in turn, each in the largest gap that the golden
//! section leaves. On a section orbits are searched at some places, as by [`super::orbits`]. Each event on
//! their branches is a point of a curve, which is followed if none passes there yet, until several sections in a row have
//! had no new one.

use super::branches::window;
use super::control::Control;
use super::orbits;
use crate::continuation::branch::Bounds;
use crate::continuation::course::Course;
use crate::continuation::event::Kind;
use crate::continuation::family::Family;
use crate::continuation::plane::{Plane, Seed};
use crate::error::Error;
use crate::model::pendulum::Symmetry;

/// Sections at least, at most, and in a row without a new curve.
const LEAST: usize = 6;
const MOST: usize = 40;
const QUIET: usize = 4;
/// Places along a section at which orbits are searched.
const PLACES: [f64; 2] = [0.31, 0.83];
/// Cells along a side of the box of a search, a period.
const CELLS: usize = 60;
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
    let mut found = Curves { plane: Plane::new(course.clone(), longest)?, sections: Vec::new() };
    let mut quiet = 0;
    for k in 0..MOST {
        if k >= LEAST && quiet >= QUIET {
            break;
        }
        let held = (1 - k % 2, (0.5 + GOLDEN * (k / 2) as f64).fract());
        let section = found.search(held, request, control)?;
        quiet = if section.new > 0 { 0 } else { quiet + 1 };
        found.sections.push(section);
    }
    Ok(found)
}

impl Request {
    fn wants(&self, n: usize, w: i64) -> bool {
        self.only.as_ref().is_none_or(|types| types.contains(&(n, w)))
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
        let course = self.plane.course.along(axis, held.1);
        let mut family = Family::new(course, Bounds { low: 0.0, high: 1.0 }, request.longest)?;
        let mut section = Section { held, orbits: 0, new: 0 };
        let mut known = 0;
        for at in PLACES {
            let pendulum = family.pendulum(at);
            let mirrored = self.plane.symmetry == Some(Symmetry::AtOnce);
            for n in 1..=request.longest {
                let fastest = 2.0 * (1.0 + pendulum.drive.p.abs()).sqrt();
                let turns = (fastest * n as f64 / pendulum.drive.omega).floor() as i64;
                for w in if mirrored { 0 } else { -turns }..=turns {
                    control.check()?;
                    if !request.wants(n, w) {
                        continue;
                    }
                    let window = window(&pendulum, (n, w), CELLS * n, request.threads)?;
                    for orbit in &orbits::orbits(&pendulum, &window, control)?.closed {
                        section.orbits += 1;
                        if !family.passes(orbit, at) {
                            family.add(orbit, at, control.flag())?;
                        }
                    }
                    section.new += self.add(&family, known, (axis, held.1), request, control)?;
                    known = family.branches.len();
                }
            }
        }
        Ok(section)
    }

    /// Adds the curves through the events of the branches from one on; the number of new ones.
    fn add(
        &mut self,
        family: &Family,
        from: usize,
        (axis, held): (usize, f64),
        request: &Request,
        control: &Control,
    ) -> Result<usize, Error> {
        let before = self.plane.curves.len();
        for branch in &family.branches[from..] {
            if !request.wants(branch.of.n, branch.of.w) {
                continue;
            }
            let cycles = family.cycles(branch.of);
            for event in branch.run.events.iter().filter(|event| event.smooth) {
                if !matches!(event.kind, Kind::Fold | Kind::PeriodDoubling | Kind::SymmetryBreaking)
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
