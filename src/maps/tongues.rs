//! Critical amplitudes at which hanging or inverted rest loses or gains stability: events of the branch of rest along the
//! drive's amplitude `p`, at each frequency, and the curves through them in the plane of both.
//!
//! A constant torque turns rest into an orbit of the drive's period. It is followed from rest along the torque, then along
//! `p`, from both ends of the range and from the doublings, which curves over `p` and the torque lead to: a stable interval
//! may shift by more than its length.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::control::{Control, pool};
use super::kinked_tongues;
use crate::continuation::branch::Bounds;
use crate::continuation::course::{Course, Law};
use crate::continuation::critical::Critical as Place;
use crate::continuation::cycle::{Closure, Orbit, Type};
use crate::continuation::event::Kind;
use crate::continuation::family::Family;
use crate::continuation::plane::{Plane, Seed};
use crate::error::Error;
use crate::integrate::State;
use crate::model::pendulum::Symmetry;
use crate::model::{Parameter, Pendulum};
use crate::orbit::{KinkedRest, PoincareMap, newton};

/// Largest `p` of a request, in squares of the lowest frequency: at it solutions grow over a period by about
/// the exponential of 560, and twice that is beyond the range of numbers.
const MOST_P: f64 = 5e4;
/// Relative difference below which products of multipliers are equal.
const ALIKE: f64 = 1e-9;
/// Largest load on the pendulum at rest that is rounding, and number of times in a period at which it is sampled.
const NO_LOAD: f64 = 1e-13;
const TIMES: usize = 16;
/// A tongue whose tip is at `p = 0` begins below this part of the range.
const TIP: f64 = 1e-12;
/// Longest period of the orbits whose folds are followed from points of codimension 2.
const BORN: usize = 2;
/// The coordinate along `p`, and along the torque.
const WHOLE: Bounds = Bounds { low: 0.0, high: 1.0 };
/// Largest distance of Newton's method from the end of a branch.
const NEAR: f64 = 1e-3;
/// The type of what rest becomes under a torque.
const ORBIT: Type = Type { n: 1, w: 0, closure: Closure::Whole, centre: 0.0 };
/// Angles of hanging and of inverted rest.
const BALANCES: [f64; 2] = [0.0, PI];

/// A critical amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Critical {
    /// Amplitude of the drive.
    pub p: f64,
    /// The critical multiplier: 1 or -1. Under a torque an orbit has a fold where it is 1.
    pub multiplier: f64,
    /// Whether rest is stable just below, and just above.
    pub stable: [bool; 2],
}

/// Amplitudes of one rest this near to one another, in parts of the range, are listed and not followed: a strip between them
/// has no width in a figure.
const NARROW: f64 = 1e-3;

/// Critical amplitudes of a rest at one frequency.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// In order of `p`.
    pub critical: Vec<Critical>,
    /// Whether rest is stable between `p = 0` and the first of them.
    pub stable_at_first: bool,
}

/// The critical amplitudes and the curves.
#[derive(Clone, Debug)]
pub struct Tongues {
    /// Those of hanging and of inverted rest, at each frequency.
    pub rows: Vec<[Row; 2]>,
    /// Whether upright is a rest.
    pub inverted: bool,
    /// The curves over `p` and the frequency from 0 to 1; none at one frequency, and none of a rest that is no orbit of
    /// a smooth map with the pendulum's symmetry.
    pub plane: Option<Plane>,
}

/// All critical amplitudes up to `p_max` at each of the frequencies, which rise.
///
/// # Errors
/// [`Error::Range`] for a `p_max` or frequency out of range, [`Error::NotMappable`] for effects that no
/// map can have, [`Error::NoRest`] where hanging rest is no solution, or friction holds it,
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn tongues(
    pendulum: &Pendulum,
    omegas: &[f64],
    p_max: f64,
    threads: usize,
    control: &Control,
) -> Result<Tongues, Error> {
    if let Some(value) = omegas.iter().find(|w| !(w.is_finite() && **w > 0.0)) {
        return Err(Error::Range { name: "omega", value: *value, allowed: "a number above 0" });
    }
    let lowest = omegas.iter().copied().fold(f64::INFINITY, f64::min);
    if !(p_max > 0.0 && p_max <= MOST_P * lowest * lowest && p_max.is_finite()) {
        let allowed = "above 0, up to 50000 times the square of the lowest omega";
        return Err(Error::Range { name: "p_max", value: p_max, allowed });
    }
    let mut level = pendulum.clone();
    (level.torque, level.drive.phase) = (0.0, 0.0);
    check(&level, BALANCES[0], omegas, p_max)?;
    let inverted = check(&level, BALANCES[1], omegas, p_max).is_ok();
    let asked = Asked { level, torque: pendulum.torque, p_max, inverted };
    control.begin(omegas.len());
    let one = |omega: &f64| {
        control.check()?;
        let found = asked.at(*omega, control.flag());
        control.add(1);
        found
    };
    let found: Vec<([Row; 2], Vec<Seed>)> =
        pool(threads)?.install(|| omegas.par_iter().map(one).collect::<Result<_, Error>>())?;
    let (rows, seeds): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let plane = asked.plane(omegas, &seeds, control.flag())?;
    Ok(Tongues { rows, inverted, plane })
}

/// Whether rest is a solution with all these drives, and not held by friction.
fn check(pendulum: &Pendulum, balance: f64, omegas: &[f64], p_max: f64) -> Result<(), Error> {
    pendulum.check_mappable()?;
    if pendulum.has_friction() {
        let why = "friction holds it whatever the drive, and rest never loses its stability: take theta_r = 0 \
                   and no effect that rubs";
        return Err(Error::NoRest { why });
    }
    for omega in omegas {
        let driven = under(pendulum, p_max, *omega);
        let loaded = (0..TIMES).any(|k| {
            let tau = driven.period() * k as f64 / TIMES as f64;
            driven.acceleration(tau, balance, 0.0).abs() > NO_LOAD
        });
        if loaded {
            let why =
                "a sideways drive or an effect moves it, and eq. 1.3 is not its linear equation";
            return Err(Error::NoRest { why });
        }
    }
    Ok(())
}

/// This pendulum with another drive.
fn under(pendulum: &Pendulum, p: f64, omega: f64) -> Pendulum {
    let mut other = pendulum.clone();
    (other.drive.p, other.drive.omega) = (p.max(f64::MIN_POSITIVE), omega);
    other
}

/// What is asked at each frequency.
struct Asked {
    /// The pendulum without torque.
    level: Pendulum,
    torque: f64,
    p_max: f64,
    inverted: bool,
}

impl Asked {
    /// The critical amplitudes of both rests at a frequency, and points of curves.
    fn at(&self, omega: f64, cancel: &AtomicBool) -> Result<([Row; 2], Vec<Seed>), Error> {
        if KinkedRest::of(&under(&self.level, self.p_max, omega), BALANCES[0]).is_some() {
            let row = |balance: f64| kinked_tongues::row(&self.level, balance, omega, self.p_max);
            let upright = if self.inverted { row(BALANCES[1]) } else { Row::default() };
            return Ok(([row(BALANCES[0]), upright], Vec::new()));
        }
        let mut family = self.along_p(&self.level, omega)?;
        let balances = &BALANCES[..=usize::from(self.inverted)];
        for centre in balances {
            let of = Type { n: 1, w: 0, closure: Closure::Rest, centre: *centre };
            family.follow(of, &[[*centre, 0.0]], 0.0, cancel)?;
        }
        if self.torque != 0.0 {
            family = self.moved(&family, omega, cancel)?;
        }
        let mut seeds = Vec::new();
        let rows = BALANCES.map(|balance| {
            let critical = self.events(&family, balance, &mut seeds);
            bordered(critical, self.p_max, |p| is_stable(&family, balance, p / self.p_max))
        });
        Ok((rows, seeds))
    }

    /// No branches along `p` yet.
    fn along_p(&self, pendulum: &Pendulum, omega: f64) -> Result<Family, Error> {
        let law = Law::Quadratic([0.0, self.p_max, 0.0]);
        let base = under(pendulum, self.p_max, omega);
        Family::new(Course::new(base, vec![vec![(Parameter::P, law)]]), WHOLE, 0)
    }

    /// Amplitudes and multipliers of the events about a balance; adds them to the seeds.
    fn events(&self, family: &Family, balance: f64, seeds: &mut Vec<Seed>) -> Vec<(f64, f64)> {
        let mut critical = Vec::new();
        for branch in &family.branches {
            let cycles = family.cycles(branch.of);
            for event in &branch.run.events {
                let multiplier = match event.kind {
                    Kind::Fold | Kind::SymmetryBreaking => 1.0,
                    Kind::PeriodDoubling => -1.0,
                    _ => continue,
                };
                let place = &branch.run.orbits[event.orbit].place;
                let (at, points) = (cycles.at(place), cycles.points(place));
                if at < TIP || !is_about(balance, points[0]) {
                    continue;
                }
                critical.push((at * self.p_max, multiplier));
                let (of, kind) = (branch.of, event.kind);
                seeds.push(Seed { of, kind, points, at: [at, 0.0], along: 1 });
            }
        }
        critical
    }

    /// The branches along `p` of the orbits that rests become under the torque.
    fn moved(&self, level: &Family, omega: f64, cancel: &AtomicBool) -> Result<Family, Error> {
        let mut pendulum = self.level.clone();
        pendulum.torque = self.torque;
        let mut family = self.along_p(&pendulum, omega)?;
        let mut starts = self.doubled(level, omega, cancel)?;
        for rest in &level.branches {
            for at in [0.0, 1.0] {
                let start = self.carried(rest.of.centre, at, omega, cancel)?;
                starts.extend(start.map(|start| (at, start)));
            }
        }
        for (at, start) in starts {
            let map = PoincareMap::new(&family.pendulum(at));
            let Some(orbit) = newton::find(&map, start, 1, NEAR) else { continue };
            if !family.passes(&orbit, at) {
                family.follow(ORBIT, &[start], at, cancel)?;
            }
        }
        Ok(family)
    }

    /// Doubled orbits under the torque, at parts of the range of `p`: ends of the curves of doublings over `p` and the torque
    /// that begin at those of rests.
    fn doubled(
        &self,
        level: &Family,
        omega: f64,
        cancel: &AtomicBool,
    ) -> Result<Vec<(f64, State)>, Error> {
        let mut course = self.along_torque(0.0, omega);
        let law = Law::Quadratic([0.0, self.p_max, 0.0]);
        course.axes.insert(0, vec![(Parameter::P, law)]);
        let mut plane = Plane::new(course, 1)?;
        let mut seeds = Vec::new();
        for centre in BALANCES {
            self.events(level, centre, &mut seeds);
        }
        for seed in seeds.into_iter().filter(|seed| seed.kind == Kind::PeriodDoubling) {
            plane.add(&Seed { of: ORBIT, ..seed }, cancel)?;
        }
        let mut starts = Vec::new();
        for curve in &plane.curves {
            let critical = plane.critical(curve.of, curve.kind);
            for point in curve.points.first().into_iter().chain(curve.points.last()) {
                let [at, torque] = Place::at(&point.orbit.place);
                if torque > 0.5 {
                    starts.push((at, critical.points(&point.orbit.place)[0]));
                }
            }
        }
        Ok(starts)
    }

    /// The course along the torque at a part of the range of `p`.
    fn along_torque(&self, at: f64, omega: f64) -> Course {
        let law = Law::Quadratic([0.0, self.torque, 0.0]);
        let base = under(&self.level, at * self.p_max, omega);
        Course::new(base, vec![vec![(Parameter::Torque, law)]])
    }

    /// A point of the orbit that rest becomes as the torque grows from 0; none if it ends before.
    fn carried(
        &self,
        centre: f64,
        at: f64,
        omega: f64,
        cancel: &AtomicBool,
    ) -> Result<Option<State>, Error> {
        let family = Family::new(self.along_torque(at, omega), WHOLE, 0)?;
        let cycles = family.cycles(ORBIT);
        let place = cycles.place(&[[centre, 0.0]], 0.0);
        let Some(first) = cycles.near(&place, &cycles.along()) else { return Ok(None) };
        let (run, _) = cycles.followed(&first, WHOLE, cancel)?;
        let last = run.orbits.last().filter(|last| cycles.at(&last.place) >= 1.0);
        Ok(last.map(|last| cycles.points(&last.place)[0]))
    }

    /// The curves through the events at all frequencies.
    fn plane(
        &self,
        omegas: &[f64],
        seeds: &[Vec<Seed>],
        cancel: &AtomicBool,
    ) -> Result<Option<Plane>, Error> {
        let (Some(low), Some(high)) = (omegas.first(), omegas.last()) else { return Ok(None) };
        if low >= high {
            return Ok(None);
        }
        let mut base = self.level.clone();
        base.torque = self.torque;
        let law = |low: f64, high: f64| Law::Quadratic([low, high - low, 0.0]);
        let axes = vec![
            vec![(Parameter::P, law(0.0, self.p_max))],
            vec![(Parameter::Omega, law(*low, *high))],
        ];
        let mut plane = Plane::new(Course::new(base, axes), BORN)?;
        let kinked = KinkedRest::of(&under(&self.level, self.p_max, *low), BALANCES[0]).is_some();
        if kinked || (self.torque == 0.0 && plane.symmetry != Some(Symmetry::AtOnce)) {
            return Ok(None);
        }
        for (omega, seeds) in omegas.iter().zip(seeds) {
            for (k, seed) in seeds.iter().enumerate() {
                let beside = |(j, other): (usize, &Seed)| {
                    j != k && other.of == seed.of && (other.at[0] - seed.at[0]).abs() < NARROW
                };
                if seeds.iter().enumerate().any(beside) {
                    continue;
                }
                let at = [seed.at[0], (omega - low) / (high - low)];
                plane.add(&Seed { at, ..seed.clone() }, cancel)?;
            }
        }
        Ok(Some(plane))
    }
}

/// Whether a state is nearer to one balance than to the other.
fn is_about(balance: f64, state: State) -> bool {
    (state[0] - balance).cos() > 0.0
}

/// Whether a branch has a stable orbit about a balance at this coordinate.
fn is_stable(family: &Family, balance: f64, at: f64) -> bool {
    let stable =
        |orbit: &Orbit| orbit.tests.iter().all(|test| *test > 0.0) && orbit.product.0 < 1.0 + ALIKE;
    family.branches.iter().any(|branch| {
        let cycles = family.cycles(branch.of);
        let own = |orbit: &Orbit| is_about(balance, cycles.points(&orbit.place)[0]);
        branch.at(&cycles, at).iter().any(|orbit| own(orbit) && stable(orbit))
    })
}

/// Critical amplitudes in order, each with the stability on both sides; `stable` tells it between two of them.
pub(super) fn bordered(
    mut critical: Vec<(f64, f64)>,
    p_max: f64,
    stable: impl Fn(f64) -> bool,
) -> Row {
    critical.sort_by(|a, b| a.0.total_cmp(&b.0));
    let inner = critical.iter().map(|c| c.0);
    let ends: Vec<f64> = [0.0].into_iter().chain(inner).chain([p_max]).collect();
    let between: Vec<bool> =
        ends.windows(2).map(|both| stable(0.5 * (both[0] + both[1]))).collect();
    let with_sides = |((p, multiplier), both): (&(f64, f64), &[bool])| Critical {
        p: *p,
        multiplier: *multiplier,
        stable: [both[0], both[1]],
    };
    let rows = critical.iter().zip(between.windows(2)).map(with_sides).collect();
    Row { critical: rows, stable_at_first: between[0] }
}
