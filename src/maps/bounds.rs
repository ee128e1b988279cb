//! Numbers of periods within which a trajectory must settle.
//!
//! Motions settle at the rate of the damping, so each bound is the time in which it shrinks a free
//! motion by some power of e, within limits.

use crate::attractor::Effort;
use crate::integrate::Strobe;
use crate::model::Pendulum;

/// Least bound of a start, in periods: resonances and transient chaos last as long under strong damping.
pub const LEAST: u32 = 4000;
/// Greatest bound, in periods.
const MOST: f64 = 1e6;
/// Damping shrinks a free motion by `exp(-DECAY)` within the bound of a start.
const DECAY: f64 = 200.0;
/// As [`DECAY`] and the least bound, for a cell of a parameter map.
const CELL: (f64, f64) = (40.0, 64.0);
/// Part of a start's bound after which a search begins to observe uncaptured trajectories.
const SEARCHED: u32 = 4;
/// Integration steps of a search at least, where a period has many: steps measure the motion's own time.
const LEAST_STEPS: u32 = 1_000_000;

/// Periods in which damping shrinks a free motion by `exp(-decay)`, `2 decay / (gamma T)`, within limits.
///
/// Under dry friction alone `theta_r` replaces `gamma`: its rate at velocities near 1.
fn shrinking(pendulum: &Pendulum, decay: f64, least: f64) -> u32 {
    let rate = pendulum.damping_rate();
    let periods = if rate > 0.0 { 2.0 * decay / (rate * pendulum.period()) } else { 0.0 };
    periods.clamp(least, MOST).ceil() as u32
}

/// Periods in which what decays at this rate shrinks by `exp(-DECAY)`, from `least` to `most` or a million.
#[must_use]
pub fn decay_periods(pendulum: &Pendulum, rate: f64, least: u32, most: Option<u32>) -> u32 {
    let most = most.map_or(MOST, f64::from).max(f64::from(least));
    (DECAY / (rate * pendulum.period())).clamp(f64::from(least), most).ceil() as u32
}

/// Periods after which a start is undecided, by default.
#[must_use]
pub fn max_periods(pendulum: &Pendulum) -> u32 {
    shrinking(pendulum, DECAY, f64::from(LEAST))
}

/// Periods after which the search of a parameter map's cell begins to observe uncaptured
/// trajectories, by default.
#[must_use]
pub fn cell_periods(pendulum: &Pendulum) -> u32 {
    let (decay, least) = CELL;
    shrinking(pendulum, decay, least)
}

/// Periods after which a start is undecided where the slowest attractor known has this rate: those in which a deviation
/// shrinks at that `rate` by `exp(-DECAY)`, if free motion does not take longer.
#[must_use]
pub fn settling_periods(pendulum: &Pendulum, rate: Option<f64>) -> u32 {
    let least = max_periods(pendulum);
    rate.map_or(least, |rate| decay_periods(pendulum, rate, least, None))
}

/// Periods after which a search begins to observe uncaptured trajectories. A bound `given` for the starts is one for
/// the search too, which no bound makes shorter than usual damping does, or than a million integration steps: what
/// is called chaos is observed for as long.
#[must_use]
pub fn search_periods(strobe: &Strobe, given: Option<u32>) -> u32 {
    let least = (LEAST / SEARCHED).min(LEAST_STEPS / strobe.steps() as u32).max(1);
    let most = given.map_or(u32::MAX, |given| given.max(least));
    (max_periods(&strobe.pendulum) / SEARCHED).min(most)
}

/// Periods without capture after which a trajectory is classified as chaotic.
#[must_use]
pub fn chaos_periods(strobe: &Strobe, given: Option<u32>) -> u32 {
    search_periods(strobe, given) * (1 + Effort::THOROUGH.observation)
}
