//! Stable orbits of few periods not reached by any trajectory, since their basins are too small for
//! a few starts to hit.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use super::find::{Catalogue, REACH};
use crate::error::{Error, unless_cancelled};
use crate::integrate::{State, States, Strobe};
use crate::model::Angle;
use crate::orbit::{PoincareMap, newton};

/// Longest period, in forcing periods.
const LONGEST: usize = 4;
/// Starts along each side of the grid.
const SIDE: usize = 64;
/// Starts from which Newton's method is tried, for each period.
const TRIED: usize = 16;
/// Number of times that each start is tried, the later ones repelled by the orbits met before.
const BESIDE: usize = 4;
/// Factor by which the grid exceeds the largest velocity observed.
const MARGIN: f64 = 1.1;

impl Catalogue {
    /// Newton's method from where a grid of starts comes back nearest to itself, after 1 to 4 periods; whether
    /// a stable orbit was found that was not known. Where they have been sought before, they are not again.
    ///
    /// The grid reaches as far as the velocities of `points`, and on the line their angles.
    pub(super) fn find_short_cycles(
        &mut self,
        strobe: &Strobe,
        points: &[State],
        cancel: &AtomicBool,
    ) -> Result<bool, Error> {
        let reach = |part: usize| points.iter().fold(0.0_f64, |most, s| most.max(s[part].abs()));
        let extents = [if strobe.angle == Angle::Circle { PI } else { reach(0) }, reach(1)];
        if extents.iter().zip(&self.sought).all(|(wanted, sought)| wanted <= sought) {
            return Ok(false);
        }
        let widest = if strobe.angle == Angle::Circle { PI } else { MARGIN * extents[0] };
        let fastest = MARGIN * extents[1];
        self.sought = [widest, fastest];
        let (map, steps) = (self.effort.map(strobe), PoincareMap::of_steps(strobe));
        let known = self.orbits.len();
        // Repelled by all orbits met: a stable orbit is next to the one it was created with.
        let mut met: Vec<State> = Vec::new();
        for (starts, n) in least_gaps(strobe, [widest, fastest]).iter().zip(1..) {
            let starts: Vec<_> = starts.iter().take(TRIED).map(|start| (*start, n)).collect();
            for _ in 0..BESIDE {
                unless_cancelled(cancel)?;
                let found = newton::find_others(&steps, &starts, REACH, &met);
                if found.is_empty() {
                    break;
                }
                for orbit in found {
                    met.extend(&orbit.points);
                    if let Some(orbit) = self.refined(strobe, &map, orbit) {
                        self.admit(strobe, &map, orbit, cancel)?;
                    }
                }
            }
        }
        let found = self.orbits.len() > known;
        if found {
            self.rebuild(&strobe.pendulum);
        }
        Ok(found)
    }
}

/// Starts of the grid whose gap after 1, 2, ... periods is less than those of their neighbours, the least
/// first.
fn least_gaps(strobe: &Strobe, [widest, fastest]: State) -> [Vec<State>; LONGEST] {
    let at = |k: usize| {
        let part = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
        [2.0 * widest * part(k % SIDE), 2.0 * fastest * part(k / SIDE)]
    };
    // Of mirror images one is sufficient: half of the plane, and the row beside it.
    let symmetric = strobe.pendulum.is_mirror_symmetric();
    let rows = if symmetric { SIDE / 2 } else { SIDE };
    let count = rows * SIDE;
    let starts: Vec<State> = (0..(count + SIDE).min(SIDE * SIDE)).map(at).collect();
    let mut states = States::from(starts.as_slice());
    std::array::from_fn(|_| {
        strobe.advance(&mut states, 1);
        let ends = states.iter().zip(&starts);
        let gap: Vec<f64> = ends.map(|(end, start)| strobe.angle.distance(end, *start)).collect();
        let lowest = |k: &usize| {
            let (i, j) = (k % SIDE, k / SIDE);
            let rows = j.saturating_sub(1)..=(j + 1).min(SIDE - 1);
            rows.flat_map(|b| [SIDE - 1, 0, 1].map(|a| b * SIDE + (i + a) % SIDE))
                .all(|other| gap[*k] <= gap[other])
        };
        let mut least: Vec<usize> = (0..count).filter(lowest).collect();
        least.sort_by(|a, b| gap[*a].total_cmp(&gap[*b]));
        least.into_iter().map(|k| starts[k]).collect()
    })
}
