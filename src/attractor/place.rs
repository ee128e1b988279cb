//! Which attractor a trajectory belongs to that no trap has captured.

use super::catalogue::Attractor;
use super::chaos::{self, Region};
use super::find::{Catalogue, REACH, SAME};
use super::returns::{nearest_return, tracks};
use crate::integrate::{State, Strobe};
use crate::orbit::newton;

impl Catalogue {
    /// The index of the one chaotic attractor, if there is no other attractor at all.
    #[must_use]
    pub fn only_chaos(&self) -> Option<usize> {
        match self.attractors.as_slice() {
            [one] if one.kind.is_chaotic() => Some(0),
            _ => None,
        }
    }

    /// Whether some attractor can be told only by where its trajectories stay.
    #[must_use]
    pub fn has_chaos(&self) -> bool {
        self.attractors.iter().any(|a| a.kind.is_chaotic())
    }

    /// The attractors that open trajectories belong to, where Newton's method from a near return leads to
    /// a known orbit, or the region of a known set holds the last points.
    #[must_use]
    pub fn place(&self, strobe: &Strobe, states: &[State]) -> Vec<Option<usize>> {
        let map = self.map(strobe);
        let longest = self.effort.longest_cycle;
        let place = |track: &Vec<State>| {
            let nearest = nearest_return(track, longest);
            let orbit = nearest.and_then(|(_, start, n)| newton::find(&map, start, n, REACH));
            let known = orbit.and_then(|orbit| {
                let own = |a: &Attractor| {
                    a.n.is_some() && a.points.iter().any(|p| orbit.contains(*p, SAME))
                };
                self.attractors.iter().position(own)
            });
            known.or_else(|| self.region_of(&track[1..]))
        };
        tracks(strobe, states, longest).iter().map(place).collect()
    }

    /// The attractor without trap in whose region a trajectory's last points lie.
    #[must_use]
    pub fn region_of(&self, points: &[State]) -> Option<usize> {
        let regions: Vec<(usize, &Region)> = self.regions.iter().map(|(i, r)| (*i, r)).collect();
        chaos::member_of(&regions, points)
    }
}
