//! Regions of a range: between neighbouring events of all branches the same orbits are stable.

use super::cycle::Orbit;
use super::family::{Branch, Family};

/// Part of the range that rounding moves an event by.
const NARROW: f64 = 1e-11;

/// Neighbouring coordinates with the same stable orbits.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The lower end.
    pub from: f64,
    /// The upper end.
    pub to: f64,
    /// The branches of the stable orbits, in their order; one that passes twice is there twice.
    pub stable: Vec<usize>,
}

/// A piece of a branch between two orbits that are stable: the coordinates there, and the branch.
type Piece = ([f64; 2], usize);

impl Family {
    /// The regions, in the order of the coordinate.
    #[must_use]
    pub fn regions(&self) -> Vec<Region> {
        let mut cuts = vec![self.bounds.low, self.bounds.high];
        let mut pieces: Vec<Piece> = Vec::new();
        for (number, branch) in self.branches.iter().enumerate() {
            self.divide(branch, number, &mut cuts, &mut pieces);
        }
        cuts.retain(|cut| (self.bounds.low..=self.bounds.high).contains(cut));
        cuts.sort_by(f64::total_cmp);
        let mut regions: Vec<Region> = Vec::new();
        for ends in cuts.windows(2) {
            if ends[1] - ends[0] < NARROW * (self.bounds.high - self.bounds.low) {
                continue;
            }
            let middle = 0.5 * (ends[0] + ends[1]);
            let holds = |([a, b], _): &&Piece| a.min(*b) <= middle && middle < a.max(*b);
            let stable: Vec<usize> = pieces.iter().filter(holds).map(|piece| piece.1).collect();
            match regions.last_mut() {
                Some(last) if last.stable == stable => last.to = ends[1],
                last => {
                    let from = last.map_or(ends[0], |last| last.to);
                    regions.push(Region { from, to: ends[1], stable });
                }
            }
        }
        regions
    }

    /// Adds the events and ends of a branch to the cuts, and its stable pieces.
    fn divide(&self, branch: &Branch, number: usize, cuts: &mut Vec<f64>, pieces: &mut Vec<Piece>) {
        let cycles = self.cycles(branch.of);
        let orbits = &branch.run.orbits;
        let at = |orbit: &Orbit| cycles.at(&orbit.place);
        let mut critical = vec![false; orbits.len()];
        for event in &branch.run.events {
            critical[event.orbit] = true;
            cuts.push(at(&orbits[event.orbit]));
        }
        cuts.extend([orbits.first(), orbits.last()].into_iter().flatten().map(at));
        let size: Vec<f64> =
            orbits.iter().map(|orbit| cycles.multipliers(orbit).largest()).collect();
        for k in 1..orbits.len() {
            // At an event a multiplier is critical: the orbit beside it tells.
            let largest = match [critical[k - 1], critical[k]] {
                [true, false] => size[k],
                [false, true] => size[k - 1],
                _ => size[k - 1].min(size[k]),
            };
            if largest < 1.0 {
                pieces.push(([at(&orbits[k - 1]), at(&orbits[k])], number));
            }
        }
    }
}
