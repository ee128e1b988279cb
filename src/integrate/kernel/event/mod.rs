//! Turns, sticks and releases of one trajectory within one step of the block that it belongs to.
//!
//! An [`EventSearch`] requests integrations from the last state of its trajectory on an analytic
//! piece of the motion, each over its own length; [`super::block`] runs those of many searches in
//! lanes. From their ends it finds the first zero of the velocity, to rounding, and its
//! continuation; and the first zero of the switching function of a corner, at which only the
//! formula changes. The velocity's zero is found first, then any corner before it.

use crate::model::Equation;
use crate::model::rest::{Release, release};

mod corners;
mod cubic;

pub use corners::Switching;
use cubic::Cubic;

/// Number of integrations after which a search fails, and its trajectory with it.
const MOST_ROUNDS: u32 = 400;
/// A zero is found when Newton's step falls below this part of the piece, at a step of a quarter;
/// it falls with the fourth power of the step, so that its square stays below the error of the
/// step. The change of the acceleration is taken into account, which leaves little more than the
/// third power.
const CLOSE: f64 = 1e-3;
/// The bounds of that part.
const CLOSEST: [f64; 2] = [1e-7, 1e-3];
/// Steps of Newton's method that a root may take before the bracket is halved.
const MOST_NEWTON: u32 = 8;
/// Where the velocity's least value, as its cubic gives it, is below this part of its change over the
/// piece, the integration decides.
const GRAZING: f64 = 0.1;
/// Least first guess, as a part of the piece.
const LEAST_GUESS: f64 = 1e-6;
/// Least time from a release to the next one, as a part of the period: at the limit of the stick a
/// slip may be shorter than rounding can resolve.
const LEAST_SLIP: f64 = 1e-7;

/// The state that a search has requested.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// The end of the piece.
    Whole,
    /// The velocity's least value, which may lie on the other side of zero.
    Dip,
    /// A zero of the velocity between the two times.
    Root { low: f64, high: f64, tries: u32 },
    /// The switching function's least value; where it is positive the piece ends where `stop` says,
    /// with angle and time of a velocity zero, or as a whole.
    Hollow { stop: Option<[f64; 2]>, tries: u32 },
    /// A zero of the switching function between the two times.
    Corner { low: f64, high: f64, tries: u32 },
}

/// The end of an integration, as the lanes return it.
#[derive(Clone, Copy, Debug)]
pub struct Reached {
    /// Angle, rad.
    pub theta: f64,
    /// Velocity.
    pub velocity: f64,
    /// Acceleration at the begin and at the end.
    pub acceleration: [f64; 2],
    /// The switching function.
    pub switching: Switching,
}

/// State of a search after an integration.
#[derive(Clone, Copy, Debug)]
pub enum Progress {
    /// The search requests another integration.
    Asks,
    /// The end of the step has been reached.
    Arrived {
        /// Angle, rad.
        theta: f64,
        /// Velocity.
        velocity: f64,
    },
    /// The pendulum has stopped and is held beyond the step's end.
    Held {
        /// Angle, rad.
        theta: f64,
        /// Time of the release.
        until: f64,
        /// Sense of the motion then.
        sense: f64,
    },
}

/// A trajectory whose velocity passes zero, or may do so, within a step.
#[derive(Clone, Copy, Debug)]
pub struct EventSearch {
    /// Its index in the block.
    pub lane: usize,
    /// Angle at the start of the piece, rad.
    pub theta: f64,
    /// Velocity at the start.
    pub velocity: f64,
    /// Sense of the motion on the piece.
    pub sense: f64,
    /// Time of the start.
    pub begin: f64,
    /// The requested length.
    pub length: f64,
    /// The side of a corner on the piece; 0 if the first integration determines it.
    pub side: f64,
    /// Whether the piece begins at a corner.
    crossed: bool,
    end: f64,
    stage: Stage,
    /// The result of the whole piece.
    whole: Option<Reached>,
    /// The length of the whole piece.
    piece: f64,
    /// The size of Newton's step that is small enough.
    close: f64,
    rounds: u32,
}

impl EventSearch {
    /// A trajectory that moves from `theta` in the sense `sense` between `begin` and `end`.
    #[must_use]
    pub fn new(lane: usize, state: [f64; 2], sense: f64, begin: f64, end: f64) -> Self {
        Self {
            lane,
            theta: state[0],
            velocity: state[1],
            sense,
            begin,
            length: end - begin,
            side: 0.0,
            crossed: false,
            end,
            stage: Stage::Whole,
            whole: None,
            piece: 0.0,
            close: 0.0,
            rounds: 0,
        }
    }

    /// Continues if the end of the piece is known already.
    #[must_use]
    pub fn known(
        lane: usize,
        state: [f64; 2],
        sense: f64,
        [begin, end]: [f64; 2],
        whole: &Reached,
    ) -> Option<Self> {
        let mut search = Self::new(lane, state, sense, begin, end);
        search.side = whole.switching.side;
        matches!(search.ended(whole), Progress::Asks).then_some(search)
    }

    /// Receives the end of the requested integration; `holds` is the equation if friction can hold
    /// the trajectory.
    #[must_use]
    pub fn take(
        &mut self,
        reached: &Reached,
        holds: Option<&Equation<f64>>,
        period: f64,
    ) -> Progress {
        self.rounds += 1;
        if self.rounds > MOST_ROUNDS || !reached.velocity.is_finite() {
            return Progress::Arrived { theta: f64::NAN, velocity: f64::NAN };
        }
        self.side = reached.switching.side;
        match self.stage {
            Stage::Whole => self.ended(reached),
            Stage::Dip => self.dipped(reached),
            Stage::Root { low, high, tries } => {
                self.narrowed(reached, [low, high], tries, holds, period)
            }
            Stage::Hollow { stop, tries } => match (self.hollow(reached, stop, tries), stop) {
                (Some(progress), _) => progress,
                (None, Some([theta, tau])) => self.stopped(theta, tau, holds, period),
                (None, None) => self.arrived(),
            },
            Stage::Corner { low, high, tries } => self.cornered(reached, [low, high], tries),
        }
    }

    /// Velocity and acceleration in the sense of the motion at both ends of the whole piece.
    fn ends(&self, whole: &Reached) -> [f64; 4] {
        // A piece that begins at rest begins in its sense, whatever the rounding errors.
        let [first, last] = whole.acceleration.map(|a| self.sense * a);
        let first = if self.velocity == 0.0 { first.max(0.0) } else { first };
        [self.sense * self.velocity, self.sense * whole.velocity, first, last]
    }

    fn ended(&mut self, whole: &Reached) -> Progress {
        self.whole = Some(*whole);
        let [u0, u1, b0, b1] = self.ends(whole);
        let h = self.length;
        self.piece = h;
        if u1 < 0.0 {
            self.seek(h);
            return Progress::Asks;
        }
        if u0 > 0.0 && b0 < 0.0 && b1 > 0.0 {
            let cubic = Cubic::new(self.ends(whole), h);
            let at = cubic.lowest();
            if cubic.at(at) < GRAZING * (b1 - b0) * h {
                self.stage = Stage::Dip;
                self.length = at * h;
                return Progress::Asks;
            }
        }
        self.look_for_corner(whole, h, None).unwrap_or_else(|| self.arrived())
    }

    /// The piece is valid as a whole.
    fn arrived(&self) -> Progress {
        match self.whole {
            Some(whole) => Progress::Arrived { theta: whole.theta, velocity: whole.velocity },
            None => Progress::Arrived { theta: f64::NAN, velocity: f64::NAN },
        }
    }

    /// The least velocity is on the other side of zero, or above it: then the piece continues.
    fn dipped(&mut self, reached: &Reached) -> Progress {
        let high = self.length;
        if self.sense * reached.velocity < 0.0 {
            self.whole = Some(*reached);
            self.seek(high);
            return Progress::Asks;
        }
        let cornered = match self.whole {
            Some(whole) => self.look_for_corner(&whole, self.piece, None),
            None => None,
        };
        cornered.unwrap_or_else(|| self.arrived())
    }

    /// Requests the state at the first zero of the cubic over a piece of length `h`.
    fn seek(&mut self, h: f64) {
        self.piece = h;
        self.close = closeness(h);
        let guess = self.whole.map_or(0.5, |w| Cubic::new(self.ends(&w), h).zero());
        self.length = guess.clamp(LEAST_GUESS, 1.0) * h;
        self.stage = Stage::Root { low: 0.0, high: h, tries: 0 };
    }

    fn narrowed(
        &mut self,
        reached: &Reached,
        [mut low, mut high]: [f64; 2],
        tries: u32,
        holds: Option<&Equation<f64>>,
        period: f64,
    ) -> Progress {
        let t = self.length;
        let (u, b) = (self.sense * reached.velocity, self.sense * reached.acceleration[1]);
        if u >= 0.0 {
            low = t;
        } else {
            high = t;
        }
        // After a reversal the beginning is itself a zero, which is divided out.
        let slope = if self.velocity == 0.0 { b - u / t } else { b };
        let step = if u == 0.0 { 0.0 } else { -u / slope };
        // The beginning may be a zero itself: the series must not reach back to it.
        let near = step.abs() <= self.close.min(CLOSE * t);
        if near || high - low <= 1e-15 * self.end.abs().max(period) {
            let [first, last] = reached.acceleration;
            let jerk = self.jerk(t, first, last);
            let step = if near && u != 0.0 {
                let step = -reached.velocity / last;
                step - 0.5 * jerk / last * step * step
            } else {
                0.0
            };
            let gain = last + step * jerk / 3.0;
            let theta = reached.theta + step * (reached.velocity + 0.5 * step * gain);
            let tau = self.begin + t + step;
            let cornered = self.look_for_corner(reached, t, Some([theta, tau]));
            return cornered.unwrap_or_else(|| self.stopped(theta, tau, holds, period));
        }
        let mut next = t + step;
        if !(next > low && next < high) || tries >= MOST_NEWTON {
            next = 0.5 * (low + high);
        }
        self.length = next;
        self.stage = Stage::Root { low, high, tries: (tries + 1) % (2 * MOST_NEWTON) };
        Progress::Asks
    }

    /// The change of the acceleration at `t`, from those at the piece's begin, at `t` and at its end.
    fn jerk(&self, t: f64, first: f64, here: f64) -> f64 {
        let back = (here - first) / t;
        match self.whole {
            Some(whole) if self.piece - t > 0.05 * self.piece => {
                let ahead = (whole.acceleration[1] - here) / (self.piece - t);
                back + t * (ahead - back) / self.piece
            }
            _ => back,
        }
    }

    /// Determines the continuation at a zero of the velocity at `tau`.
    fn stopped(
        &mut self,
        theta: f64,
        tau: f64,
        holds: Option<&Equation<f64>>,
        period: f64,
    ) -> Progress {
        let released = self.velocity == 0.0 && tau - self.begin < LEAST_SLIP * period;
        let at = if released { tau + LEAST_SLIP * period } else { tau };
        // If nothing can hold it the motion turns.
        let next = match holds {
            Some(equation) => release(equation, at, theta, at + period),
            None => Release::Now(-self.sense),
        };
        let (begin, sense) = match next {
            Release::Now(sense) => (at, sense),
            Release::At(time, sense) => (time, sense),
            Release::Later | Release::Never => (f64::INFINITY, 1.0),
        };
        if begin >= self.end {
            if at > tau || begin > at {
                return Progress::Held { theta, until: begin, sense };
            }
            // The remaining step is below rounding: the motion continues in its sense.
            return Progress::Arrived { theta, velocity: sense * f64::MIN_POSITIVE };
        }
        let next = Self::new(self.lane, [theta, 0.0], sense, begin, self.end);
        *self = Self { rounds: self.rounds, ..next };
        Progress::Asks
    }
}

/// The Newton step at which a zero within a piece of length `h` is found.
fn closeness(h: f64) -> f64 {
    h * (CLOSE * (4.0 * h).powi(4)).clamp(CLOSEST[0], CLOSEST[1])
}
