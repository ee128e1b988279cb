//! Near returns of trajectories: candidates for cycles.

use std::cmp::Ordering;

use crate::integrate::{State, States, Strobe};
use crate::model::effects::Action;
use crate::model::{Angle, Effect, Pendulum};

/// Distance below which the return of a stroboscopic point is tried by Newton's method.
const NEAR: f64 = 0.03;
/// Multiple of the rates of drive and gravity above which no resonance with either can hold a rotation.
const ESCAPE: f64 = 10.0;

/// Returns of one trajectory that are tried: one that has settled comes back after every multiple of
/// its period, and one that stays on an orbit that repels after any number.
const TRIED: usize = 3;

/// A near return: distance, state, number of periods.
pub(super) type Return = (f64, State, usize);

/// The near returns of all trajectories, nearest first, and of each the nearest few.
///
/// Converged trajectories come before the chance returns of chaos.
pub(super) fn near_returns(strobe: &Strobe, alive: &[State], longest: usize) -> Vec<Return> {
    let mut returns: Vec<Return> = Vec::new();
    for track in tracks(strobe, alive, longest) {
        if strobe.friction && track.iter().all(|state| state[1] == 0.0) {
            // Held at every period's end: no orbit, and every n would match.
            continue;
        }
        let mut own: Vec<Return> = returns_of(strobe.angle, &track, longest).collect();
        own.sort_by(nearer);
        returns.extend(own.into_iter().take(TRIED));
    }
    returns.sort_by(nearer);
    returns
}

fn nearer(a: &Return, b: &Return) -> Ordering {
    a.0.total_cmp(&b.0).then(a.2.cmp(&b.2))
}

/// The nearest return of one trajectory.
pub(super) fn nearest_return(angle: Angle, track: &[State], longest: usize) -> Option<Return> {
    returns_of(angle, track, longest).min_by(|a, b| a.0.total_cmp(&b.0))
}

fn returns_of(angle: Angle, track: &[State], longest: usize) -> impl Iterator<Item = Return> {
    let near = move |n: usize| (angle.distance(track[n], track[0]), track[0], n);
    (1..=longest).map(near).filter(|r| r.0 < NEAR)
}

/// The speed above which rotation is not limited: if the torque exceeds all friction and nothing
/// grows with the velocity, faster motions accelerate for ever. Infinite otherwise.
pub(super) fn escape_speed(pendulum: &Pendulum) -> f64 {
    let constant = |e: &Effect| {
        !e.is(&[Action::Velocity, Action::Kinked, Action::SlidingFriction, Action::LoadedFriction])
    };
    let held = pendulum.gamma > 0.0
        || !pendulum.effects.iter().all(constant)
        || pendulum.torque.abs() <= pendulum.equation().hold(0.0);
    if held {
        return f64::INFINITY;
    }
    ESCAPE * (pendulum.motion().omega + pendulum.greatest_pull().sqrt())
}

/// The next stroboscopic points of each trajectory, starting with its own.
pub(super) fn tracks(strobe: &Strobe, states: &[State], periods: usize) -> Vec<Vec<State>> {
    let mut tracks: Vec<Vec<State>> = states.iter().map(|s| vec![*s]).collect();
    let mut states = States::from(states);
    for _ in 0..periods {
        strobe.advance(&mut states, 1);
        for (track, state) in tracks.iter_mut().zip(states.iter()) {
            track.push(state);
        }
    }
    tracks
}
