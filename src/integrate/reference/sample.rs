//! A trajectory at chosen times.

use super::dense::Curve;
use super::driver::{Driver, Piece};
use super::event::Event;
use super::problem::{OdeProblem, Past};
use crate::integrate::tangent::Number;

/// States at chosen times, and the events between them.
#[derive(Clone, Debug)]
pub struct Sampled<N> {
    /// Angle, not wrapped, and velocity at each time; not numbers after the motion left their range.
    pub states: Vec<[N; 2]>,
    /// The sense of the motion and the side of a corner at each time; none where it does not move.
    pub signs: Vec<Option<[f64; 2]>>,
    /// Memories at each time; empty where nothing depends on them.
    pub pasts: Vec<Past<N>>,
    /// Turns, sticks and releases up to the last time.
    pub events: Vec<Event>,
    /// Whether friction holds the pendulum at the last time.
    pub stuck: bool,
    /// Steps taken.
    pub steps: usize,
}

impl<N: Number> Sampled<N> {
    /// The memories at the time of that index; those of the start if nothing depends on them.
    #[must_use]
    pub fn past(&self, place: usize) -> Past<N> {
        let [theta, _] = self.states[place];
        let zero = theta.like(0.0);
        self.pasts.get(place).copied().unwrap_or([theta, zero, zero, zero, zero])
    }

    /// The input of the sensor at the time of that place: the angle, or the angle behind its play.
    #[must_use]
    pub fn given(&self, ode: &OdeProblem<N>, place: usize) -> N {
        let ([theta, _], past) = (self.states[place], self.past(place));
        // At rest the backlash is as left by the last turn: either sense may follow.
        self.signs[place]
            .map_or_else(|| theta + past[2], |[sense, _]| ode.played(theta, sense, past))
    }
}

/// The states at `times`, which do not fall and are not before `tau`, of the trajectory that starts
/// from `start` at time `tau`.
///
/// `between` is called after each step and may change the driver or, by returning `false`, end it.
pub fn sample<N: Number>(
    ode: &OdeProblem<N>,
    tau: f64,
    start: [N; 2],
    times: &[f64],
    mut between: impl FnMut(&mut Driver<'_, N>, &mut [[N; 2]]) -> bool,
) -> Sampled<N> {
    let until = times.last().copied().unwrap_or(tau);
    let mut driver = Driver::new(ode, tau, start, until);
    let mut states = Vec::with_capacity(times.len());
    let at_start = times.iter().take_while(|time| **time <= tau).count();
    states.extend(std::iter::repeat_n(driver.state, at_start));
    let mut signs = vec![driver.signs_held(); at_start];
    let kept = if ode.keeps() || ode.field().sways() { times.len() } else { 0 };
    let mut pasts = vec![driver.past; at_start.min(kept)];
    let mut curve = Curve::none(driver.state);
    while let Some(piece) = driver.advance() {
        let done = states.len();
        let due = times[done..].iter().take_while(|time| **time <= driver.tau).count();
        if due > 0 {
            let moves = matches!(piece, Piece::Step);
            if moves {
                driver.dense.trace(ode.field(), &mut curve);
            }
            signs.resize(done + due, moves.then_some(driver.dense.signs));
            pasts.resize(kept.min(done + due), if moves { driver.dense.past } else { driver.past });
            for time in &times[done..done + due] {
                let within = moves && *time < driver.tau;
                states.push(if within { curve.at(*time) } else { driver.state });
            }
            if moves && ode.field().sways() {
                for (time, past) in times[done..done + due].iter().zip(&mut pasts[done..]) {
                    let at = if *time < driver.tau { curve.sway(*time) } else { None };
                    let [.., x, y] = driver.past;
                    [past[3], past[4]] = at.unwrap_or([x, y]);
                }
            }
        }
        if !between(&mut driver, &mut states[done..]) {
            break;
        }
    }
    let lost = driver.state.map(|x| x.reset(f64::NAN, 1.0));
    states.resize(times.len(), lost);
    signs.resize(times.len(), None);
    pasts.resize(kept, [lost[0]; 5]);
    let stuck = driver.is_stuck();
    Sampled { states, signs, pasts, stuck, steps: driver.steps, events: driver.events }
}
