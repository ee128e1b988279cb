//! The stroboscopic map of any model, by the reference integrator: state, derivative, multipliers.

use super::driver::Driver;
use super::problem::OdeProblem;
use crate::integrate::State;
use crate::integrate::tangent::Tangent;
use crate::model::Pendulum;
use crate::model::pendulum::Route;

/// Error tolerance of a step in the maps of orbits.
const PRECISE: f64 = 3e-15;

/// A model that advances states from one time to another, with derivatives by the initial state.
///
/// Time in the laboratory is held, as in all maps.
#[derive(Clone, Debug)]
pub struct Flow {
    ode: OdeProblem<Tangent<f64, 2>>,
    gamma: f64,
    contracts_evenly: bool,
}

/// The result of an integration.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Angle, not wrapped, and velocity; not numbers if the motion left their range.
    pub state: State,
    /// Its derivative by the first state, by rows: `[[d th/d th0, d th/d v0], [d v/d th0, ..]]`.
    pub derivative: [[f64; 2]; 2],
    /// The determinant of the derivative without its rounding errors: `exp(-gamma duration)` times
    /// the ratios of the accelerations after and before each turn, 0 after a stick. `None` where
    /// something else depends on the velocity.
    pub product: Option<f64>,
    /// Whether friction holds the pendulum at the end.
    pub stuck: bool,
    /// Whether it holds it for ever.
    pub stuck_for_ever: bool,
}

impl Flow {
    /// The map of `pendulum`, with errors near rounding: a few 1e-14 after a period, times what the motion
    /// amplifies.
    #[must_use]
    pub fn new(pendulum: &Pendulum) -> Self {
        Self::with_tolerance(pendulum, PRECISE)
    }

    /// The map with an error of about `tolerance` a step.
    #[must_use]
    pub fn with_tolerance(pendulum: &Pendulum, tolerance: f64) -> Self {
        Self {
            ode: OdeProblem::new(pendulum, false, tolerance, |_, value| Tangent {
                value,
                slope: [0.0; 2],
            }),
            gamma: pendulum.gamma,
            contracts_evenly: pendulum.route() != Route::General,
        }
    }

    /// `state` at time `tau`, `duration` later. A velocity of exactly 0 is at rest.
    #[must_use]
    pub fn carry(&self, state: State, tau: f64, duration: f64) -> Arrival {
        let start = [Tangent::seeded(state[0], 0), Tangent::seeded(state[1], 1)];
        let mut driver = Driver::new(&self.ode, tau, start, tau + duration);
        driver.finish(|_| ());
        let [theta, velocity] = driver.state;
        Arrival {
            state: [theta.value, velocity.value],
            derivative: [theta.slope, velocity.slope],
            product: self.contracts_evenly.then(|| (-self.gamma * duration).exp() * driver.ratio),
            stuck: driver.is_stuck(),
            stuck_for_ever: driver.is_stuck_for_ever(),
        }
    }
}
