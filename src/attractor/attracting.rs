//! Attracting orbits: by Newton's method from those of similar pendulums, and from integration steps.

use std::sync::atomic::AtomicBool;

use super::find::{Catalogue, REACH};
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit, SAME};

/// Under friction a multiplier this close to 1 shows no attraction: to a turn in one sense it is a constant torque, and what
/// shrinks is the error of the steps.
const NEUTRAL: f64 = 1e-5;

/// Points of similar orbits of similar pendulums, the most similar first, and their period.
pub type Alike = (Vec<State>, usize);

/// Newton's method from points of orbits of similar pendulums: the attracting orbit that it finds from the
/// first point of each, or else from the others.
#[must_use]
pub fn attracting(
    strobe: &Strobe,
    map: &PoincareMap,
    orbits: &[Alike],
) -> Vec<Option<PeriodicOrbit>> {
    let each = |starts: &[(State, usize)]| {
        let orbits = newton::find_each(map, starts, REACH).into_iter();
        orbits.map(|orbit| orbit.filter(|o| attracts(strobe, o))).collect::<Vec<_>>()
    };
    let first: Vec<_> = orbits.iter().map(|(points, n)| (points[0], *n)).collect();
    let mut found = each(&first);
    let without = (0..orbits.len()).filter(|k| found[*k].is_none());
    let (of, others): (Vec<usize>, Vec<_>) = without
        .flat_map(|k| orbits[k].0[1..].iter().map(move |point| (k, (*point, orbits[k].1))))
        .unzip();
    for (k, orbit) in of.into_iter().zip(each(&others)) {
        found[k] = found[k].take().or(orbit);
    }
    found
}

/// Whether an orbit is stable, under friction by more than [`NEUTRAL`] and at no state that is held for ever, nor at the edge
/// of these, where all creeps.
fn attracts(strobe: &Strobe, orbit: &PeriodicOrbit) -> bool {
    let beside = |theta: f64| [-SAME, 0.0, SAME].map(|d| theta + d);
    let held = |p: &State| {
        p[1].abs() < SAME && beside(p[0]).iter().any(|theta| strobe.equation.holds_for_ever(*theta))
    };
    let stays = || orbit.multipliers.largest() > 1.0 - NEUTRAL || orbit.points.iter().any(held);
    orbit.is_stable() && !(strobe.friction && stays())
}

impl Catalogue {
    /// The attracting orbits that [`attracting`] finds; returns the first point of those from which it finds
    /// none.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` was set.
    pub fn take_over(
        &mut self,
        strobe: &Strobe,
        orbits: &[Alike],
        cancel: &AtomicBool,
    ) -> Result<Vec<State>, Error> {
        let map = self.effort.map(strobe);
        let mut left = Vec::new();
        for ((points, _), orbit) in orbits.iter().zip(attracting(strobe, &map, orbits)) {
            match orbit {
                Some(orbit) if self.knows(&orbit) => {}
                Some(orbit) => {
                    self.admit(strobe, &map, orbit, cancel)?;
                }
                None => left.push(points[0]),
            }
        }
        self.rebuild(&strobe.pendulum);
        Ok(left)
    }

    /// The orbit of `map` that an orbit of the integration steps is near, if both attract and it is not yet
    /// known; most orbits that are met repel, and steps tell it sooner than the precise map.
    pub(super) fn refined(
        &self,
        strobe: &Strobe,
        map: &PoincareMap,
        orbit: PeriodicOrbit,
    ) -> Option<PeriodicOrbit> {
        if !attracts(strobe, &orbit) {
            return None;
        }
        let orbit = if self.effort.precise {
            newton::find(map, orbit.points[0], orbit.n, REACH)?
        } else {
            orbit
        };
        (attracts(strobe, &orbit) && !self.knows(&orbit)).then_some(orbit)
    }

    /// Whether this orbit is one of those found, or of those without a trap.
    fn knows(&self, orbit: &PeriodicOrbit) -> bool {
        let found = self.orbits.iter().map(|(o, _)| o);
        found.chain(&self.untrapped).any(|o| o.is_same(orbit))
    }
}
