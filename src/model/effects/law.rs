//! Effects: their definitions, and the formulas that an effect may have.

use std::hint::black_box;

pub use super::parameter::{Parameter, Parameters, Power, Role};
use crate::lanes::Real;
use crate::lanes::sine::Fine;
use crate::model::drive::Motion;

/// Largest number of parameters of an effect.
pub const MOST_PARAMETERS: usize = 3;

/// Reason for which a map cannot have a torque that differs between turns, unless another one
/// counts turns.
pub const NOT_PERIODIC: &str = "it does not repeat every turn, and nothing bounds the angle";

/// Where an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Removes energy from the motion.
    Damping,
    /// A torque that does not.
    Torque,
    /// Changes the drive of the pivot.
    Drive,
    /// Changes the readings of the sensor only.
    Reading,
}

impl Group {
    /// The name of the action.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Damping => "damping",
            Self::Torque => "torque",
            Self::Drive => "drive",
            Self::Reading => "reading",
        }
    }
}

/// The family of an effect: effects of one family are easily mistaken for each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Damping by the velocity.
    Damping,
    /// Friction that jumps with the sign of the velocity.
    DryFriction,
    /// A torque, or an inertia, of the angle.
    PositionTorque,
    /// Motion of the pivot.
    Drive,
    /// Sensor and clock.
    Reading,
    /// A formula of the user.
    Own,
}

impl Family {
    /// The name of the family.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Damping => "damping",
            Self::DryFriction => "dry friction",
            Self::PositionTorque => "position torque",
            Self::Drive => "drive",
            Self::Reading => "reading",
            Self::Own => "own",
        }
    }
}

/// The quantities that an effect depends on; they decide which route of the kernel runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// A torque of angle and time.
    Position,
    /// A torque of the angle and of how the pivot moves.
    Driven,
    /// A torque of the angle that changes with the time in the laboratory, in addition to the
    /// drive.
    Timed,
    /// An inertia of the angle, with the torque that comes of it.
    Inertia,
    /// A smooth torque of the velocity.
    Velocity,
    /// A continuous torque of the velocity whose formula changes with its sign.
    Kinked,
    /// A force against the motion that jumps with the sign of the velocity and can hold the
    /// pendulum fast, of angle and time only.
    Friction,
    /// Dry friction that depends on the velocity too.
    SlidingFriction,
    /// Dry friction that depends on velocity and drive, so that the load it can hold changes during a period.
    LoadedFriction,
    /// Another amplitude, phase or frequency of the harmonic drive.
    Drive,
    /// An additional motion of the pivot.
    FurtherDrive,
    /// Another reading; no torque.
    Reading,
    /// Another reading, which depends on where the motion last turned; it comes before the others.
    Play,
}

/// Whether a map over initial conditions can have the effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mappable {
    /// Maps can have it.
    Yes,
    /// With time in the laboratory held at a stated value.
    Frozen,
    /// Maps cannot have it, for the reason given by [`Law::bars_maps`].
    No,
}

impl Mappable {
    /// The name of the variant.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::Frozen => "frozen",
            Self::No => "no",
        }
    }
}

/// The definition of an effect, without its formulas.
#[derive(Clone, Copy, Debug)]
pub struct Definition<'a> {
    /// Its name, the field's standard term.
    pub name: &'a str,
    /// Where it acts.
    pub group: Group,
    /// Its family.
    pub family: Family,
    /// The quantities that it depends on.
    pub action: Action,
    /// The term on the right of `th'' = ...`, per inertia, or the reading, or the drive.
    pub formula: &'a str,
    /// Its parameters, in order.
    pub parameters: Parameters<'a>,
    /// Which data show it.
    pub revealed_by: &'a str,
    /// Whether maps can have it.
    pub mappable: Mappable,
}

/// A point at which formulas are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Point<R> {
    /// Angle, rad, not wrapped.
    pub theta: R,
    /// Velocity.
    pub velocity: R,
    /// 1 or -1: the sense of the motion, held over a step even where the velocity passes zero.
    pub sense: R,
    /// 1 or -1: the sign of the effect's [`Law::switch`], held over a step even where it passes zero.
    pub side: R,
    /// `sin theta`.
    pub sine: R,
    /// Gravity times `1 + a(t)`, with the pivot's vertical acceleration over gravity `a`.
    pub vertical: R,
    /// One over gravity, which is 1 where the unit of time is `1 / w0`.
    pub per_gravity: R,
    /// Time in the laboratory.
    pub lab: R,
    /// Phase of the harmonic drive, rad; 0 if no formula uses it.
    pub phase: R,
    /// The angle at which the motion last turned or began, and the effect's [`Law::kept`] there.
    pub past: [R; 2],
    /// Displacement and momentum of the effect's [`Law::sway`].
    pub sway: [R; 2],
}

impl<R: Real> Point<R> {
    /// All zero: to determine properties of a formula that do not depend on values.
    #[must_use]
    pub fn nowhere(zero: R) -> Self {
        Self {
            theta: zero,
            velocity: zero,
            sense: zero,
            side: zero,
            sine: zero,
            vertical: zero,
            per_gravity: zero,
            lab: zero,
            phase: zero,
            past: [zero; 2],
            sway: [zero; 2],
        }
    }

    /// `cos theta`.
    #[inline(always)]
    #[must_use]
    pub fn cosine(&self) -> R {
        self.theta.scale(std::f64::consts::FRAC_1_PI).cosine::<Fine>()
    }

    /// The angle less its whole turns, in [-pi, pi].
    #[inline(always)]
    #[must_use]
    pub fn wrapped(&self) -> R {
        self.theta.scale(std::f64::consts::FRAC_1_PI).wrapped().scale(std::f64::consts::PI)
    }

    /// `|velocity|`, smooth across zero while the sense is held.
    #[inline(always)]
    #[must_use]
    pub fn speed(&self) -> R {
        self.velocity * self.sense
    }

    /// Hides the value from the compiler, which otherwise computes, ahead of a loop over effects, all
    /// cosines and logarithms that any effect of the library needs.
    #[inline(always)]
    #[must_use]
    pub fn hidden(&self) -> Self {
        // Adding -0 changes no number; values unused by a formula cost nothing.
        let nothing = self.theta.like(black_box(-0.0));
        Self { theta: self.theta + nothing, velocity: self.velocity + nothing, ..*self }
    }

    /// A constant.
    #[inline(always)]
    #[must_use]
    pub fn constant(&self, value: f64) -> R {
        self.theta.like(value)
    }
}

/// An effect's definition and formulas. Parameters come in the order of the definition; torque,
/// friction, drive and reading take them as [`Law::ready`] makes them.
///
/// The formulas are written over [`Real`], so that lanes, single numbers and numbers with
/// derivatives, by the state and by the parameters alike, run through the same lines.
pub trait Law {
    /// Name, formula, parameters and the rest.
    const DEFINITION: Definition<'static>;

    /// The parameters as the formulas below take them: expensive operations, like a reciprocal, are
    /// done once.
    #[must_use]
    fn ready<R: Real>(parameters: [R; MOST_PARAMETERS]) -> [R; MOST_PARAMETERS] {
        parameters
    }

    /// The torque per inertia, `th'' = ... + torque`.
    #[inline(always)]
    fn torque<R: Real>(_: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        at.constant(0.0)
    }

    /// The magnitude of a friction, `th'' = ... - friction sign(th')`; at rest its value at `th' = 0`
    /// is what a load must exceed to move the pendulum.
    ///
    /// It may be negative, and then drives the motion. Where the sum of all frictions is negative at
    /// rest it holds nothing: the pendulum moves in the sense of the load, however small.
    #[inline(always)]
    fn friction<R: Real>(_: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        at.constant(0.0)
    }

    /// A smooth function of state and time at whose zeros a formula of the effect has a corner; none
    /// where there is no corner. The formulas take its sign from [`Point::side`] and are analytic while
    /// that is held; they are continuous across it. One effect of a model may have a corner.
    #[inline(always)]
    #[must_use]
    fn switch<R: Real>(_: &[R; MOST_PARAMETERS], _: &Point<R>) -> Option<R> {
        None
    }

    /// The memory of the effect, 0 at the start of a motion; none if it has no memory. The formulas
    /// take its value at the last turn from [`Point::past`]. Of a torque it is [`Point::sense`]
    /// without a motion before, and no map can have it; one effect of a model may have a memory. Of
    /// [`Action::Play`] it is the reading less the angle.
    #[inline(always)]
    #[must_use]
    fn kept<R: Real>(_: &[R; MOST_PARAMETERS], _: &Point<R>) -> Option<R> {
        None
    }

    /// The rates of displacement and momentum of a mode of the rig that moves with the pendulum; none
    /// where there is no such mode. The formulas take both from [`Point::sway`]. One effect of a model
    /// may have a mode, and no map can have it.
    ///
    /// The rates are linear in displacement and momentum, that of the displacement is the momentum and
    /// terms without either, and none has `th''`: so nothing of the mode jumps where friction does.
    #[inline(always)]
    #[must_use]
    fn sway<R: Real>(_: &[R; MOST_PARAMETERS], _: &Point<R>) -> Option<[R; 2]> {
        None
    }

    /// The displacement of that mode where a motion begins: there it is at rest.
    fn aside<R: Real>(_: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        at.constant(0.0)
    }

    /// Changes the pivot's motion.
    #[inline(always)]
    fn drive<R: Real>(_: &[R; MOST_PARAMETERS], _: &mut Motion<R>) {}

    /// The inertia that it adds, over the inertia without it; of [`Action::Inertia`] only.
    #[inline(always)]
    fn inertia<R: Real>(_: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        at.constant(0.0)
    }

    /// Whether it multiplies a reading, so that it acts on a velocity or a force like on an angle.
    const SCALES: bool = false;

    /// The reading of a sensor at the angle `theta` and velocity `velocity`, at the laboratory's time
    /// `lab`.
    #[inline(always)]
    fn reading<R: Real>(_: &[R; MOST_PARAMETERS], theta: R, _: R, _: R) -> R {
        theta
    }

    /// Whether the mirrored motion, `(th, v) -> (-th, -v)` at the same phase of the drive, is a
    /// motion too.
    #[must_use]
    fn keeps_mirror(_: &[f64; MOST_PARAMETERS]) -> bool {
        true
    }

    /// Whether the torque pulls back from however many turns away, so that the angle lives on the line.
    #[must_use]
    fn counts_turns(_: &[f64; MOST_PARAMETERS]) -> bool {
        false
    }

    /// Reason for which a map over initial conditions cannot have the effect with these parameters;
    /// none if it can.
    #[must_use]
    fn bars_maps(_: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        None
    }
}
