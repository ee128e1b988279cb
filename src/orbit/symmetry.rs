//! Mirror images of states and orbits.

use super::newton::{self, PeriodicOrbit};
use super::poincare::PoincareMap;
use crate::integrate::State;
use crate::integrate::reference::flow::Flow;
use crate::model::pendulum::Symmetry;
use crate::model::{Angle, Pendulum};

/// Error of a step of the flow over half a period.
const STEP_ERROR: f64 = 1e-12;
/// Largest distance of Newton's method from the image given by half a period.
const REACH: f64 = 0.1;
/// An orbit is clearly nearer than its mirror image if that is this many times as far.
const CLEARLY: f64 = 3.0;

/// The symmetry of a pendulum, acting on stroboscopic states.
#[derive(Debug)]
pub struct Mirror {
    angle: Angle,
    /// Half a period, where the symmetry takes it.
    half: Option<(Flow, f64)>,
}

impl Mirror {
    /// The symmetry of `pendulum`; none if it has none.
    #[must_use]
    pub fn of(pendulum: &Pendulum) -> Option<Self> {
        let half = match pendulum.symmetry()? {
            Symmetry::AtOnce => None,
            Symmetry::HalfPeriod => {
                let flow = Flow::with_tolerance(pendulum, STEP_ERROR);
                Some((flow, 0.5 * pendulum.period()))
            }
        };
        Some(Self { angle: pendulum.angle(), half })
    }

    /// The stroboscopic state of the mirrored motion.
    #[must_use]
    pub fn image(&self, state: State) -> State {
        let [theta, velocity] = match &self.half {
            None => state,
            Some((flow, half)) => flow.carry(state, 0.0, *half).state,
        };
        [self.angle.wrapped(-theta), -velocity]
    }

    /// How far the image of a point of an orbit may lie from that of the image's orbit: a map of steps errs,
    /// and the flow over half a period does not.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        if self.half.is_some() { 1e-4 } else { 1e-7 }
    }

    /// Whether an orbit continues that of a similar pendulum with the point `start`: both are symmetric or neither is
    /// (unless `symmetric` is unknown), and of a pair of mirror images it is clearly the nearer one.
    #[must_use]
    pub fn continues(&self, orbit: &PeriodicOrbit, start: State, symmetric: Option<bool>) -> bool {
        let image: Vec<State> = orbit.points.iter().map(|p| self.image(*p)).collect();
        let is_symmetric = image.iter().all(|p| orbit.contains(*p, self.tolerance()));
        let apart = |points: &[State]| {
            let away = points.iter().map(|p| self.angle.distance(*p, start));
            away.fold(f64::INFINITY, f64::min)
        };
        let nearer = is_symmetric || CLEARLY * apart(&orbit.points) <= apart(&image);
        nearer && symmetric.is_none_or(|known| known == is_symmetric)
    }

    /// The mirror image of an orbit of `map`, and where that is exact the number of places that its points
    /// have moved ([`PeriodicOrbit::mirrored`]).
    ///
    /// None if Newton's method does not find it.
    #[must_use]
    pub fn orbit(
        &self,
        map: &PoincareMap,
        orbit: &PeriodicOrbit,
    ) -> Option<(PeriodicOrbit, Option<usize>)> {
        if self.half.is_none() {
            let (image, moved) = orbit.mirrored();
            return Some((image, Some(moved)));
        }
        let image = self.image(orbit.points[0]);
        let found = newton::find(map, image, orbit.n, REACH)?;
        let own = found.n == orbit.n
            && found.points.iter().any(|p| self.angle.distance(*p, image) < 1e-2);
        own.then_some((found, None))
    }
}
