//! How far an orbit swings.

use super::cycle::{Cycles, Orbit};
use crate::integrate::reference::driver::Driver;
use crate::integrate::reference::event::EventKind;
use crate::integrate::reference::problem::OdeProblem;

/// Error of a step.
const PRECISE: f64 = 1e-13;

impl Cycles<'_> {
    /// Half the angle between the outermost turns of an orbit, and how often it swings to and fro; none for a
    /// rotation.
    #[must_use]
    pub fn swing(&self, orbit: &Orbit) -> Option<(f64, usize)> {
        if self.of.w != 0 {
            return None;
        }
        let pendulum = self.course.pendulum(&[self.at(&orbit.place)]);
        let ode = OdeProblem::new(&pendulum, false, PRECISE, |_, value| value).finding_turns();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut turns = 0;
        for point in self.all_points(&orbit.place) {
            let mut driver = Driver::new(&ode, 0.0, point, pendulum.period());
            driver.finish(|_| ());
            let stops = driver.events.iter().filter(|event| event.kind != EventKind::Release);
            for event in stops {
                low = low.min(event.theta);
                high = high.max(event.theta);
                turns += 1;
            }
            if point[1] == 0.0 {
                low = low.min(point[0]);
                high = high.max(point[0]);
            }
        }
        // At rest nothing turns.
        Some(((0.5 * (high - low)).max(0.0), turns / 2))
    }
}
