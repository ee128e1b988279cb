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
use crate::attractor::rest::{balanced, least_loaded};
use crate::integrate::State;
use crate::model::Equation;

/// Halvings at most, the distance of the orbits at which they end, and the largest at which they are neighbours.
const HALVINGS: usize = 60;
const EXACT: f64 = 1e-13;
const NEIGHBOURS: f64 = 1e-9;
/// Distances beyond an orbit at which another sequence, or rest, is looked for.
const BEYOND: [f64; 6] = [1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4];
/// Largest motion of an orbit whose slips fade.
const FADED: f64 = 1e-3;
/// An excess of the load below this moves the pendulum by its square, no more than rounding.
const FAINT: f64 = 1e-7;
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

    /// The orbit at which friction comes to hold the pendulum for ever, ahead of one beside it: the slips between its sticks
    /// have faded, and where the loads in both senses are equal at their greatest in a period they equal the friction.
    pub(super) fn swallowed(&self, here: &Orbit) -> Option<Orbit> {
        let last = here.place.len() - 1;
        let (mut before, sense) = (here.place[last], here.tangent[last].signum());
        self.excess(here, before, balanced)?;
        let holds = |along: f64| self.excess(here, along, balanced).is_some_and(|(_, x)| x <= 0.0);
        let away = BEYOND.into_iter().find(|away| holds(before + sense * away))?;
        let mut beyond = before + sense * away;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + beyond);
            if holds(middle) { beyond = middle } else { before = middle }
        }
        let (theta, _) = self.excess(here, beyond, balanced)?;
        let points = vec![[theta, 0.0]; self.count()];
        let orbit = self.unfollowed(&self.place(&points, self.origin + beyond * self.scale))?;
        Some(Orbit { tangent: here.tangent.clone(), orientation: here.orientation, ..orbit })
    }

    /// Whether slips between sticks are ones of rounding.
    pub(super) fn fades(&self, orbit: &Orbit) -> bool {
        let along = orbit.place[orbit.place.len() - 1];
        // Beside the angle of equal loads rest may be held on one side of it: the orbit has left that.
        let nearest = |equation: &_, theta, width| {
            balanced(equation, theta, width).or_else(|| Some(least_loaded(equation, theta, width)))
        };
        orbit.phases.contains(&Phase::Stick)
            && self.excess(orbit, along, nearest).is_some_and(|(_, excess)| excess < FAINT)
    }

    /// The angle that is asked for beside an orbit that rests at the section, and the greatest excess of the load over the
    /// friction there.
    fn excess(
        &self,
        orbit: &Orbit,
        along: f64,
        angle: impl Fn(&Equation<f64>, f64, f64) -> Option<f64>,
    ) -> Option<(f64, f64)> {
        let points = self.points(&orbit.place);
        let theta = points[0][0];
        let still = |point: &State| (point[0] - theta).abs().max(point[1].abs()) < FADED;
        if !points.iter().all(still) {
            return None;
        }
        let pendulum = self.course.pendulum(&[self.origin + along * self.scale]);
        let equation = pendulum.has_friction().then(|| pendulum.equation())?;
        let theta = angle(&equation, theta, FADED)?;
        Some((theta, equation.excess(theta)))
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

/// Adds two orbits between which the phases change, and what happens there. A change that is undone at once is one of
/// rounding.
pub(super) fn crossed(cycles: &Cycles<'_>, run: &mut Run, before: &Orbit, after: Orbit) {
    if let Some(first) = undone(run, &after) {
        run.forget_after(first);
        run.orbits.push(after);
        return;
    }
    let orbit = run.orbits.len() - 1;
    let mut kinds: Vec<Kind> = kind(&before.phases, &after.phases).into_iter().collect();
    let last = before.tangent.len() - 1;
    if before.tangent[last] * after.tangent[last] < 0.0 {
        kinds.push(Kind::Fold);
    } else if before.tests[1] * after.tests[1] < 0.0 {
        // Where the branch turns back no orbit is left to shed another one.
        kinds.push(cycles.at_minus_one());
    }
    let rises = (after.tests[1] - before.tests[1]).signum();
    let event = |kind| Event { kind, orbit, rises, supercritical: None, smooth: false };
    run.events.extend(kinds.into_iter().map(event));
    run.orbits.push(after);
}

impl Run {
    /// Forgets an event and all that follows its orbit.
    fn forget_after(&mut self, orbit: usize) {
        self.events.retain(|event| event.orbit < orbit);
        self.orbits.truncate(orbit + 1);
    }
}

/// The orbit before the last change of phases, if the branch is back there in the same sense.
fn undone(run: &Run, after: &Orbit) -> Option<usize> {
    let Event { orbit, smooth: false, .. } = *run.events.last()? else { return None };
    let (before, last) = (&run.orbits[orbit], after.tangent.len() - 1);
    let near = (&after.place - &before.place).norm() < NEIGHBOURS;
    let onward = before.tangent[last] * after.tangent[last] > 0.0;
    (near && onward && before.is_like(after)).then_some(orbit)
}

/// The last orbit of a run without a change of phases just before it: no step leads on, so the branch turns back there.
pub(super) fn retreated(run: &mut Run) -> Orbit {
    let last = run.orbits.len() - 1;
    if let Some(&Event { orbit, smooth: false, kind: Kind::StickOnset | Kind::Grazing, .. }) =
        run.events.last()
        && (&run.orbits[last].place - &run.orbits[orbit].place).norm() < NEIGHBOURS
    {
        run.forget_after(orbit);
    }
    run.orbits[run.orbits.len() - 1].clone()
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
