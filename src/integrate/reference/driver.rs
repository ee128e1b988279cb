//! One trajectory: steps of the right length, turns, sticks and releases.
//!
//! Between events the sense of the motion is fixed, so the equation is analytic. At a velocity 0
//! the pendulum continues in the sense in which the load exceeds the friction, or sticks until it
//! does. Derivatives are corrected: at a turn the velocity's are multiplied by the ratio of the
//! accelerations after and before it, at a stick they vanish, at a release nothing jumps
//! (saltation; di Bernardo, Budd, Champneys & Kowalczyk (2008), Piecewise-smooth Dynamical Systems,
//! section 2.5).

use super::corner;
use super::dense::DenseStep;
use super::event::{Event, EventKind};
use super::problem::{OdeProblem, Past};
use super::rig_mode::{self, Ring};
use super::turning::{self, Turning};
use crate::integrate::tangent::Number;
use crate::model::rest::Release;

/// Smallest and largest ratio of successive step lengths.
const CHANGE: [f64; 2] = [1.0 / 3.0, 6.0];
/// The part of the step that the error would allow.
const SAFETY: f64 = 0.9;
/// The first step over the longest one.
const FIRST_STEP: f64 = 0.5;
/// Steps below this part of the time are lost in its rounding.
const SHORTEST: f64 = 1e-15;
/// Below this part of the longest step an interpolant is accurate to rounding.
const FINE: f64 = 1e-4;
/// Distance and number of successive turns that indicate a state at the limit of the stick.
const CROWDED: (f64, u32) = (1e-10, 20);
/// The duration of the rest imposed on such a state; it doubles each time.
const PAUSE: f64 = 1e-9;

/// A piece of a trajectory.
#[derive(Clone, Copy, Debug)]
pub enum Piece {
    /// Moving, in one step: `Driver::dense`.
    Step,
    /// At rest between two times.
    Rest(f64, f64),
}

#[derive(Clone, Copy, Debug)]
enum Mode<N> {
    /// Moving: sense of motion and side of a corner, with the present acceleration.
    Moving([f64; 2], N),
    /// At rest until this release.
    Stuck(Release),
    /// Beyond the range of numbers.
    Lost,
}

/// The integration of one trajectory.
#[derive(Debug)]
pub struct Driver<'a, N> {
    ode: &'a OdeProblem<N>,
    /// The time reached.
    pub tau: f64,
    /// Angle, not wrapped, and velocity.
    pub state: [N; 2],
    /// Memories of effects and the mode of the rig.
    pub past: Past<N>,
    /// Turns, sticks and releases so far.
    pub events: Vec<Event>,
    /// The product of the ratios of accelerations at the turns, 0 after a stick.
    pub ratio: f64,
    /// Steps so far.
    pub steps: usize,
    /// The last step.
    pub dense: DenseStep<N>,
    until: f64,
    mode: Mode<N>,
    /// Whether the last piece ended at a corner.
    since_corner: bool,
    step: f64,
    crowd: (f64, u32),
    pause: f64,
}

impl<'a, N: Number> Driver<'a, N> {
    /// The integration from `state` at time `tau` until `until`.
    #[must_use]
    pub fn new(ode: &'a OdeProblem<N>, tau: f64, state: [N; 2], until: f64) -> Self {
        let step = FIRST_STEP * ode.longest_step();
        let crowd = (f64::NEG_INFINITY, 0);
        let (mode, events) = (Mode::Lost, Vec::new());
        let mut driver = Self {
            ode,
            tau,
            state,
            past: ode.begin(tau, state),
            events,
            ratio: 1.0,
            steps: 0,
            dense: DenseStep::none(state),
            until,
            mode,
            since_corner: false,
            step,
            crowd,
            pause: PAUSE,
        };
        let velocity = state[1].value();
        if velocity != 0.0 {
            driver.set_out(1_f64.copysign(velocity));
        } else if ode.jumps() {
            match rig_mode::let_go(ode, tau, state[0].value(), driver.past, until) {
                Release::Now(sense) => driver.set_out(sense),
                wait => driver.settle(wait),
            }
        } else {
            let pull = ode.acceleration(tau, state, driver.signs(1.0), driver.past);
            driver.set_out(1_f64.copysign(pull.value()));
        }
        driver
    }

    /// Whether it is at rest under friction.
    #[must_use]
    pub fn is_stuck(&self) -> bool {
        matches!(self.mode, Mode::Stuck(_))
    }

    /// The sense of the motion and the side of a corner; none where it does not move.
    #[must_use]
    pub fn signs_held(&self) -> Option<[f64; 2]> {
        match self.mode {
            Mode::Moving(signs, _) => Some(signs),
            Mode::Stuck(_) | Mode::Lost => None,
        }
    }

    /// Whether it remains at rest for ever.
    #[must_use]
    pub fn is_stuck_for_ever(&self) -> bool {
        matches!(self.mode, Mode::Stuck(Release::Never))
    }

    /// Advances by one piece; `None` at the end, and if the state leaves the range of numbers, see
    /// [`Driver::is_lost`].
    pub fn advance(&mut self) -> Option<Piece> {
        if self.tau >= self.until {
            return None;
        }
        match self.mode {
            Mode::Lost => None,
            Mode::Stuck(wait) => Some(self.rest(wait)),
            Mode::Moving(signs, first) => self.dense(signs, first),
        }
    }

    /// Advances to the end, calling `visit` for each piece.
    pub fn finish(&mut self, mut visit: impl FnMut(&mut Piece)) {
        while let Some(mut piece) = self.advance() {
            visit(&mut piece);
        }
    }

    /// Whether the state left the range of numbers.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        matches!(self.mode, Mode::Lost)
    }

    /// Multiplies the derivatives, which is allowed if they are by the start alone.
    pub fn scale_derivatives(&mut self, factor: f64) {
        let scaled = |x: N| x.reset(x.value(), factor);
        self.state = self.state.map(scaled);
        self.past = self.past.map(scaled);
        if let Mode::Moving(signs, first) = self.mode {
            self.mode = Mode::Moving(signs, scaled(first));
        }
    }

    fn rest(&mut self, wait: Release) -> Piece {
        let from = self.tau;
        let moves = match wait {
            Release::At(time, sense) if time < self.until => Some((time, sense)),
            _ => None,
        };
        self.tau = moves.map_or(self.until, |(time, _)| time);
        if let Some(ring) = Ring::at(self.ode.field(), self.state[0]) {
            let [.., x, y] = self.past;
            [self.past[3], self.past[4]] = ring.after(self.tau - from, [x, y]);
        }
        if let Some((_, sense)) = moves {
            self.note(EventKind::Release);
            self.set_out(sense);
        }
        Piece::Rest(from, self.tau)
    }

    fn dense(&mut self, signs: [f64; 2], first: N) -> Option<Piece> {
        let (ode, shortest) = (self.ode, SHORTEST * self.tau.abs().max(1.0));
        let mut growth = CHANGE[1];
        loop {
            let rest = self.until - self.tau;
            // No tiny remainder is left for the next step.
            let length = if self.step > 0.99 * rest { rest } else { self.step };
            if length < shortest && length < rest {
                self.lose();
                return None;
            }
            self.dense.past = self.past;
            self.dense.take(ode.field(), self.tau, self.state, first, signs, length);
            self.steps += 1;
            let error = self.dense.error(ode.tolerance());
            if error.is_nan() {
                (self.step, growth) = (CHANGE[0] * length, 1.0);
                continue;
            }
            let factor = (SAFETY * error.powf(-0.125)).clamp(CHANGE[0], growth);
            let next = (factor * length).min(ode.longest_step());
            if error > 1.0 {
                (self.step, growth) = (next.min(0.99 * length), 1.0);
                continue;
            }
            let turning =
                if ode.finds_turns() { turning::first(ode, &self.dense) } else { Turning::None };
            if matches!(turning, Turning::Unclear) && length > FINE * ode.longest_step() {
                (self.step, growth) = (0.5 * length, 1.0);
                continue;
            }
            // The length of a step cut short by the end does not limit the next one.
            self.step = if length < self.step { self.step.max(next) } else { next };
            let turns = if let Turning::At(length) = turning {
                self.dense.shorten(ode.field(), length);
                true
            } else {
                false
            };
            let corner = if ode.has_corner() {
                corner::first(ode, &self.dense, self.since_corner)
            } else {
                None
            };
            self.since_corner = false;
            if let Some(length) = corner {
                self.dense.shorten(ode.field(), length);
            }
            self.arrive();
            if corner.is_some() {
                self.cross(signs);
            } else if turns {
                self.turn(signs[0], self.dense.last().value());
            } else {
                self.mode = Mode::Moving(signs, self.dense.last());
            }
            return Some(Piece::Step);
        }
    }

    fn lose(&mut self) {
        self.mode = Mode::Lost;
        self.state = self.state.map(|x| x.reset(f64::NAN, 1.0));
    }

    fn arrive(&mut self) {
        let DenseStep { tau, length, end: state, .. } = self.dense;
        if let Some(sway) = &self.dense.sway {
            [self.past[3], self.past[4]] = sway.end;
        }
        let end = tau + length;
        self.tau = if (end - self.until).abs() < SHORTEST * end.abs() { self.until } else { end };
        self.state = state;
    }

    /// Continues from a velocity 0, reached in the sense `sense` with the acceleration `before`.
    fn turn(&mut self, sense: f64, before: f64) {
        self.past = self.ode.turned(self.state[0], sense, self.past);
        let theta = self.state[0].value();
        let goes_on = if self.ode.jumps() {
            let wait = rig_mode::let_go(self.ode, self.tau, theta, self.past, self.until);
            self.uncrowded(wait)
        } else {
            Release::Now(-sense)
        };
        let Release::Now(next) = goes_on else {
            self.settle(goes_on);
            return;
        };
        self.state[1] = self.state[1].reset(0.0, 1.0);
        if next * sense > 0.0 {
            // Within rounding of touching zero.
            self.set_out(next);
            return;
        }
        self.note(EventKind::Turn);
        let signs = self.signs(next);
        let after = self.ode.acceleration(self.tau, self.state, signs, self.past).value();
        let ratio = if self.ode.jumps() { after / before } else { 1.0 };
        self.ratio *= ratio;
        self.state[1] = self.state[1].reset(0.0, ratio);
        self.set_out(next);
    }

    /// `wait`, or a pause if turns accumulate.
    fn uncrowded(&mut self, wait: Release) -> Release {
        let (last, count) = self.crowd;
        let close = self.tau - last < CROWDED.0;
        self.crowd = (self.tau, if close { count + 1 } else { 0 });
        match wait {
            Release::Now(sense) | Release::At(_, sense) if self.crowd.1 > CROWDED.1 => {
                self.pause *= 2.0;
                Release::At(self.tau + self.pause, sense)
            }
            other => other,
        }
    }

    fn set_out(&mut self, sense: f64) {
        self.since_corner = false;
        self.go_on(self.signs(sense));
    }

    /// Continues on the other side of a corner, where only derivatives of the acceleration jump.
    fn cross(&mut self, [sense, side]: [f64; 2]) {
        self.since_corner = true;
        self.go_on([sense, -side]);
    }

    fn go_on(&mut self, signs: [f64; 2]) {
        let first = self.ode.acceleration(self.tau, self.state, signs, self.past);
        self.mode = Mode::Moving(signs, first);
    }

    /// The sense, and the side of a corner here.
    fn signs(&self, sense: f64) -> [f64; 2] {
        if !self.ode.has_corner() {
            return [sense, 1.0];
        }
        [sense, 1_f64.copysign(self.ode.switch(self.tau, self.state.map(N::value)))]
    }

    fn settle(&mut self, wait: Release) {
        self.state[1] = self.state[1].reset(0.0, 0.0);
        self.ratio = 0.0;
        self.mode = Mode::Stuck(wait);
        self.note(EventKind::Stick);
        if wait == Release::Never {
            self.note(EventKind::StuckForEver);
        }
    }

    fn note(&mut self, kind: EventKind) {
        self.events.push(Event { tau: self.tau, kind, theta: self.state[0].value() });
    }
}
