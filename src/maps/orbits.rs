//! All closed orbits of one period and winding in a box of starts, those that repel too.
//!
//! On the nodes of a grid over the box the displacement `P^n(x) - x - (2 pi w, 0)` is computed, angles
//! not wrapped. Newton's method begins in every cell around which both of its components change
//! sign, and at every node where it is least among the neighbours'.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::advance::advance;
use super::control::{Control, pool};
use super::starts::{Axis, Starts};
use crate::error::Error;
use crate::integrate::{State, accuracy};
use crate::lanes::Path;
use crate::model::Pendulum;
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit};
use crate::orbit::rotation::{Rotation, running_states};

/// The longest period that is looked for, in forcing periods.
pub const LONGEST: usize = 64;
/// The error of the displacements after five periods: they only say where to begin.
const TOLERANCE: f64 = 1e-6;
/// Starts whose step error is measured.
const ERROR_SAMPLE: usize = 200;
/// Newton's method may wander so many cells away from where it began, and at least ...
const REACH_CELLS: f64 = 8.0;
/// ... this far.
const LEAST_REACH: f64 = 0.3;
/// Points nearer than this are of one orbit.
const SAME: f64 = 1e-6;

/// What to look for, and where.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Smallest period, in forcing periods.
    pub n: usize,
    /// Net turns over it.
    pub w: i64,
    /// Angles, rad.
    pub theta: Axis,
    /// Velocities.
    pub velocity: Axis,
    /// Workers; 0 for one a processor.
    pub threads: usize,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Orbits {
    /// Orbits of the stroboscopic map.
    pub closed: Vec<PeriodicOrbit>,
    /// Without drive: rotations, closed on the angle section.
    pub running: Vec<Rotation>,
    /// How many places Newton's method began at.
    pub begun: usize,
}

/// The orbits of smallest period `n` and `w` net turns that have a point in the box.
///
/// States that friction holds fast are none: they are a set.
///
/// # Errors
/// [`Error::NotMappable`] for effects that a map cannot have, [`Error::Range`] for an `n` out of
/// range, [`Error::Interrupted`] if `control` was cancelled.
pub fn orbits(pendulum: &Pendulum, request: &Request, control: &Control) -> Result<Orbits, Error> {
    pendulum.check_mappable()?;
    if !(1..=LONGEST).contains(&request.n) {
        let value = request.n as f64;
        return Err(Error::Range { name: "n", value, allowed: "1 to 64" });
    }
    let none = Orbits { closed: Vec::new(), running: Vec::new(), begun: 0 };
    if pendulum.is_autonomous() && (request.n, request.w) != (1, 0) {
        // A flow in the plane closes without turns where it is conservative, and then everywhere.
        let running = if request.n == 1 { running_states(pendulum) } else { Vec::new() };
        let running = running.into_iter().filter(|r| r.sense == request.w).collect();
        return Ok(Orbits { running, ..none });
    }
    let starts = Starts::Grid { theta: request.theta, velocity: request.velocity };
    let field = displacements(pendulum, request, &starts, control)?;
    let begin = beginnings(&field, request);
    control.begin(begin.len());
    let map = PoincareMap::new(pendulum);
    let cell = |axis: Axis| (axis.high - axis.low) / axis.count as f64;
    let reach = LEAST_REACH.max(REACH_CELLS * cell(request.theta).hypot(cell(request.velocity)));
    let begun = begin.len();
    let found: Vec<Option<PeriodicOrbit>> = pool(request.threads)?.install(|| {
        let search = |start: &State| {
            control.check()?;
            let orbit = newton::find(&map, *start, request.n, reach);
            control.add(1);
            Ok(orbit)
        };
        begin.par_iter().map(search).collect::<Result<_, Error>>()
    })?;
    let mut closed: Vec<PeriodicOrbit> = Vec::new();
    for orbit in found.into_iter().flatten() {
        let inside = |p: &State| {
            let turned = [-TAU, 0.0, TAU].map(|turn| p[0] + turn);
            turned.iter().any(|t| request.theta.holds(*t)) && request.velocity.holds(p[1])
        };
        let held = |p: &State| p[1] == 0.0 && pendulum.equation().holds_for_ever(p[0]);
        let asked = (orbit.n, orbit.w) == (request.n, request.w);
        let known = closed.iter().any(|other| other.contains(orbit.points[0], SAME));
        if asked && !known && orbit.points.iter().any(inside) && !orbit.points.iter().any(held) {
            closed.push(orbit);
        }
    }
    Ok(Orbits { closed, begun, ..none })
}

/// The displacement from each node, infinite where it is no number.
fn displacements(
    pendulum: &Pendulum,
    request: &Request,
    starts: &Starts,
    control: &Control,
) -> Result<Vec<State>, Error> {
    let sample = starts.sampled_states(ERROR_SAMPLE, 0);
    let (strobe, _) = accuracy::choose(pendulum, &sample, TOLERANCE, Path::choose()?)?;
    let all: Vec<State> = (0..starts.len()).map(|i| starts.get(i)).collect();
    let mut theta: Vec<f64> = all.iter().map(|s| s[0]).collect();
    let mut velocity: Vec<f64> = all.iter().map(|s| s[1]).collect();
    let turns = advance(&strobe, &mut theta, &mut velocity, request.n, request.threads, control)?;
    let ends = theta.iter().zip(&velocity).zip(turns);
    let gap = |(start, ((theta, velocity), turns)): (&State, ((&f64, &f64), i64))| {
        // The turns are net: rounded from the whole way, of which this is the rest.
        let rest = accuracy::wrapped(theta - start[0]);
        [(turns - request.w) as f64 * TAU + rest, velocity - start[1]]
    };
    Ok(all.iter().zip(ends).map(gap).collect())
}

/// Where Newton's method begins, the nearest first.
fn beginnings(field: &[State], request: &Request) -> Vec<State> {
    let (columns, rows) = (request.theta.count, request.velocity.count);
    let at = |i: usize, j: usize| field[j * columns + i];
    let size = |i: usize, j: usize| at(i, j)[0].hypot(at(i, j)[1]);
    let state = |x: f64, y: f64| [request.theta.between(x), request.velocity.between(y)];
    let mut found: Vec<(f64, State)> = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let around = (j.saturating_sub(1)..rows.min(j + 2))
                .flat_map(|b| (i.saturating_sub(1)..columns.min(i + 2)).map(move |a| (a, b)));
            let own = size(i, j);
            if own.is_finite() && around.into_iter().all(|(a, b)| !(size(a, b) < own)) {
                found.push((own, state(i as f64, j as f64)));
            }
            if i + 1 == columns || j + 1 == rows {
                continue;
            }
            let corners = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
            let changes = |k: usize| {
                corners.iter().any(|c| c[k] <= 0.0) && corners.iter().any(|c| c[k] >= 0.0)
            };
            if changes(0) && changes(1) {
                let least = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)]
                    .map(|(a, b)| size(a, b))
                    .into_iter()
                    .fold(f64::INFINITY, f64::min);
                found.push((least, state(i as f64 + 0.5, j as f64 + 0.5)));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, state)| state).collect()
}
