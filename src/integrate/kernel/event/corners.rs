//! Corners of the formula on a piece of the motion: the first zero of a switching function, from
//! which another analytic equation holds.

use super::cubic::Cubic;
use super::{EventSearch, LEAST_GUESS, MOST_NEWTON, Progress, Reached, Stage, closeness};
use crate::integrate::kernel::block::Scratch;
use crate::integrate::kernel::corner::REACH;

/// Number of integrations after which corners are no longer located: many close ones are
/// negligible, since the equation is continuous.
const MOST_CORNERED: u32 = 100;
/// Number of integrations that a minimum of the switching function may take.
const MOST_HOLLOWS: u32 = 6;

/// The switching function of a corner over an integration; all 0 if there is none.
#[derive(Clone, Copy, Debug)]
pub struct Switching {
    /// The side held.
    pub(super) side: f64,
    /// Value and rate at the begin.
    begin: [f64; 2],
    /// Value and rate at the end.
    end: [f64; 2],
}

impl Switching {
    /// The function of a lane of a bundle.
    pub(in crate::integrate) fn of(scratch: &Scratch, lane: usize) -> Self {
        let [side, a, b, c, d] = [6, 7, 8, 9, 10].map(|row: usize| scratch[row][lane]);
        Self { side, begin: [a, b], end: [c, d] }
    }
}

impl EventSearch {
    /// Values and rates of the switching function at both ends, on the side of the piece.
    fn switching(&self, reached: &Reached) -> [f64; 4] {
        let Switching { side, begin, end } = reached.switching;
        let [s0, r0] = begin.map(|x| side * x);
        let [s1, r1] = end.map(|x| side * x);
        if self.crossed { [0.0, s1, r0.max(0.0), r1] } else { [s0, s1, r0, r1] }
    }

    /// Requests an integration if the switching function passes zero in the first `h` of the piece,
    /// or may do so.
    pub(super) fn look_for_corner(
        &mut self,
        reached: &Reached,
        h: f64,
        stop: Option<[f64; 2]>,
    ) -> Option<Progress> {
        if reached.switching.side == 0.0 || self.rounds > MOST_CORNERED {
            return None;
        }
        let ends = self.switching(reached);
        let [s0, s1, r0, r1] = ends;
        if s1 < 0.0 {
            self.whole = Some(*reached);
            self.seek_corner(h);
        } else if s0 + REACH * h * r0 < 0.0 || s1 - REACH * h * r1 < 0.0 {
            self.length = Cubic::new(ends, h).lowest() * h;
            self.stage = Stage::Hollow { stop, tries: 0 };
        } else {
            return None;
        }
        Some(Progress::Asks)
    }

    /// The switching function's least value is on the other side, or further on, or nothing.
    pub(super) fn hollow(
        &mut self,
        reached: &Reached,
        stop: Option<[f64; 2]>,
        tries: u32,
    ) -> Option<Progress> {
        let t = self.length;
        let [_, s, r0, r] = self.switching(reached);
        if s < 0.0 {
            self.whole = Some(*reached);
            self.seek_corner(t);
            return Some(Progress::Asks);
        }
        let bend = (r - r0) / t;
        let step = -r / bend;
        let inside = t + step > 0.0 && t + step < self.piece;
        if !(bend > 0.0 && inside && s + 0.5 * r * step < 0.0) || tries >= MOST_HOLLOWS {
            return None;
        }
        self.length = t + step;
        self.stage = Stage::Hollow { stop, tries: tries + 1 };
        Some(Progress::Asks)
    }

    /// Requests the state at the first zero of the switching function over a piece of length `h`.
    fn seek_corner(&mut self, h: f64) {
        self.piece = h;
        self.close = closeness(h);
        let guess = self.whole.map_or(0.5, |w| Cubic::new(self.switching(&w), h).zero());
        self.length = guess.clamp(LEAST_GUESS, 1.0) * h;
        self.stage = Stage::Corner { low: 0.0, high: h, tries: 0 };
    }

    pub(super) fn cornered(
        &mut self,
        reached: &Reached,
        [mut low, mut high]: [f64; 2],
        tries: u32,
    ) -> Progress {
        let t = self.length;
        let [_, s, _, r] = self.switching(reached);
        if s >= 0.0 {
            low = t;
        } else {
            high = t;
        }
        // After a corner the beginning is itself a zero, which is divided out.
        let slope = if self.crossed { r - s / t } else { r };
        let step = if s == 0.0 { 0.0 } else { -s / slope };
        if step.abs() <= self.close || high <= self.close {
            let begin = self.begin + t;
            if begin >= self.end {
                return Progress::Arrived { theta: reached.theta, velocity: reached.velocity };
            }
            let state = [reached.theta, reached.velocity];
            let next = Self::new(self.lane, state, self.sense, begin, self.end);
            *self = Self { rounds: self.rounds, side: -self.side, crossed: true, ..next };
            return Progress::Asks;
        }
        let mut next = t + step;
        if !(next > low && next < high) || tries >= MOST_NEWTON {
            next = 0.5 * (low + high);
        }
        self.length = next;
        self.stage = Stage::Corner { low, high, tries: (tries + 1) % (2 * MOST_NEWTON) };
        Progress::Asks
    }
}
