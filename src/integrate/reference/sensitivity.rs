//! Derivatives of a trajectory by its parameters and its start.
//!
//! The trajectory runs over numbers with derivatives, in as many passes as that takes. The values
//! alone choose the steps, so all passes take the same ones, and the values agree bit for bit.

use std::sync::Arc;

use super::event::Event;
use super::problem::OdeProblem;
use super::sample::{Sampled, sample};
use crate::integrate::State;
use crate::integrate::tangent::Tangent;
use crate::model::{Parameter, Pendulum, Recorded};

/// Largest number of derivatives in one pass.
const WIDEST: usize = 16;

/// A trajectory at chosen times, with derivatives.
#[derive(Clone, Debug)]
pub struct Sensitivities {
    /// The variables of the derivatives: the names of [`Pendulum::parameters`], then `theta0` and `v0`.
    pub names: Vec<String>,
    /// Angle, not wrapped, and velocity at each time.
    pub states: Vec<State>,
    /// Their derivatives: for each time one for each name.
    pub slopes: Vec<Vec<State>>,
    /// Turns, sticks and releases up to the last time.
    pub events: Vec<Event>,
}

/// The trajectory of `pendulum` that starts from `start` at time `tau`, at `times`, which do not fall
/// and are not before `tau`; the error of a step is about `tolerance`.
///
/// Time in the laboratory goes on. At a turn, a stick or a release that is itself within rounding of
/// another event the derivatives belong to one side.
// Compiled where it is called: in tests alone.
#[inline]
#[must_use]
pub fn sensitivities(
    pendulum: &Pendulum,
    recorded: Option<&Arc<Recorded>>,
    start: State,
    tau: f64,
    times: &[f64],
    tolerance: f64,
) -> Sensitivities {
    let parameters = pendulum.parameters();
    let mut names: Vec<String> = parameters.iter().map(|one| pendulum.name_of(*one)).collect();
    names.extend(["theta0", "v0"].map(String::from));
    let mut all = Sensitivities {
        slopes: vec![Vec::with_capacity(names.len()); times.len()],
        names,
        states: Vec::new(),
        events: Vec::new(),
    };
    let pass = Pass { pendulum, parameters, recorded, start, tau, times, tolerance };
    let count = all.names.len();
    let mut first = 0;
    while first < count {
        // The smallest number type that holds the remaining derivatives.
        first += match count - first {
            ..=8 => pass.run::<8>(first, &mut all),
            _ => pass.run::<WIDEST>(first, &mut all),
        };
    }
    all
}

struct Pass<'a> {
    pendulum: &'a Pendulum,
    parameters: Vec<Parameter>,
    recorded: Option<&'a Arc<Recorded>>,
    start: State,
    tau: f64,
    times: &'a [f64],
    tolerance: f64,
}

impl Pass<'_> {
    /// The derivatives by `N` names from `first` on; returns their number.
    fn run<const N: usize>(&self, first: usize, all: &mut Sensitivities) -> usize {
        // A name of another pass has no direction in this one.
        let seeded =
            |index: usize, value: f64| Tangent::<f64, N>::seeded(value, index.wrapping_sub(first));
        let number = |parameter: Parameter, value: f64| {
            let index = self.parameters.iter().position(|one| *one == parameter);
            seeded(index.unwrap_or(usize::MAX), value)
        };
        let mut ode = OdeProblem::new(self.pendulum, true, self.tolerance, number).finding_turns();
        if let Some(recorded) = self.recorded {
            ode = ode.driven_by(Arc::clone(recorded));
        }
        let count = self.parameters.len();
        let start = [seeded(count, self.start[0]), seeded(count + 1, self.start[1])];
        let Sampled { states, events, .. } = sample(&ode, self.tau, start, self.times, |_, _| true);
        let filled = N.min(all.names.len() - first);
        for (slopes, state) in all.slopes.iter_mut().zip(&states) {
            slopes.extend((0..filled).map(|k| state.map(|x| x.slope[k])));
        }
        all.states = states.iter().map(|state| state.map(|x| x.value)).collect();
        all.events = events;
        filled
    }
}
