//! A branch of orbits, followed by pseudo-arclength.
//!
//! The unknowns are the points of the orbit and the coordinate of the course, each in its unit. A step predicts along the
//! tangent and returns to the branch in the plane across it (Keller 1977). It is taken if tangent and multipliers have
//! turned little, Newton's method has moved the prediction little, and the determinant of the bordered system has
//! kept its sign. That determinant vanishes on a branch only where branches cross, and neighbouring branches have
//! opposite signs: however near one another they lie, a step from one to the next is noticed.

use nalgebra::DVector;

use super::cycle::{Closure, Cycles, Orbit};
use super::event::{self, Event};
use super::transition;
use crate::error::{Error, unless_cancelled};
use std::sync::atomic::AtomicBool;

/// The first, the longest and the shortest step.
const FIRST: f64 = 0.01;
const LONGEST: f64 = 0.06;
const SHORTEST: f64 = 1e-11;
/// Change of the tangent, of the trace of the multipliers, and of the prediction by Newton's method over the step, that
/// a step aims at; it is refused at [`MOST`] times as much.
const TURN: f64 = 0.15;
const TRACE: f64 = 0.3;
const MOVED: f64 = 0.08;
const MOST: f64 = 2.5;
/// How much longer steps are where what is found is refined later.
const EASE: f64 = 3.0;
/// Length of a prediction by the last step, in units of it.
const AHEAD: f64 = 2.5;
/// Ratios of successive steps.
const CHANGE: [f64; 2] = [0.25, 2.0];
/// The longest step after a refused one, in units of it, and its growth with each step.
const SHORTER: f64 = 0.7;
const LONGER: f64 = 1.15;
/// Steps over a place where branches cross.
const ACROSS: [f64; 3] = [1e-4, 1e-3, 1e-2];
/// Steps of a branch at most.
const STEPS: usize = 20_000;
/// Fastest motion of an orbit that is followed.
const FASTEST: f64 = 1e3;
/// Largest norm of the derivative of a period: Newton's method converges within about its inverse, and a window of stable
/// orbits is no wider than about its inverse square.
pub(super) const PARTED: f64 = 1e6;
/// Largest distance of two points of one orbit.
pub(super) const SAME: f64 = 1e-7;

/// Why a branch ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// At an end of the range.
    Range,
    /// It joins its own beginning.
    Closed,
    /// On rest, hanging or inverted.
    Rest,
    /// On an orbit of half its period, or one that is its own mirror image.
    Parent,
    /// Friction holds the pendulum for ever from there on.
    Sticks,
    /// The motion becomes too fast.
    Fast,
    /// Branches cross there.
    Crossing,
    /// The sequence of slips and sticks changes.
    Phases,
    /// At the edge of the plane where nothing drives it.
    Undriven,
    /// Newton's method fails at any step; with the norm of the derivative of a period.
    Lost(f64),
}

impl End {
    /// The reason.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Range => "end of the range",
            Self::Closed => "joins itself",
            Self::Rest => "meets rest",
            Self::Parent => "meets its parent orbit",
            Self::Sticks => "sticks for ever",
            Self::Fast => "velocity out of bounds",
            Self::Crossing => "branches cross",
            Self::Phases => "slips and sticks change",
            Self::Undriven => "p = 0",
            Self::Lost(_) => "precision lost",
        }
    }
}

/// Orbits in the order of the branch, what happens on it, and why it ends on either side.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// The orbits.
    pub orbits: Vec<Orbit>,
    /// What happens, each at one of the orbits.
    pub events: Vec<Event>,
}

/// The range of the coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

impl Bounds {
    /// Whether a coordinate is between the ends.
    #[must_use]
    pub fn holds(self, at: f64) -> bool {
        self.low < at && at < self.high
    }
}

/// The result of a step.
enum Step {
    /// To an orbit, and the part of the step that the next one may have.
    On(Box<Orbit>, f64),
    /// Too long by this factor.
    Long(f64),
    /// To where the branch ends.
    Over(End, Option<Box<Orbit>>),
}

impl Cycles<'_> {
    /// The branch from `first` on in the sense of its tangent, and why it ends.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `cancel` is set.
    pub fn followed(
        &self,
        first: &Orbit,
        bounds: Bounds,
        cancel: &AtomicBool,
    ) -> Result<(Run, End), Error> {
        let mut run = Run { orbits: vec![first.clone()], events: Vec::new() };
        let (mut length, mut most) = (FIRST, LONGEST * self.ease());
        let mut refused = None;
        for _ in 0..STEPS {
            unless_cancelled(cancel)?;
            let here = run.orbits[run.orbits.len() - 1].clone();
            if length < SHORTEST {
                if let Some(end) = self.stopped(&here, refused, &mut run) {
                    return Ok((run, end));
                }
                (length, refused) = (FIRST, None);
                continue;
            }
            match self.step(&run.orbits, length, &mut refused) {
                Step::Long(factor) => {
                    most = SHORTER * length;
                    length *= factor;
                }
                Step::Over(end, last) => {
                    if let Some(last) = last {
                        event::between(self, &here, &last, &mut run);
                    }
                    return Ok((run, end));
                }
                Step::On(next, factor) => {
                    refused = None;
                    let next = if next.is_like(&here) {
                        next
                    } else {
                        let Some([before, after]) = self.transition(&here, &next) else {
                            length *= CHANGE[0];
                            continue;
                        };
                        if bounds.holds(self.at(&before.place)) {
                            event::between(self, &here, &before, &mut run);
                            if !bounds.holds(self.at(&after.place)) {
                                return Ok((run, End::Range));
                            }
                            transition::crossed(self, &mut run, &before, after);
                            length = FIRST;
                            continue;
                        }
                        Box::new(before)
                    };
                    let at = self.at(&next.place);
                    let goal = if at < bounds.low { bounds.low } else { bounds.high };
                    if !bounds.holds(at) {
                        let Some(last) = self.between(&here, &next, goal) else {
                            length *= CHANGE[0];
                            continue;
                        };
                        event::between(self, &here, &last, &mut run);
                        return Ok((run, End::Range));
                    }
                    if run.orbits.len() > 2 && self.closes(first, &here, &next) {
                        event::between(self, &here, &next, &mut run);
                        return Ok((run, End::Closed));
                    }
                    event::between(self, &here, &next, &mut run);
                    most = (LONGER * most).min(LONGEST * self.ease());
                    length = (length * factor).min(most);
                }
            }
        }
        let norm = run.orbits.last().map_or(f64::NAN, |last| last.norm);
        Ok((run, End::Lost(norm)))
    }

    /// Goes on where no step from `here` does, or says why the branch ends; `refused` is why the last step was.
    fn stopped(&self, here: &Orbit, refused: Option<End>, run: &mut Run) -> Option<End> {
        match refused {
            Some(End::Crossing) => {
                let Some(after) = self.across(here) else { return refused };
                run.orbits.push(after);
            }
            None => {
                let here = transition::retreated(run);
                if let Some(after) = self.turned_back(&here) {
                    transition::crossed(self, run, &here, after);
                    return None;
                }
                return Some(self.faded(&here, run).unwrap_or(End::Lost(here.norm)));
            }
            _ => return self.faded(here, run).or(refused),
        }
        None
    }

    /// Ends the run where friction comes to hold the pendulum for ever, if that is beside an orbit.
    fn faded(&self, here: &Orbit, run: &mut Run) -> Option<End> {
        run.orbits.push(self.swallowed(here)?);
        transition::swallowed(run);
        Some(End::Sticks)
    }

    /// One step; `refused` keeps why the last one was.
    fn step(&self, orbits: &[Orbit], length: f64, refused: &mut Option<End>) -> Step {
        let here = &orbits[orbits.len() - 1];
        let before = orbits.len().checked_sub(2).map(|k| &orbits[k]);
        let guess = predicted(before, here, length);
        let Some(next) = self.near(&guess, &here.tangent) else {
            *refused = None;
            return Step::Long(CHANGE[0]);
        };
        if next.norm > PARTED && self.of.closure != Closure::Rest {
            return Step::Over(End::Lost(next.norm), None);
        }
        let turn = here.tangent.dot(&next.tangent).clamp(-1.0, 1.0).acos();
        let [before, after] = [here, &next].map(|one| 0.5 * (one.tests[1] - one.tests[0]));
        let change = (after - before).abs() / (2.0 + before.abs().min(after.abs()));
        let moved = next.moved / (MOVED * length);
        // At a change of phases the derivative jumps: the branch is followed up to there first.
        let smooth = next.is_like(here);
        let ease = self.ease();
        let turned = (turn / TURN).max(change / TRACE) / ease;
        let worst = if smooth { moved.max(turned) } else { moved };
        if worst > MOST {
            *refused = None;
            return Step::Long((0.9 / worst).clamp(CHANGE[0], 0.5));
        }
        if let Some((end, last)) = self.meeting(here, &next) {
            return Step::Over(end, Some(Box::new(last)));
        }
        if next.stuck || self.fades(&next) || next.smooth != here.smooth {
            *refused = Some(if next.smooth { End::Sticks } else { End::Rest });
            return Step::Long(CHANGE[0]);
        }
        if smooth && next.orientation != here.orientation {
            *refused = Some(End::Crossing);
            return Step::Long(CHANGE[0]);
        }
        if self.points(&next.place).iter().any(|point| point[1].abs() > FASTEST) {
            return Step::Over(End::Fast, None);
        }
        Step::On(Box::new(next), (1.0 / worst).clamp(0.5, CHANGE[1]))
    }

    /// Steps are so much longer where all is refined later.
    fn ease(&self) -> f64 {
        if self.course.is_rough() { EASE } else { 1.0 }
    }

    /// An orbit on the other side of a place where branches cross, straight on.
    fn across(&self, here: &Orbit) -> Option<Orbit> {
        ACROSS.into_iter().find_map(|length| {
            let next = self.near(&(&here.place + &here.tangent * length), &here.tangent)?;
            let turn = here.tangent.dot(&next.tangent).clamp(-1.0, 1.0).acos();
            (turn < TURN && next.moved < MOVED * length).then_some(next)
        })
    }

    /// The orbit at a coordinate between two of the branch.
    pub(super) fn between(&self, a: &Orbit, b: &Orbit, at: f64) -> Option<Orbit> {
        let [low, high] = [a, b].map(|one| self.at(&one.place));
        let width = high - low;
        if width == 0.0 {
            return None;
        }
        let mut guess = interpolated(a, b, (at - low) / width);
        let last = guess.len() - 1;
        guess[last] = self.along_range(at);
        let mut row = self.along();
        if b.tangent[last] < 0.0 {
            row.neg_mut();
        }
        let found = self.near(&guess, &row)?;
        let turned = found.tangent.dot(&a.tangent) <= 0.0;
        let strayed = found.moved > (&b.place - &a.place).norm();
        (!turned && !strayed && found.orientation == a.orientation).then_some(found)
    }

    /// Whether the orbit `first` lies between two orbits.
    fn closes(&self, first: &Orbit, here: &Orbit, next: &Orbit) -> bool {
        let at = self.at(&first.place);
        let sides = [here, next].map(|one| self.at(&one.place) - at);
        if sides[0] * sides[1] > 0.0 {
            return false;
        }
        self.between(here, next, at).is_some_and(|found| self.is_same(&found, first))
    }

    /// Whether two orbits of one type at one coordinate are the same.
    #[must_use]
    pub fn is_same(&self, a: &Orbit, b: &Orbit) -> bool {
        let angle = self.course.base.angle();
        let first = self.points(&a.place)[0];
        self.all_points(&b.place).iter().any(|point| angle.distance(*point, first) < SAME)
    }
}

/// The place at a distance ahead of an orbit, by Hermite's cubic through it and the one before if that is far enough away,
/// or straight on. Where motions part by far within a period, Newton's method needs a good one.
pub(super) fn predicted(before: Option<&Orbit>, here: &Orbit, length: f64) -> DVector<f64> {
    let smooth = before.filter(|before| before.is_like(here));
    let past = smooth.map(|before| (before, (&here.place - &before.place).norm()));
    match past {
        Some((before, past)) if length <= AHEAD * past => {
            interpolated(before, here, 1.0 + length / past)
        }
        _ => &here.place + &here.tangent * length,
    }
}

/// A part of the way between two orbits, by Hermite's cubic.
#[must_use]
pub fn interpolated(a: &Orbit, b: &Orbit, part: f64) -> DVector<f64> {
    let away = &b.place - &a.place;
    let length = away.norm();
    let rest = 1.0 - part;
    &a.place
        + &away * (part * part * (3.0 - 2.0 * part))
        + &a.tangent * (length * part * rest * rest)
        - &b.tangent * (length * part * part * rest)
}
