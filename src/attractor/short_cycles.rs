//! Stable orbits of few periods not reached by any trajectory, since their basins are too small for
//! a few starts to hit.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, Ordering};

use super::find::{Catalogue, REACH};
use crate::integrate::{State, Strobe};
use crate::model::Angle;
use crate::orbit::{PoincareMap, newton};

/// Longest period, in forcing periods.
const LONGEST: usize = 4;
/// Starts along each side of the grid.
const SIDE: usize = 64;
/// Number of orbits sought from one start.
const BESIDE: usize = 3;
/// Factor by which the grid exceeds the largest velocity observed.
const MARGIN: f64 = 1.1;

impl Catalogue {
    /// Newton's method from where a grid of starts comes back nearest to itself, after 1 to 4 periods; whether
    /// a stable orbit was found that was not known.
    ///
    /// The grid reaches as far as the velocities of `points`, and on the line their angles.
    pub(super) fn find_short_cycles(
        &mut self,
        strobe: &Strobe,
        points: &[State],
        cancel: &AtomicBool,
    ) -> bool {
        let reach = |part: usize| points.iter().fold(0.0_f64, |most, s| most.max(s[part].abs()));
        let widest = if strobe.angle == Angle::Circle { PI } else { MARGIN * reach(0) };
        let fastest = MARGIN * reach(1);
        let (map, steps) = (self.map(strobe), PoincareMap::of_steps(strobe));
        let known = self.orbits.len();
        // Repelled by all orbits met: a stable orbit is next to the one it was created with.
        let mut met: Vec<State> = Vec::new();
        for (starts, n) in least_gaps(strobe, [widest, fastest]).iter().zip(1..) {
            for start in starts.iter().take(self.effort.short_tries) {
                for _ in 0..BESIDE {
                    let found = newton::find_other(&steps, *start, n, REACH, &met);
                    let Some(orbit) = found.filter(|_| !cancel.load(Ordering::Relaxed)) else {
                        break;
                    };
                    met.extend(&orbit.points);
                    if let Some(orbit) = self.refined(strobe, &map, orbit) {
                        self.admit(strobe, &map, orbit, cancel);
                    }
                }
            }
        }
        let found = self.orbits.len() > known;
        if found {
            self.rebuild(&strobe.pendulum);
        }
        found
    }
}

/// Starts of the grid whose gap after 1, 2, ... periods is less than those of their neighbours, the least
/// first.
fn least_gaps(strobe: &Strobe, [widest, fastest]: State) -> [Vec<State>; LONGEST] {
    let at = |k: usize| {
        let part = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
        [2.0 * widest * part(k % SIDE), 2.0 * fastest * part(k / SIDE)]
    };
    let starts: Vec<State> = (0..SIDE * SIDE).map(at).collect();
    let (mut theta, mut velocity): (Vec<f64>, Vec<f64>) =
        starts.iter().map(|s| (s[0], s[1])).unzip();
    let mut turns = vec![0.0; starts.len()];
    let symmetric = strobe.pendulum.is_mirror_symmetric();
    std::array::from_fn(|_| {
        // Lengths agree, so this cannot fail.
        let _ = strobe.advance(&mut theta, &mut velocity, &mut turns, 1);
        let gap: Vec<f64> = (0..starts.len())
            .map(|k| strobe.angle.distance([theta[k], velocity[k]], starts[k]))
            .collect();
        let lowest = |k: &usize| {
            let (i, j) = (k % SIDE, k / SIDE);
            let rows = j.saturating_sub(1)..=(j + 1).min(SIDE - 1);
            rows.flat_map(|b| [SIDE - 1, 0, 1].map(|a| b * SIDE + (i + a) % SIDE))
                .all(|other| gap[*k] <= gap[other])
        };
        // Of mirror images one is sufficient.
        let count = if symmetric { starts.len() / 2 } else { starts.len() };
        let mut least: Vec<usize> = (0..count).filter(lowest).collect();
        least.sort_by(|a, b| gap[*a].total_cmp(&gap[*b]));
        least.into_iter().map(|k| starts[k]).collect()
    })
}
