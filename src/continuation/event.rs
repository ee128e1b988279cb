//! What happens on a branch: where multipliers pass 1 or -1, or a pair of them the unit circle.
//!
//! The test functions are the part of the tangent along the coordinate (fold), `det(M + 1)` and, at rest,
//! `det(M - 1)`, and the product of a complex pair less 1. They pass 0 simply, and are evaluated on orbits of the branch
//! from exact first derivatives, so that the secant method finds their zeros to rounding.
//!
//! About rest without damping both boundaries of a narrow tongue are nearly a double zero of `det(M -+ 1)`. The drive is
//! even in time then, so that `m11 = m22`, and on a boundary `m12 m21 = m11^2 - 1 = 0`: one is a simple zero of `m12`, the
//! other of `m21`, however narrow the tongue (Magnus & Winkler 1966, Hill's equation, section 1.1).

use super::branch::{Run, interpolated};
use super::cycle::{Closure, Cycles, Orbit};

/// Refinements of a zero at most, and the part of a step at which it is known.
pub(super) const REFINEMENTS: usize = 40;
pub(super) const EXACT: f64 = 1e-14;
/// The part of a step at which a zero is known where the steps of the map err by more than rounding.
const ROUGH: f64 = 1e-9;
/// Relative difference of equal entries.
const EVEN: f64 = 1e-9;
/// Events of one kind at this distance are one.
const ROUNDING: f64 = 1e-12;

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A multiplier passes 1, and the branch turns back.
    Fold,
    /// A multiplier passes -1: an orbit of twice the period is born or ends.
    PeriodDoubling,
    /// A symmetric orbit sheds a pair of asymmetric ones.
    SymmetryBreaking,
    /// A complex pair passes the unit circle.
    NeimarkSacker,
    /// A turn becomes a stick, or a stick a turn.
    StickOnset,
    /// The velocity touches 0: a pair of turns appears.
    Grazing,
    /// The orbit begins to stick where friction holds it for ever.
    RestBoundary,
}

impl Kind {
    /// Whether slips and sticks change there, where no multiplier need be critical.
    #[must_use]
    pub fn is_of_friction(self) -> bool {
        matches!(self, Self::StickOnset | Self::Grazing | Self::RestBoundary)
    }

    /// Its name.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Fold => "fold",
            Self::PeriodDoubling => "period_doubling",
            Self::SymmetryBreaking => "symmetry_breaking",
            Self::NeimarkSacker => "neimark_sacker",
            Self::StickOnset => "stick_onset",
            Self::Grazing => "grazing",
            Self::RestBoundary => "rest_boundary",
        }
    }
}

/// An event of a branch.
#[derive(Clone, Debug)]
pub struct Event {
    /// What happens.
    pub kind: Kind,
    /// Which of the orbits of the branch it is.
    pub orbit: usize,
    /// The sense along the branch, 1 or -1, in which the test function rises: on the other side a multiplier is beyond
    /// the critical value.
    pub rises: f64,
    /// Whether the new orbits live where the old one has lost its stability; none where there are no new ones.
    pub supercritical: Option<bool>,
    /// Whether the map is smooth there: not where the phases change, nor at rest on a kink.
    pub smooth: bool,
}

/// A test function.
type Test = fn(&Cycles<'_>, &Orbit) -> f64;

fn fold(_: &Cycles<'_>, orbit: &Orbit) -> f64 {
    orbit.tangent[orbit.tangent.len() - 1]
}

fn plus(_: &Cycles<'_>, orbit: &Orbit) -> f64 {
    orbit.tests[0]
}

fn minus(_: &Cycles<'_>, orbit: &Orbit) -> f64 {
    orbit.tests[1]
}

fn circle(_: &Cycles<'_>, orbit: &Orbit) -> f64 {
    1.0 - orbit.product.0
}

fn upper(_: &Cycles<'_>, orbit: &Orbit) -> f64 {
    orbit.parts[0][(0, 1)]
}

fn lower(_: &Cycles<'_>, orbit: &Orbit) -> f64 {
    orbit.parts[0][(1, 0)]
}

/// Whether the derivative at rest has equal entries on its diagonal and the determinant 1.
fn is_even(cycles: &Cycles<'_>, orbit: &Orbit) -> bool {
    let part = orbit.parts[0];
    let apart = (part[(0, 0)] - part[(1, 1)]).abs();
    cycles.of.closure == Closure::Rest
        && orbit.product == (1.0, true)
        && apart < EVEN * (1.0 + part[(0, 0)].abs())
}

/// The test functions of orbits that close like this one.
fn tests(cycles: &Cycles<'_>, orbit: &Orbit) -> &'static [(Kind, Test)] {
    if is_even(cycles, orbit) {
        return &[(Kind::SymmetryBreaking, upper), (Kind::SymmetryBreaking, lower)];
    }
    match cycles.of.closure {
        _ if !orbit.smooth => {
            &[(Kind::Fold, plus), (Kind::PeriodDoubling, minus), (Kind::NeimarkSacker, circle)]
        }
        Closure::Whole => {
            &[(Kind::Fold, fold), (Kind::PeriodDoubling, minus), (Kind::NeimarkSacker, circle)]
        }
        Closure::Half => {
            &[(Kind::Fold, fold), (Kind::SymmetryBreaking, minus), (Kind::NeimarkSacker, circle)]
        }
        Closure::Rest => &[
            (Kind::SymmetryBreaking, plus),
            (Kind::PeriodDoubling, minus),
            (Kind::NeimarkSacker, circle),
        ],
    }
}

/// Adds what happens between the last orbit of the run, `here`, and `next`, and `next` itself.
pub(super) fn between(cycles: &Cycles<'_>, here: &Orbit, next: &Orbit, run: &mut Run) {
    match touched(cycles, run, next) {
        Some((true, middle)) => {
            passed(cycles, here, &middle, run);
            passed(cycles, &middle, next, run);
        }
        Some((false, middle)) => {
            let here = run.orbits.pop();
            if let (Some(here), Some(before)) = (here, run.orbits.last().cloned()) {
                passed(cycles, &before, &middle, run);
                passed(cycles, &middle, &here, run);
                passed(cycles, &here, next, run);
            }
        }
        None => passed(cycles, here, next, run),
    }
}

/// An orbit on the other side of a zero that a test seems to pass twice, by the parabola through its values at the last
/// two orbits of the run and at `next`; and whether it is after the last one.
fn touched(cycles: &Cycles<'_>, run: &Run, next: &Orbit) -> Option<(bool, Orbit)> {
    let count = run.orbits.len();
    let [before, here] = [run.orbits.get(count.checked_sub(2)?)?, run.orbits.last()?];
    let smooth = before.is_like(here) && here.is_like(next);
    let event = run.events.last().is_some_and(|event| event.orbit + 2 >= count);
    if !smooth || event || before.orientation != next.orientation {
        return None;
    }
    let [back, on] = [(here, before), (next, here)].map(|(a, b)| (&a.place - &b.place).norm());
    tests(cycles, here).iter().find_map(|(_, test)| {
        let sign = test(cycles, here).signum();
        let [first, middle, last] = [before, here, next].map(|orbit| sign * test(cycles, orbit));
        if !(middle < first && middle < last) || back == 0.0 || on == 0.0 {
            return None;
        }
        let slopes = [(middle - first) / back, (last - middle) / on];
        let bend = (slopes[1] - slopes[0]) / (back + on);
        let slope = slopes[0] + bend * back;
        let place = -0.5 * slope / bend;
        if middle + 0.5 * slope * place > 0.5 * middle {
            return None;
        }
        let after = place > 0.0;
        let guess = if after {
            interpolated(here, next, place / on)
        } else {
            interpolated(before, here, 1.0 + place / back)
        };
        let row = if after { &here.tangent } else { &before.tangent };
        let found = cycles.near(&guess, row)?;
        (sign * test(cycles, &found) < 0.0).then_some((after, found))
    })
}

/// [`between`] where no test passes 0 twice.
fn passed(cycles: &Cycles<'_>, here: &Orbit, next: &Orbit, run: &mut Run) {
    let mut found: Vec<(f64, Kind, Orbit, f64)> = Vec::new();
    for (kind, test) in tests(cycles, next) {
        let values = [here, next].map(|one| test(cycles, one));
        let complex = |one: &Orbit| one.tests[0] > 0.0 && one.tests[1] > 0.0;
        let passes = values[0] * values[1] <= 0.0 && values[1] != 0.0;
        if !passes || (*kind == Kind::NeimarkSacker && (next.product.1 || !complex(next))) {
            continue;
        }
        if let Some(orbit) = zero(cycles, here, next, *test) {
            let along = here.tangent.dot(&(&orbit.place - &here.place));
            let negative = is_even(cycles, &orbit) && orbit.parts[0].trace() < 0.0;
            let kind = if negative { Kind::PeriodDoubling } else { *kind };
            found.push((along, kind, orbit, (values[1] - values[0]).signum()));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, kind, orbit, rises) in found {
        // A step that ends on an event passes it once.
        let same = |event: &Event| {
            let away = (&run.orbits[event.orbit].place - &orbit.place).norm();
            event.kind == kind && away < ROUNDING
        };
        if run.events.last().is_some_and(same) {
            continue;
        }
        let smooth = orbit.smooth;
        run.orbits.push(orbit);
        let orbit = run.orbits.len() - 1;
        run.events.push(Event { kind, orbit, rises, supercritical: None, smooth });
    }
    run.orbits.push(next.clone());
}

/// The orbit between two at which the test vanishes, by false position with the value at an end that is kept twice
/// halved (the Illinois variant).
fn zero(cycles: &Cycles<'_>, a: &Orbit, b: &Orbit, test: Test) -> Option<Orbit> {
    let mut ends = [(0.0, test(cycles, a)), (1.0, test(cycles, b))];
    let mut best: Option<(f64, Orbit)> = None;
    let mut stayed = None;
    let exact = if cycles.course.is_rough() { ROUGH } else { EXACT };
    for _ in 0..REFINEMENTS {
        let [(low, at_low), (high, at_high)] = ends;
        if high - low < exact {
            break;
        }
        let part = (low * at_high - high * at_low) / (at_high - at_low);
        let part = if part > low && part < high { part } else { 0.5 * (low + high) };
        let at = |part: f64| Some((part, cycles.near(&interpolated(a, b, part), &a.tangent)?));
        let (part, orbit) = at(part).or_else(|| at(0.5 * (low + high)))?;
        let value = test(cycles, &orbit);
        let side = usize::from(value.signum() != at_low.signum());
        let known = (part - ends[side].0).abs() < exact;
        ends[side] = (part, value);
        if stayed == Some(side) {
            ends[1 - side].1 *= 0.5;
        }
        stayed = Some(side);
        if best.as_ref().is_none_or(|(least, _)| value.abs() <= *least) {
            best = Some((value.abs(), orbit));
        }
        if value == 0.0 || known {
            break;
        }
    }
    best.map(|(_, orbit)| orbit)
}
