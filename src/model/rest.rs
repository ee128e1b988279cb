//! The pendulum at rest under friction: what holds it, and when it is let go.
//!
//! Stuck now: `|load| <= friction` at `th' = 0`. Under the plain drive the load is
//! `torque - (1 + p cos(omega tau + phase)) sin th`, and the release comes from the arc cosine;
//! otherwise the load is followed over one period.

use std::f64::consts::TAU;

use super::equation::Equation;

/// Samples of one period where there is no closed form.
const SAMPLES: usize = 256;
const BISECTIONS: usize = 64;

/// What becomes of a pendulum whose velocity is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Standstill {
    /// The load exceeds the friction: it moves on, in the sense 1 or -1.
    Moves(f64),
    /// It is held, until it moves in the sense 1 or -1.
    Held {
        /// Time of the release; infinite if it does not come within one period of the drive.
        until: f64,
        /// Sense of the motion after it.
        sense: f64,
    },
}

impl Equation<f64> {
    /// The load at rest, and the friction that it must exceed.
    #[must_use]
    pub fn load_at_rest(&self, tau: f64, theta: f64) -> (f64, f64) {
        let forcing = self.forcing(tau);
        let at = self.point(&forcing, theta, 0.0, 1.0);
        (self.load(&forcing, &at), self.friction(&at).max(0.0))
    }

    /// What becomes of the pendulum at rest at `theta` at time `tau`.
    #[must_use]
    pub fn standstill(&self, tau: f64, theta: f64) -> Standstill {
        let (load, limit) = self.load_at_rest(tau, theta);
        if load.abs() > limit {
            return Standstill::Moves(1_f64.copysign(load));
        }
        let (until, sense) = self.release(tau, theta).unwrap_or((f64::INFINITY, 1.0));
        Standstill::Held { until, sense }
    }

    /// Whether the pendulum at rest at `theta` is never let go.
    #[must_use]
    pub fn holds_for_ever(&self, theta: f64) -> bool {
        self.excess(theta) <= 0.0
    }

    /// By how much the load at rest at `theta` exceeds the friction at its greatest, over the drive's
    /// period; negative where it never does.
    #[must_use]
    pub fn excess(&self, theta: f64) -> f64 {
        let (load, limit) = self.load_at_rest(0.0, theta);
        if self.has_closed_release() {
            // The load is linear in the cosine.
            let sine = theta.sin();
            let at = |c: f64| (self.torque - (1.0 + self.motion.p * c) * sine).abs();
            return at(1.0).max(at(-1.0)) - limit;
        }
        let period = TAU / self.motion.omega;
        let over = |k: usize| {
            let (load, limit) = self.load_at_rest(period * k as f64 / SAMPLES as f64, theta);
            load.abs() - limit
        };
        (0..SAMPLES).map(over).fold(load.abs() - limit, f64::max)
    }

    /// The first time after `tau`, and within one period, at which the load begins to exceed the
    /// friction, and its sense.
    #[must_use]
    pub fn release(&self, tau: f64, theta: f64) -> Option<(f64, f64)> {
        if self.has_closed_release() {
            self.closed_release(tau, theta)
        } else {
            self.searched_release(tau, theta)
        }
    }

    /// `torque - (1 + p cos) sin th = +-limit`, where the load grows in magnitude.
    fn closed_release(&self, tau: f64, theta: f64) -> Option<(f64, f64)> {
        let (_, limit) = self.load_at_rest(tau, theta);
        let (sine, motion) = (theta.sin(), &self.motion);
        let pull = motion.p * sine;
        if pull == 0.0 {
            return None;
        }
        let candidate = |sense: f64| {
            let cosine = ((self.torque - sense * limit) / sine - 1.0) / motion.p;
            if cosine.abs() >= 1.0 || cosine.is_nan() {
                return None;
            }
            let angle = cosine.acos().copysign(sense * pull);
            let first = (angle - motion.phase) / motion.omega;
            let period = TAU / motion.omega;
            let later = first + period * ((tau - first) / period).ceil();
            Some((if later < tau { later + period } else { later }, sense))
        };
        [candidate(1.0), candidate(-1.0)].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn searched_release(&self, tau: f64, theta: f64) -> Option<(f64, f64)> {
        if self.is_autonomous() && !self.ages {
            return None;
        }
        let step = TAU / self.motion.omega / SAMPLES as f64;
        let over = |at: f64| {
            let (load, limit) = self.load_at_rest(at, theta);
            load.abs() - limit
        };
        let mut last = [over(tau - step), over(tau)];
        for k in 1..=SAMPLES {
            let at = tau + step * k as f64;
            let now = over(at);
            // A greatest value between the samples may pass the limit for a moment.
            let peak = last[1] > last[0] && last[1] >= now && last[1] <= 0.0;
            let bend = 2.0 * last[1] - last[0] - now;
            let top = at - step + 0.5 * step * (now - last[0]) / bend.max(f64::MIN_POSITIVE);
            let end = if peak && top > tau && over(top) > 0.0 { top } else { at };
            if over(end) > 0.0 {
                let (mut low, mut high) = ((end - step).max(tau), end);
                for _ in 0..BISECTIONS {
                    let middle = 0.5 * (low + high);
                    if over(middle) > 0.0 { high = middle } else { low = middle }
                }
                return Some((high, 1_f64.copysign(self.load_at_rest(high, theta).0)));
            }
            last = [last[1], now];
        }
        None
    }
}
