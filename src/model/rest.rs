//! The pendulum at rest under friction: its stability, and the time of its release.
//!
//! Stuck now: `|load| <= friction` at `th' = 0`. Under the harmonic drive, with `S = sin th` and all
//! torques and frictions that do not change in `torque` and `theta_r`, the excess of the load in the
//! sense `s` is `s (torque - S) - s S p cos(omega tau + phase) - theta_r`, so the release has a closed
//! form. Otherwise the excess is sampled, and looked at closely wherever it
//! has a maximum.

use std::f64::consts::{PI, TAU};

use super::equation::{Equation, Forcing};

/// An excess below this part of the friction is neglected: it would open a window of time so short
/// that the motion in it, about the square of the excess, is below the rounding of the angle.
const EDGE: f64 = 1e-10;
/// Samples of the excess in a period.
const SAMPLES: usize = 96;
/// Halvings of a bracket: its width falls below the last place of the time.
const HALVINGS: usize = 60;
/// Steps of the golden section.
const SECTIONS: usize = 45;

/// The load of a pendulum at rest.
pub trait Load {
    /// The load at rest, and the friction that it must exceed to move the pendulum.
    fn load_and_hold(&self, tau: f64, theta: f64) -> [f64; 2];
    /// The excess of the load at rest over the friction that holds the pendulum against moving in the sense
    /// `sense`; it stays at rest while this is not positive for either sense.
    fn excess_toward(&self, tau: f64, theta: f64, sense: f64) -> f64 {
        let [load, hold] = self.load_and_hold(tau, theta);
        sense * load - hold
    }
    /// The equation, for the closed form.
    fn equation(&self) -> &Equation<f64>;
    /// Whether gravity under the harmonic drive and what does not change load the pendulum at rest,
    /// against a friction that does not change.
    fn has_closed_release(&self) -> bool;
    /// The time after which the load repeats; `None` if it does not.
    fn period(&self) -> Option<f64>;
    /// The time scale on which it changes.
    fn time_scale(&self) -> f64;
}

impl Load for Equation<f64> {
    fn load_and_hold(&self, tau: f64, theta: f64) -> [f64; 2] {
        let forcing = self.forcing(tau);
        let at = self.point(&forcing, theta, 0.0, 1.0);
        // A friction that its law makes negative holds nothing.
        [self.load(&forcing, &at), self.friction(&at).max(0.0)]
    }
    fn equation(&self) -> &Equation<f64> {
        self
    }
    fn has_closed_release(&self) -> bool {
        Self::has_closed_release(self)
    }
    fn period(&self) -> Option<f64> {
        (!self.ages).then(|| self.time_scale())
    }
    fn time_scale(&self) -> f64 {
        self.drive_period()
    }
}

impl Equation<f64> {
    /// The drive without sideways motion, by its vertical factor.
    fn at_rest(&self, vertical: f64) -> Forcing<f64> {
        self.pushed(vertical, 0.0, 0.0)
    }

    /// Whether the pendulum at rest at `theta` is held for ever.
    #[must_use]
    pub fn holds_for_ever(&self, theta: f64) -> bool {
        self.excess(theta) <= EDGE * self.hold(theta)
    }

    /// The sense, 1 or -1, in which a pendulum at rest at `theta` at time `tau` moves at once; none where it
    /// is held, and where no load acts.
    #[must_use]
    pub fn moves_at_once(&self, tau: f64, theta: f64) -> Option<f64> {
        sets_out(self, tau, theta).0
    }

    /// The friction that a load must exceed to move the pendulum from `theta`, at `tau = 0`.
    #[must_use]
    pub fn hold(&self, theta: f64) -> f64 {
        let forcing = self.forcing(0.0);
        self.friction(&self.point(&forcing, theta, 0.0, 1.0)).max(0.0)
    }

    /// The greatest excess of the load at rest at `theta` over the friction, over the drive's
    /// period; negative where it never does.
    #[must_use]
    pub fn excess(&self, theta: f64) -> f64 {
        let [forth, back] = self.greatest_excesses(theta);
        forth.max(back)
    }

    /// The greatest excess of the load at rest at `theta` over the friction, in the sense 1 and in the sense -1.
    #[must_use]
    pub fn greatest_excesses(&self, theta: f64) -> [f64; 2] {
        if self.has_closed_release() {
            // The load is linear in the cosine.
            let [a, b] = [1.0, -1.0].map(|c| {
                let forcing = self.at_rest(1.0 + self.motion.p * c);
                self.load(&forcing, &self.point(&forcing, theta, 0.0, 1.0))
            });
            let hold = self.hold(theta);
            return [a.max(b) - hold, -a.min(b) - hold];
        }
        let interval = self.time_scale() / SAMPLES as f64;
        let all: Vec<[f64; 2]> =
            (0..SAMPLES).map(|k| excesses(self, interval * k as f64, theta)).collect();
        [0, 1].map(|side| {
            let greater = |a: &usize, b: &usize| all[*a][side].total_cmp(&all[*b][side]);
            let best = (0..SAMPLES).max_by(greater).unwrap_or(0);
            let [before, after] = [-1.0, 1.0].map(|by| interval * (best as f64 + by));
            let value = |tau: f64| excesses(self, tau, theta)[side];
            highest(value, before, after).1.max(all[best][side])
        })
    }
}

/// When a pendulum at rest moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Release {
    /// At once, in this sense.
    Now(f64),
    /// At that time, in that sense.
    At(f64, f64),
    /// Not before the requested time.
    Later,
    /// Never.
    Never,
}

/// The time at which a pendulum at rest at `theta` at time `tau` moves; sought up to `until` if the
/// equation is not periodic.
pub fn release<L: Load>(load: &L, tau: f64, theta: f64, until: f64) -> Release {
    let (moves, edge) = sets_out(load, tau, theta);
    if let Some(sense) = moves {
        return Release::Now(sense);
    }
    if load.has_closed_release() {
        return closed(load, tau, theta, edge);
    }
    let end = load.period().map_or(until, |period| tau + 1.1 * period);
    match sampled(load, tau, theta, end, edge) {
        Some((time, sense)) => Release::At(time, sense),
        None if load.period().is_some() => Release::Never,
        None => Release::Later,
    }
}

/// The sense in which a pendulum at rest moves at once, none if it is held; and the excess that is neglected.
fn sets_out<L: Load>(load: &L, tau: f64, theta: f64) -> (Option<f64>, f64) {
    let [forth, back] = excesses(load, tau, theta);
    // The load cancels in their sum.
    let edge = EDGE * (-0.5 * (forth + back)).max(0.0);
    let sense = if forth >= back { 1.0 } else { -1.0 };
    ((forth.max(back) > edge).then_some(sense), edge)
}

/// The excess in the sense 1 and in the sense -1.
fn excesses<L: Load>(load: &L, tau: f64, theta: f64) -> [f64; 2] {
    let [load, hold] = load.load_and_hold(tau, theta);
    [load - hold, -load - hold]
}

/// The greater excess of both senses, and its sense.
fn greatest<L: Load>(load: &L, tau: f64, theta: f64) -> (f64, f64) {
    let [forth, back] = excesses(load, tau, theta);
    if forth >= back { (forth, 1.0) } else { (back, -1.0) }
}

/// The closed form: the excess in the sense `s` is `swing cos(angle) - limit`, where `swing >= 0`.
fn closed<L: Load>(load: &L, tau: f64, theta: f64, edge: f64) -> Release {
    let equation = load.equation();
    let motion = &equation.motion;
    let still = equation.at_rest(1.0);
    let at = equation.point(&still, theta, 0.0, 1.0);
    let (constant, swing) = (equation.load(&still, &at), -at.sine * equation.gravity() * motion.p);
    let mut first = None::<(f64, f64)>;
    for sense in [1.0, -1.0] {
        let limit = equation.friction(&at).max(0.0) - sense * constant;
        let size = swing.abs();
        if size - limit <= edge {
            continue;
        }
        // It is positive within `half` on either side of the phase 0.
        let half = (limit / size).clamp(-1.0, 1.0).acos();
        let turn = if sense * swing < 0.0 { PI } else { 0.0 };
        let mut wait = (-half - (motion.omega * tau + motion.phase + turn)).rem_euclid(TAU);
        if wait > TAU - half {
            // At the entry, up to rounding, or within the edge behind it.
            wait = 0.0;
        }
        let time = tau + wait / motion.omega;
        if first.is_none_or(|(earlier, _)| time < earlier) {
            first = Some((time, sense));
        }
    }
    first.map_or(Release::Never, |(time, sense)| Release::At(time, sense))
}

/// The first time up to `end` at which the excess becomes positive, and the sense.
fn sampled<L: Load>(load: &L, tau: f64, theta: f64, end: f64, edge: f64) -> Option<(f64, f64)> {
    let interval = load.time_scale() / SAMPLES as f64;
    let count = ((end - tau) / interval).ceil().max(1.0) as usize;
    let time = |k: usize| tau + (k as f64 * interval).min(end - tau);
    // The last two samples.
    let mut before = [f64::NEG_INFINITY, greatest(load, tau, theta).0];
    for k in 1..=count {
        let now = greatest(load, time(k), theta).0;
        let mut positive = (now > edge).then(|| time(k));
        if before[1] > before[0] && before[1] >= now {
            // A maximum lies about the sample before: it may be positive on its own.
            let value = |tau: f64| greatest(load, tau, theta).0;
            let (peak, height) = highest(value, time(k.saturating_sub(2)), time(k));
            if height > edge {
                positive = Some(peak);
            }
        }
        if let Some(inside) = positive {
            let sense = greatest(load, inside, theta).1;
            return Some((entry(load, theta, time(k.saturating_sub(2)), inside, sense), sense));
        }
        before = [before[1], now];
    }
    None
}

/// The time between two at which an excess is greatest, and its value there, by the golden section.
fn highest(value: impl Fn(f64) -> f64, from: f64, to: f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (from, to);
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = inner.map(&value);
    for _ in 0..SECTIONS {
        if values[0] > values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [value(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], value(inner[1])];
        }
    }
    if values[0] > values[1] { (inner[0], values[0]) } else { (inner[1], values[1]) }
}

/// Where the excess in the sense `sense` becomes positive, between a time at which it is not and one
/// at which it is.
fn entry<L: Load>(load: &L, theta: f64, from: f64, to: f64, sense: f64) -> f64 {
    let (mut low, mut high) = (from, to);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if load.excess_toward(middle, theta, sense) > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}
