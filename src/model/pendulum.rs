//! The pendulum: its parameters and effects.

use std::f64::consts::TAU;

use super::angle::Angle;
use super::drive::{HarmonicDrive, Motion};
use super::effects::law::NOT_PERIODIC;
use super::effects::{Action, Effect, Kind, Mappable, Role};
use super::equation::Equation;
use super::parameter::Parameter;
use crate::error::Error;

/// The parametrically excited pendulum, nondimensional, with the equation of motion [`Equation`].
#[derive(Clone, Debug, PartialEq)]
pub struct Pendulum {
    /// Viscous damping `c / (m w0)`, twice the damping ratio.
    pub gamma: f64,
    /// The motion of the pivot.
    pub drive: HarmonicDrive,
    /// Constant torque over `m l^2 w0^2`.
    pub torque: f64,
    /// Coulomb friction `Tr / w0^2`.
    pub theta_r: f64,
    /// The effects.
    pub effects: Vec<Effect>,
    /// Time in the laboratory at `tau = 0`, for effects that drift.
    pub lab_time: f64,
}

/// Symmetry under which the mirrored motion `(-th, -v)` is a motion too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// At the same phase of the drive.
    AtOnce,
    /// Half a period of the drive later, with a torque that changes its sign in that time.
    HalfPeriod,
}

/// The route of a pendulum through the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// Torques of angle and time, viscous damping: Runge-Kutta-Nystrom.
    Smooth,
    /// A friction that does not depend on the velocity: Runge-Kutta-Nystrom and events.
    Friction,
    /// Torques of the velocity: Runge-Kutta, with events if something changes with its sign.
    General,
}

impl Pendulum {
    /// Without friction and effects. Checks the ranges: all finite, gamma not negative, omega
    /// positive.
    ///
    /// # Errors
    /// [`Error::Range`] for the first value outside them.
    pub fn new(gamma: f64, p: f64, omega: f64, phase: f64, torque: f64) -> Result<Self, Error> {
        if !(gamma.is_finite() && gamma >= 0.0) {
            return Err(Error::Range { name: "gamma", value: gamma, allowed: "0 or more" });
        }
        if !torque.is_finite() {
            let allowed = "a finite number";
            return Err(Error::Range { name: "torque", value: torque, allowed });
        }
        let drive = HarmonicDrive::new(p, omega, phase)?;
        Ok(Self { gamma, drive, torque, theta_r: 0.0, effects: Vec::new(), lab_time: 0.0 })
    }

    /// This pendulum with Coulomb friction.
    ///
    /// # Errors
    /// [`Error::Range`] if it is negative or not finite.
    pub fn with_friction(mut self, theta_r: f64) -> Result<Self, Error> {
        if !(theta_r.is_finite() && theta_r >= 0.0) {
            return Err(Error::Range { name: "theta_r", value: theta_r, allowed: "0 or more" });
        }
        self.theta_r = theta_r;
        Ok(self)
    }

    /// This pendulum with one more effect.
    ///
    /// Viscous damping, Coulomb friction and a bias torque become `gamma`, `theta_r` and `torque`:
    /// they are the same effects under the paper's names.
    ///
    /// # Errors
    /// [`Error::Twice`] if it is there already.
    pub fn with_effect(mut self, effect: Effect) -> Result<Self, Error> {
        let name = effect.kind.definition().name.to_owned();
        let same = match effect.kind {
            Kind::ViscousDamping => Some(Parameter::Gamma),
            Kind::CoulombFriction => Some(Parameter::ThetaR),
            Kind::BiasTorque => Some(Parameter::Torque),
            _ => None,
        };
        if let Some(parameter) = same {
            if self.value(parameter) != 0.0 {
                return Err(Error::Twice { name, other: self.name_of(parameter) });
            }
            self.set(parameter, effect.parameters[0]);
            return Ok(self);
        }
        let several = effect.kind == Kind::BearingHarmonic;
        if !several && self.effects.iter().any(|e| e.kind.definition().name == name) {
            return Err(Error::Twice { other: name.clone(), name });
        }
        self.effects.push(effect);
        if self.effects.iter().filter(|e| e.has_corner()).count() > 1 {
            // Steps end at the corner of one effect; those of formulas are ignored.
            for other in &mut self.effects {
                other.kind = other.kind.loosened();
            }
        }
        Ok(self)
    }

    /// The equation of motion with plain numbers.
    #[must_use]
    pub fn equation(&self) -> Equation<f64> {
        Equation::lift(self, |_, value| value)
    }

    /// The acceleration `th''` at time `tau`, with the sense of `velocity` unchanged for a long
    /// time.
    #[must_use]
    pub fn acceleration(&self, tau: f64, theta: f64, velocity: f64) -> f64 {
        self.equation().acceleration_at(tau, theta, velocity)
    }

    /// The pivot's motion with all that effects add to it.
    #[must_use]
    pub fn motion(&self) -> Motion<f64> {
        self.equation().motion
    }

    /// An upper bound on the factor of gravity under the drive.
    #[must_use]
    pub fn greatest_pull(&self) -> f64 {
        let motion = self.motion();
        let (mut own, mut further) = (1.0, 1.0);
        for effect in self.effects.iter().filter(|e| e.is(&[Action::Driven])) {
            // A drift acts on gravity and on the drive alike.
            let drifts = effect.kind.definition().mappable == Mappable::Frozen;
            let share = effect.parameters[0].abs() * if drifts { self.lab_time.abs() } else { 1.0 };
            further += share;
            own += if drifts { share } else { 0.0 };
        }
        own + motion.p.abs() * (further * (1.0 + motion.second.abs()) + motion.lateral.abs())
    }

    /// The unit of "periods": `2 pi / omega`, or `2 pi` without drive.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.equation().drive_period()
    }

    /// Whether the equation does not depend on time.
    #[must_use]
    pub fn is_autonomous(&self) -> bool {
        self.equation().is_autonomous()
    }

    /// Whether `(th, th') -> (-th, -th')` maps motions to motions.
    #[must_use]
    pub fn is_mirror_symmetric(&self) -> bool {
        self.torque == 0.0 && self.effects.iter().all(Effect::is_mirror_symmetric)
    }

    /// The symmetry that maps motions to mirrored motions, if it has one.
    #[must_use]
    pub fn symmetry(&self) -> Option<Symmetry> {
        let later = |e: &Effect| e.is_mirror_symmetric_later();
        if self.is_mirror_symmetric() {
            return Some(Symmetry::AtOnce);
        }
        // A moving pivot differs from its motion half a period before.
        let symmetric = self.torque == 0.0 && self.motion().p == 0.0;
        (symmetric && self.effects.iter().all(later)).then_some(Symmetry::HalfPeriod)
    }

    /// Whether attractors can exist: without damping phase area is kept, and there are none.
    #[must_use]
    pub fn is_dissipative(&self) -> bool {
        self.gamma > 0.0
            || self.theta_r > 0.0
            || self.effects.iter().any(|e| e.is(&[Action::Velocity, Action::Kinked]) || e.rubs())
    }

    /// The rate of loss of speed, at speed 1: `gamma + theta_r` and contributions of effects.
    #[must_use]
    pub fn damping_rate(&self) -> f64 {
        0.5 * (self.acceleration(0.0, 0.0, -1.0) - self.acceleration(0.0, 0.0, 1.0))
    }

    /// Its route through the kernel.
    #[must_use]
    pub fn route(&self) -> Route {
        let has = |actions: &[Action]| self.effects.iter().any(|e| e.is(actions));
        let sliding = [Action::SlidingFriction, Action::LoadedFriction];
        if has(&[Action::Velocity, Action::Kinked, Action::Inertia])
            || has(&sliding)
            || self.has_corner()
        {
            Route::General
        } else if self.has_friction() {
            Route::Friction
        } else {
            Route::Smooth
        }
    }

    /// Whether a friction can hold it.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.theta_r > 0.0 || self.effects.iter().any(Effect::rubs)
    }

    /// Whether its equation changes where the velocity passes zero, or at a corner.
    #[must_use]
    pub fn has_events(&self) -> bool {
        let kinked = |e: &Effect| e.is(&[Action::Kinked]);
        self.has_friction() || self.effects.iter().any(kinked) || self.has_corner()
    }

    /// Whether an effect has a corner other than at the velocity's zeros.
    #[must_use]
    pub fn has_corner(&self) -> bool {
        self.equation().has_corner()
    }

    /// Whether a torque of angle and time acts in addition to gravity, the constant torque and
    /// Coulomb friction.
    #[must_use]
    pub fn has_extra_load(&self) -> bool {
        let position =
            |e: &Effect| e.is(&[Action::Position, Action::Driven, Action::Timed, Action::Friction]);
        self.motion().lateral != 0.0 || self.effects.iter().any(position)
    }

    /// Topology of its angle.
    #[must_use]
    pub fn angle(&self) -> Angle {
        let counts = |e: &Effect| e.kind.counts_turns(&e.parameters);
        if self.effects.iter().any(counts) { Angle::Line } else { Angle::Circle }
    }

    /// Whether it is invariant under a turn.
    #[must_use]
    pub fn repeats_every_turn(&self) -> bool {
        let differs = |e: &Effect| e.kind.bars_maps(&e.parameters) == Some(NOT_PERIODIC);
        self.angle() == Angle::Circle && !self.effects.iter().any(differs)
    }

    /// Whether a map over initial conditions can have all its effects.
    ///
    /// # Errors
    /// [`Error::NotMappable`] for the first that it cannot have.
    pub fn check_mappable(&self) -> Result<(), Error> {
        let bounded = self.angle() == Angle::Line;
        for effect in &self.effects {
            let why = effect.kind.bars_maps(&effect.parameters);
            if let Some(why) = why.filter(|why| !(bounded && *why == NOT_PERIODIC)) {
                let effect = effect.kind.definition().name.to_owned();
                return Err(Error::NotMappable { effect, why });
            }
        }
        Ok(())
    }

    /// The shortest time scale on which what loads the pendulum at rest changes.
    #[must_use]
    pub fn time_scale(&self) -> f64 {
        let mut shortest = self.period();
        for effect in &self.effects {
            for (value, parameter) in
                effect.values().iter().zip(effect.kind.definition().parameters.iter())
            {
                shortest = match parameter.role {
                    Role::Frequency => shortest.min(TAU / value.abs()),
                    Role::Instant => shortest.min(TAU),
                    _ => shortest,
                };
            }
        }
        shortest
    }

    /// Whether an effect changes with the time in the laboratory.
    #[must_use]
    pub fn drifts(&self) -> bool {
        let frozen = |e: &Effect| e.kind.definition().mappable == Mappable::Frozen;
        self.effects.iter().any(|e| frozen(e) || e.is(&[Action::Timed]))
    }
}
