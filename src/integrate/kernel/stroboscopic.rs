//! The stroboscopic map for many trajectories: states at `tau = 0 mod T`, one forcing period at a
//! time, every lane at the same phase.

use std::f64::consts::PI;

use super::block::Block;
use super::general::Timetable;
use super::schedule::Schedule;
use crate::integrate::States;
use crate::lanes::InstructionSet;
use crate::model::pendulum::Route;
use crate::model::{Angle, Equation, Pendulum};

/// Length of steps, in units of `1/sqrt(1 + |p|)`, above which the method's error is at least about
/// that of the coarse sine: measured from p = 0 to 30, where both grow with the stretching.
const COARSE_SINE_FROM: f64 = 0.28;

/// The stroboscopic map of one pendulum at a chosen accuracy, on a chosen instruction set.
#[allow(clippy::struct_excessive_bools)] // independent facts
#[derive(Clone, Debug)]
pub struct Strobe {
    /// The model.
    pub pendulum: Pendulum,
    /// The steps over one period.
    pub schedule: Schedule,
    /// The instruction set.
    pub simd: InstructionSet,
    /// Whether the sine of degree 15 is used.
    pub fine: bool,
    /// The route of the model through the kernel.
    pub route: Route,
    /// Whether the model changes with the sign of the velocity.
    pub events: bool,
    /// Whether friction can hold the pendulum.
    pub friction: bool,
    /// Whether a torque of angle and time acts in addition to gravity, the constant torque and
    /// Coulomb friction.
    pub extra: bool,
    /// The drive at the stages of the general method; empty on other routes.
    pub timetable: Timetable,
    /// Topology of its angle.
    pub angle: Angle,
    /// The equation, time in the laboratory held.
    pub equation: Equation<f64>,
}

impl Strobe {
    /// `steps` steps a period; their length chooses the sine's degree.
    #[must_use]
    pub fn new(pendulum: &Pendulum, steps: usize, simd: InstructionSet) -> Self {
        let schedule = Schedule::period(pendulum, steps);
        let pull = pendulum.greatest_pull().sqrt();
        let fine = pendulum.period() / steps as f64 * pull < COARSE_SINE_FROM;
        let route = pendulum.route();
        let general = if route == Route::General { steps } else { 0 };
        Self {
            pendulum: pendulum.clone(),
            schedule,
            simd,
            fine,
            route,
            events: pendulum.has_events(),
            friction: pendulum.has_friction(),
            extra: pendulum.has_extra_load(),
            timetable: Timetable::new(pendulum, general),
            angle: pendulum.angle(),
            equation: pendulum.equation(),
        }
    }

    /// This map with `factor` times as many steps.
    #[must_use]
    pub fn refined(&self, factor: usize) -> Self {
        Self::new(&self.pendulum, self.steps() * factor, self.simd)
    }

    /// Whether it needs neither events nor effects.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.route == Route::Smooth && !self.extra
    }

    /// Steps a period.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.schedule.steps().len()
    }

    /// Advances every state by `periods` forcing periods.
    ///
    /// Angles on the circle are in [-pi, pi] afterwards; the whole turns removed are added to those of
    /// the states.
    pub fn advance(&self, states: &mut States, periods: usize) {
        let width = self.block_width(states.len());
        self.advance_blocks(states, width, |block| {
            for _ in 0..periods {
                self.period(block);
                block.wrap(self.angle);
            }
        });
    }

    /// [`Strobe::advance`], one trajectory at a time with the arithmetic of a lane.
    // Compiled where it is called: in tests alone.
    #[inline]
    pub fn advance_singly(&self, states: &mut States, periods: usize) {
        self.advance_blocks(states, 1, |block| {
            for _ in 0..periods {
                self.period_singly(block);
                block.wrap(self.angle);
            }
        });
    }

    fn advance_blocks(&self, states: &mut States, width: usize, run: impl Fn(&mut Block)) {
        let kick = self.schedule.kick;
        let mut block = Block::new(width);
        let States { theta, velocity, turns } = states;
        let chunks = theta.chunks_mut(width).zip(velocity.chunks_mut(width));
        for ((theta, velocity), turns) in chunks.zip(turns.chunks_mut(width)) {
            block.fill(theta, velocity, kick);
            run(&mut block);
            for i in 0..theta.len() {
                theta[i] = block.half_turns[i] * PI;
                velocity[i] = block.kick[i] * (1.0 / kick);
                turns[i] += block.turns[i];
            }
        }
    }
}
