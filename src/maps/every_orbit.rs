//! The orbits of all periods up to one and with any turns, at once.
//!
//! As [`super::orbits`], from one grid a period: the displacement is compared with all multiples of a turn. What is found has
//! the precision of lanes, enough to be followed from. Where motions part so fast that the grid does not resolve them,
//! Newton's method starts from the cells in which the displacement is nearest to a linear function.

use std::f64::consts::{PI, TAU};

use super::advance::advance;
use super::branches::falling;
use super::control::Control;
use super::multistart::{approach, places};
use super::orbits::is_held;
use super::starts::Axis;
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::lanes::InstructionSet;
use crate::model::Pendulum;
use crate::model::pendulum::{Route, Symmetry};
use crate::orbit::PoincareMap;
use crate::orbit::newton::{self, PeriodicOrbit};

/// Lengths of steps for displacements and for orbits, in units of the fastest small oscillation: errors of 1e-5 and 1e-10 in a
/// few periods.
const STEPS: [f64; 2] = [0.3, 0.06];
/// Cells along a turn, a period: where several types are searched, and for one, of which this many periods count.
const CELLS: usize = 60;
const FINE: usize = 200;
const FINER: usize = 4;
/// Starts of Newton's method at most, a period, where many searches are made.
const MOST: usize = 4_000;
/// Its largest distance from a start, in cells, and the least value of that distance.
const REACH: f64 = 8.0;
const LEAST_REACH: f64 = 0.3;
/// Net turns that an orbit may have.
pub(super) const ANY_TURNS: [i64; 2] = [-1_000_000, 1_000_000];
/// A start this near to an orbit leads to it.
const KNOWN: f64 = 1e-3;

/// Orbits with smallest periods up to `longest`; of mirror images one, where the mirrored motion needs no time.
///
/// # Errors
/// The errors of [`super::orbits::orbits`].
pub fn every_orbit(
    pendulum: &Pendulum,
    longest: usize,
    threads: usize,
    control: &Control,
) -> Result<Vec<PeriodicOrbit>, Error> {
    let mirrored = pendulum.symmetry() == Some(Symmetry::AtOnce);
    let types: Vec<_> = (1..=longest).map(|n| (n, ANY_TURNS)).collect();
    of_types(pendulum, &types, mirrored, MOST, threads, control)
}

/// Orbits with these periods and net turns, from the least to the most, by Newton's method from at most so many starts a
/// period; if `mirrored`, of mirror images one, that turns forward.
///
/// # Errors
/// The errors of [`super::orbits::orbits`].
pub(super) fn of_types(
    pendulum: &Pendulum,
    types: &[(usize, [i64; 2])],
    mirrored: bool,
    most: usize,
    threads: usize,
    control: &Control,
) -> Result<Vec<PeriodicOrbit>, Error> {
    // A fall from the top under the largest acceleration, or a rotation by a turn a period, or as fast as asked.
    let asked = types.iter().filter(|(_, turns)| *turns != ANY_TURNS);
    let turning = asked.map(|(n, [least, most])| least.abs().max(most.abs()) as f64 / *n as f64);
    let reach = falling(pendulum).hypot(TAU / pendulum.period() * turning.fold(1.0, f64::max));
    let sides = if mirrored { 1 } else { 2 };
    let low = if mirrored { 0.0 } else { -reach };
    let simd = InstructionSet::choose()?;
    let grid = |n: usize| {
        let count = if types.len() > 1 { CELLS * n } else { FINE * n.min(FINER) };
        let theta = Axis::new("theta", -PI, PI, count)?;
        Ok::<_, Error>([theta, Axis::new("velocity", low, reach, count * sides / 2)?])
    };
    let duration = pendulum.period() * pendulum.greatest_pull().sqrt();
    let [coarse, fine] =
        STEPS.map(|step| Strobe::new(pendulum, (duration / step).ceil() as usize, simd));
    let plain = pendulum.route() == Route::Smooth && !pendulum.has_extra_load();
    let map = if plain { PoincareMap::of_steps(&fine) } else { PoincareMap::new(pendulum) };
    let mut all: Vec<PeriodicOrbit> = Vec::new();
    for &(n, turns) in types {
        let displacement = |from: &[State]| -> Result<Vec<State>, Error> {
            let (ends, turns) = advance(&coarse, from, n, threads, control)?;
            let gap = |(start, (end, turns)): (&State, (State, i64))| {
                let rest = coarse.angle.wrapped(end[0] - start[0]);
                [rest + turns as f64 * TAU, end[1] - start[1]]
            };
            Ok(from.iter().zip(ends.iter().zip(turns)).map(gap).collect())
        };
        let axes = grid(n)?;
        let mut places = places(axes, turns, most, &displacement)?;
        places.truncate(most);
        let cell = TAU / axes[0].count as f64;
        let far = LEAST_REACH.max(REACH * cell);
        let near = approach(&places, far, displacement)?;
        let known = |state: &State| all.iter().any(|orbit| orbit.contains(*state, KNOWN));
        let starts: Vec<(State, usize)> =
            near.into_iter().filter(|state| !known(state)).map(|state| (state, n)).collect();
        for mut orbit in newton::find_others(&map, &starts, LEAST_REACH, &[]) {
            let mut image = orbit.mirrored().0;
            if mirrored && orbit.w < 0 {
                std::mem::swap(&mut orbit, &mut image);
            }
            let alike =
                |other: &PeriodicOrbit| other.is_same(&orbit) || mirrored && other.is_same(&image);
            if !is_held(pendulum, &orbit) && !all.iter().any(alike) {
                all.push(orbit);
            }
        }
        control.check()?;
    }
    Ok(all)
}
