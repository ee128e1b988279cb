//! All periodic orbits of one period and some windings in a box of starts, stable and unstable.
//!
//! Newton's method starts wherever the displacement `P^n(x) - x - (2 pi w, 0)`, angles not wrapped,
//! may vanish (`multistart`). Next to an orbit near its bifurcation it starts again, deflated by
//! all known orbits: merging branches are closer to one another than any cell.

use std::f64::consts::{PI, TAU};

use nalgebra::Matrix2;
use rayon::prelude::*;

use super::advance::advance;
use super::control::{Control, pool};
use super::multistart::{approach, places};
use super::starts::{Axis, Starts};
use crate::error::Error;
use crate::integrate::{State, accuracy};
use crate::lanes::InstructionSet;
use crate::memory;
use crate::model::{Angle, Pendulum};
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit};
use crate::orbit::rotation::{Rotation, running_states};
use crate::orbit::symmetry::Mirror;

/// The longest period of a request, in forcing periods.
pub const LONGEST: usize = 64;
/// Largest number of cells that are quartered.
pub(super) const MOST_CELLS: usize = 60_000;
/// Error of the displacements after five periods, used for starting points only.
const TOLERANCE: f64 = 1e-6;
/// Memory of a cell, bytes: its corner, its image, and intermediate results.
const EACH: usize = 128;
/// Number of starts used to measure the step error.
const ERROR_SAMPLE: usize = 200;
/// Largest distance of Newton's method from its start, in cells.
const REACH_CELLS: f64 = 8.0;
/// Least value of that distance.
const LEAST_REACH: f64 = 0.3;
/// With friction, speeds below this are zero.
const STILL: f64 = 1e-9;
/// A multiplier this near to 1 is set to it.
const CREEPS: f64 = 1e-3;
/// Number of angles at which the load on an undriven pendulum is sampled, and of halvings between
/// two of them.
const LOOKS: usize = 2000;
const BISECTIONS: usize = 60;
/// Orbits near another one are sought only if the derivative of the displacement shrinks a
/// direction below this.
const WEAK: f64 = 0.3;
/// Largest distance at which they are sought.
const FURTHEST: f64 = 0.3;
/// Number of halvings of that distance.
const HALVINGS: u32 = 9;

/// A request for periodic orbits.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Smallest period, in forcing periods.
    pub n: usize,
    /// Net turns over it: the least and the most.
    pub w: [i64; 2],
    /// Angles, rad.
    pub theta: Axis,
    /// Velocities.
    pub velocity: Axis,
    /// Workers; 0 for one a processor.
    pub threads: usize,
}

/// The periodic orbits found.
#[derive(Clone, Debug)]
pub struct Orbits {
    /// Orbits of the stroboscopic map.
    pub closed: Vec<PeriodicOrbit>,
    /// Without drive: rotations, closed on the angle section.
    pub running: Vec<Rotation>,
    /// Number of starting points of Newton's method.
    pub begun: usize,
}

/// The orbits of smallest period `n` with these net turns that have a point in the box.
///
/// States held by friction are excluded: they are a set.
///
/// # Errors
/// [`Error::NotMappable`] for effects that a map cannot have, [`Error::Range`] for an `n` out of
/// range, [`Error::Memory`] for too fine a grid, [`Error::Interrupted`] if `control` was cancelled.
pub fn orbits(pendulum: &Pendulum, request: &Request, control: &Control) -> Result<Orbits, Error> {
    pendulum.check_mappable()?;
    if !(1..=LONGEST).contains(&request.n) {
        let value = request.n as f64;
        return Err(Error::Range { name: "n", value, allowed: "a whole number from 1 to 64" });
    }
    let cells = request.theta.count * request.velocity.count;
    memory::reckon("cells", cells, EACH)?;
    let none = Orbits { closed: Vec::new(), running: Vec::new(), begun: 0 };
    let turns = request.w[0]..=request.w[1];
    let mut running = Vec::new();
    if pendulum.is_autonomous() {
        // Without turns a flow in the plane has closed orbits only if it is conservative, and then
        // everywhere.
        if request.n == 1 {
            running = running_states(pendulum);
            running.retain(|r| turns.contains(&r.sense));
        }
        if request.n > 1 || !turns.contains(&0) {
            return Ok(Orbits { running, ..none });
        }
    }
    let cell = |axis: Axis| (axis.high - axis.low) / axis.count as f64;
    let reach = LEAST_REACH.max(REACH_CELLS * cell(request.theta).hypot(cell(request.velocity)));
    let begin = if pendulum.is_autonomous() {
        rests(pendulum, request.theta)
    } else {
        beginnings(pendulum, request, reach, control)?
    };
    // After the search, which refuses a drive that steps cannot follow.
    let map = PoincareMap::new(pendulum);
    let mirror = Mirror::of(pendulum);
    let pool = pool(request.threads)?;
    let mut all: Vec<PeriodicOrbit> = Vec::new();
    let mut begun = 0;
    let mut known: Vec<State> = Vec::new();
    // First from all starting points, then from near the orbits found last, until there are no new
    // ones.
    let mut next = begin;
    while !next.is_empty() {
        control.begin(next.len());
        begun += next.len();
        let search = |start: &State| {
            control.check()?;
            let orbit = newton::find_other(&map, *start, request.n, reach, &known);
            control.add(1);
            Ok(orbit)
        };
        let found: Vec<Option<PeriodicOrbit>> =
            pool.install(|| next.par_iter().map(search).collect::<Result<_, Error>>())?;
        let before = all.len();
        for orbit in found.into_iter().flatten() {
            if is_held(pendulum, &orbit) {
                continue;
            }
            let image = mirror.as_ref().and_then(|m| Some(m.orbit(&map, &orbit)?.0));
            for one in std::iter::once(orbit).chain(image) {
                if !all.iter().any(|other| other.is_same(&one)) {
                    all.push(one);
                }
            }
        }
        known = all.iter().flat_map(|orbit| orbit.points.iter().copied()).collect();
        let new = if pendulum.is_autonomous() { &[] } else { &all[before..] };
        next = new.iter().flat_map(|orbit| beside(orbit, request.n)).collect();
    }
    let inside = |p: &State| {
        let within = |turn: &f64| request.theta.holds(p[0] + turn);
        map.angle.turns().iter().any(within) && request.velocity.holds(p[1])
    };
    all.retain(|orbit| {
        let asked = orbit.n == request.n && turns.contains(&orbit.w);
        asked && orbit.points.iter().any(inside)
    });
    Ok(Orbits { closed: all, running, begun })
}

/// Whether friction holds the orbit. Newton's method leaves a velocity of the size of rounding, and creeps to the edge of
/// the held set: there, too, neighbours remain at rest, and a multiplier is 1.
pub(super) fn is_held(pendulum: &Pendulum, orbit: &PeriodicOrbit) -> bool {
    if !pendulum.has_friction() {
        return false;
    }
    let equation = pendulum.equation();
    let creeps = (orbit.multipliers.largest() - 1.0).abs() < CREEPS;
    let stays = |p: &State| p[1].abs() < STILL && (creeps || equation.holds_for_ever(p[0]));
    orbit.points.iter().any(stays)
}

/// Equilibria of an undriven pendulum: other orbits close after a given time only by coincidence.
fn rests(pendulum: &Pendulum, theta: Axis) -> Vec<State> {
    let pull = |theta: f64| pendulum.acceleration(0.0, theta, 0.0);
    let (low, high) = match pendulum.angle() {
        Angle::Circle => (-PI, PI),
        Angle::Line => (theta.low, theta.high),
    };
    let angle = |k: usize| low + (high - low) * (k as f64 + 0.5) / LOOKS as f64;
    let between = |k: usize| {
        let (mut low, mut high) = (angle(k), angle(k + 1));
        if (pull(low) > 0.0) == (pull(high) > 0.0) {
            return None;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if (pull(middle) > 0.0) == (pull(low) > 0.0) { low = middle } else { high = middle }
        }
        Some([0.5 * (low + high), 0.0])
    };
    (0..LOOKS).filter_map(between).collect()
}

/// The starting points of Newton's method.
fn beginnings(
    pendulum: &Pendulum,
    request: &Request,
    reach: f64,
    control: &Control,
) -> Result<Vec<State>, Error> {
    let starts = Starts::Grid { theta: request.theta, velocity: request.velocity };
    let sample = starts.sampled_states(ERROR_SAMPLE, 0);
    let simd = InstructionSet::choose()?;
    let (strobe, _) =
        accuracy::choose(pendulum, &sample, TOLERANCE, simd).map_err(|error| match error {
            Error::Tolerance { tol, reached } => Error::Unresolved { needed: tol, reached },
            other => other,
        })?;
    // The displacement is the total one, of which the turns are net.
    let displacements = |from: &[State]| -> Result<Vec<State>, Error> {
        let (ends, turns) = advance(&strobe, from, request.n, request.threads, control)?;
        let ends = ends.to_vec().into_iter().zip(turns);
        let gap = |(start, ([theta, velocity], turns)): (&State, (State, i64))| {
            let rest = strobe.angle.wrapped(theta - start[0]);
            [turns as f64 * TAU + rest, velocity - start[1]]
        };
        Ok(from.iter().zip(ends).map(gap).collect())
    };
    let places = places([request.theta, request.velocity], request.w, MOST_CELLS, &displacements)?;
    approach(&places, reach, displacements)
}

/// Starts near an orbit whose displacement over `n` periods is almost constant in one direction:
/// only there can another one be closer than a cell.
fn beside(orbit: &PeriodicOrbit, n: usize) -> Vec<State> {
    let whole = orbit.monodromy[0].pow((n / orbit.n) as u32);
    let svd = (whole - Matrix2::identity()).svd(false, true);
    let Some(rows) = svd.v_t else { return Vec::new() };
    let least = svd.singular_values.imin();
    if svd.singular_values[least] > WEAK {
        return Vec::new();
    }
    let [theta, velocity] = orbit.points[0];
    let at = |away: f64| [theta + away * rows[(least, 0)], velocity + away * rows[(least, 1)]];
    (0..HALVINGS)
        .flat_map(|k| {
            let away = FURTHEST / f64::from(1_u32 << k);
            [at(away), at(-away)]
        })
        .collect()
}
