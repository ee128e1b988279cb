//! The branches that an orbit sheds at a doubling or at a symmetry breaking.
//!
//! The closing map of the new orbits has the multiplier 1 there, and its eigenvector points to them. At the distance `e`
//! along it the new orbit is at the coordinate `l + c e^2 + O(e^4)`: `c` is the normal form's coefficient over the speed
//! at which the multiplier passes, and its sign says on which side the new orbits live. Where a multiplier jumps over the
//! critical value the coordinate is linear in `e`, and the sign alone has a meaning.

use super::cycle::{Closure, Cycles, Orbit, Type};
use super::event::{Event, Kind};
use crate::integrate::State;
use crate::model::pendulum::Symmetry;

/// Distances along the eigenvector at which the new branch is begun, the first that succeeds.
const DISTANCES: [f64; 5] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
/// Largest distance of the new orbit from the old one in those distances, and largest change of its multipliers.
const STRAYED: f64 = 3.0;
const TURNED: f64 = 0.5;

/// The first orbits of a new branch.
#[derive(Clone, Debug)]
pub struct Shed {
    /// Their type.
    pub of: Type,
    /// The old orbit as one of the new type, and the first new one.
    pub orbits: [Orbit; 2],
    /// The coefficient `c`.
    pub side: f64,
}

impl Cycles<'_> {
    /// The type of the orbits that one of this type sheds; none where it sheds none.
    #[must_use]
    pub fn shed_type(&self, kind: Kind) -> Option<Type> {
        let Type { n, w, closure, .. } = self.of;
        let symmetric = self.symmetry == Some(Symmetry::AtOnce);
        match (kind, closure) {
            (Kind::PeriodDoubling, Closure::Rest) if symmetric => {
                Some(Type { n: 2 * n, closure: Closure::Half, ..self.of })
            }
            (Kind::PeriodDoubling, _) => {
                Some(Type { n: 2 * n, w: 2 * w, closure: Closure::Whole, ..self.of })
            }
            (Kind::SymmetryBreaking, _) => Some(Type { closure: Closure::Whole, ..self.of }),
            _ => None,
        }
    }

    /// What the orbit sheds at an event, to one side of it or, in the sense -1, to the other; none where no
    /// new orbit is found.
    #[must_use]
    pub fn shed(&self, orbit: &Orbit, event: &Event, sense: f64) -> Option<Shed> {
        let of = self.shed_type(event.kind)?;
        let new = Cycles { of, ..*self };
        let at = self.at(&orbit.place);
        let place = new.place(&self.repeated(orbit, &new), at);
        let old = new.unfollowed(&place)?;
        let direction = new.eigenvector(&old, 1.0)? * sense;
        let count = direction.len();
        let row = direction.insert_row(count, 0.0);
        let first = DISTANCES.iter().find_map(|distance| {
            let near = |by: f64| new.near(&(&place + &row * by), &row);
            let (far, half) = (near(*distance)?, near(0.5 * distance)?);
            let side = |orbit: &Orbit, by: f64| (new.at(&orbit.place) - at) / (by * by);
            // Without the next term of the series.
            let side = (4.0 * side(&half, 0.5 * distance) - side(&far, *distance)) / 3.0;
            let near = (&far.place - &place).norm() < STRAYED * distance;
            // Nothing has happened on the new branch yet; beside a jump its orbits slip in another sequence than the old one.
            let alike = !event.smooth || (far.tests[1] - old.tests[1]).abs() < TURNED;
            (near && alike).then_some((far, side))
        });
        let (far, side) = first?;
        Some(Shed { of, orbits: [Orbit { tangent: row, ..old }, far], side })
    }

    /// The points of an orbit as one of another type that has it as a special case.
    pub(super) fn repeated(&self, orbit: &Orbit, new: &Cycles<'_>) -> Vec<State> {
        let points = self.all_points(&orbit.place);
        let turns = std::f64::consts::TAU * self.of.w as f64;
        let lap = |k: usize| {
            let [theta, velocity] = points[k % points.len()];
            [theta + turns * (k / points.len()) as f64, velocity]
        };
        (0..new.count()).map(lap).collect()
    }
}
