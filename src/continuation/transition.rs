//! Where the sequence of slips and sticks changes.
//!
//! Within one sequence the map is smooth; from one to the next it is continuous and its derivative jumps. The change is
//! bracketed by orbits on both sides down to rounding, so that the branch goes on where it was. A multiplier may jump over
//! 1 there: the branch turns back, a fold without a test function that passes 0 (Leine & van Campen 2002, Int. J.
//! Bifurcation Chaos 12, 1491). Or over -1.

use super::branch::Run;
use super::cycle::{Cycles, Orbit};
use super::event::{Event, Kind};
use super::phases::Phase;

/// Halvings at most, the distance of the orbits at which they end, and the largest at which they are neighbours.
const HALVINGS: usize = 60;
const EXACT: f64 = 1e-13;
const NEIGHBOURS: f64 = 1e-9;
/// Distances beyond an orbit at which another sequence is looked for.
const BEYOND: [f64; 5] = [1e-9, 1e-8, 1e-7, 1e-6, 1e-5];
/// Largest distance of the orbit found there from its prediction, in those distances.
const MOVED: f64 = 3.0;

impl Cycles<'_> {
    /// The last orbit with the phases of `here` on the way to `next`, and the first with others.
    pub(super) fn transition(&self, here: &Orbit, next: &Orbit) -> Option<[Orbit; 2]> {
        let (mut before, mut after) = (here.clone(), next.clone());
        for _ in 0..HALVINGS {
            let apart = (&after.place - &before.place).norm();
            if apart < EXACT {
                break;
            }
            let middle = (&before.place + &after.place) * 0.5;
            let orbit = self.near(&middle, &here.tangent)?;
            // Newton's method stays between the two.
            if orbit.moved > apart {
                return None;
            }
            if orbit.is_like(here) { before = orbit } else { after = orbit }
        }
        let neighbours = (&after.place - &before.place).norm() < NEIGHBOURS;
        neighbours.then_some([before, after])
    }

    /// The last orbit before friction holds the pendulum for ever, straight on from one so near that no step is possible: the
    /// motion between its sticks fades there.
    pub(super) fn swallowed(&self, here: &Orbit) -> Option<Orbit> {
        let ahead = |away: f64| self.open(&(&here.place + &here.tangent * away), &here.tangent);
        let held = |away: f64| ahead(away).is_some_and(|orbit| orbit.stuck);
        let mut beyond = BEYOND.into_iter().find(|away| held(*away))?;
        let mut before = 0.0;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + beyond);
            if held(middle) { beyond = middle } else { before = middle }
        }
        ahead(before)
    }

    /// The first orbit with other phases where no orbit lies ahead of the last one: the branch turns back.
    pub(super) fn turned_back(&self, here: &Orbit) -> Option<Orbit> {
        BEYOND.into_iter().find_map(|away| {
            let ahead = self.open(&(&here.place + &here.tangent * away), &here.tangent)?;
            if ahead.is_like(here) {
                return None;
            }
            [1.0, -1.0].into_iter().find_map(|sense| {
                let row = &ahead.tangent * sense;
                let found = self.near(&(&here.place + &row * away), &row)?;
                let on = !found.is_like(here) && !found.stuck;
                (on && found.moved < MOVED * away).then_some(found)
            })
        })
    }
}

/// Adds two orbits between which the phases change, and what happens there.
pub(super) fn crossed(run: &mut Run, before: &Orbit, after: Orbit) {
    let orbit = run.orbits.len() - 1;
    let mut kinds: Vec<Kind> = kind(&before.phases, &after.phases).into_iter().collect();
    let last = before.tangent.len() - 1;
    if before.tangent[last] * after.tangent[last] < 0.0 {
        kinds.push(Kind::Fold);
    }
    if before.tests[1] * after.tests[1] < 0.0 {
        kinds.push(Kind::PeriodDoubling);
    }
    let rises = (after.tests[1] - before.tests[1]).signum();
    let event = |kind| Event { kind, orbit, rises, supercritical: None, smooth: false };
    run.events.extend(kinds.into_iter().map(event));
    run.orbits.push(after);
}

/// Marks the last orbit of a run as one beyond which friction holds the pendulum for ever.
pub(super) fn swallowed(run: &mut Run) {
    let orbit = run.orbits.len() - 1;
    let (kind, supercritical) = (Kind::RestBoundary, None);
    run.events.push(Event { kind, orbit, rises: 1.0, supercritical, smooth: false });
}

/// What the change is: a stick between opposite senses comes or goes, or the velocity touches 0; nothing where a turn or
/// a release only passes the section.
fn kind(before: &[Phase], after: &[Phase]) -> Option<Kind> {
    if before == after {
        return None;
    }
    let opposite = |phases: &[Phase]| {
        let count = phases.len();
        let sticks = (0..count).filter(|k| phases[*k] == Phase::Stick);
        sticks.filter(|k| phases[(k + count - 1) % count] != phases[(k + 1) % count]).count()
    };
    Some(if opposite(before) == opposite(after) { Kind::Grazing } else { Kind::StickOnset })
}
