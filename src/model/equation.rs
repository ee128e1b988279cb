//! The equation of motion, written once.
//!
//! `th'' + gamma th' + (1 + a(tau)) sin th + l(tau) cos th = torque - theta_r sign(th') + effects`:
//! eq. 1.2 of Horton, Wiercigroch & Xu (2008), their eq. 2.1 without dimensions where there is
//! friction, a constant torque (over `m l^2 w0^2`) and the library of effects. `a` and `l` are the
//! pivot's accelerations over gravity, upward and toward positive theta; nondimensional time
//! `tau = w0 t`, `gamma = c / (m w0)`.
//!
//! Where `w0` itself is fitted, time is counted in `1 / w_ref` with a fixed `w_ref` near it, and
//! gravity, its drive included, is multiplied by `(w0 / w_ref)^2` ([`Equation::with_gravity`]).

mod mapped;

use std::f64::consts::FRAC_1_PI;
use std::sync::Arc;

use super::drive::Motion;
use super::effects::{Action, Kind, MOST_PARAMETERS, Mappable, Point};
use super::formula::Formula;
use super::parameter::Parameter;
use super::pendulum::Pendulum;
use crate::lanes::Real;
use crate::lanes::sine::{Degree, Fine};

/// The equation of motion with its parameters as numbers of some kind.
#[derive(Clone, Debug)]
pub struct Equation<R> {
    /// Viscous damping.
    pub gamma: R,
    /// Coulomb friction.
    pub theta_r: R,
    /// Constant torque.
    pub torque: R,
    /// The pivot's motion.
    pub motion: Motion<R>,
    /// Gravity and its reciprocal: `(w0 / w_ref)^2`, 1 where the unit of time is `1 / w0`.
    gravity: [R; 2],
    /// Time in the laboratory at `tau = 0`.
    pub lab_time: R,
    /// Whether the time in the laboratory goes on with `tau`; a map holds it.
    pub ages: bool,
    /// Effects with a torque, and formulas, whose friction is a torque in the sense of the motion.
    torques: Vec<(Kind, [R; MOST_PARAMETERS])>,
    /// Effects with an inertia, which are among the torques too.
    inertias: Vec<(Kind, [R; MOST_PARAMETERS])>,
    /// Effects with a friction.
    frictions: Vec<(Kind, [R; MOST_PARAMETERS])>,
    /// The formulas once more, for what they hold at rest.
    formulas: Vec<(Arc<Formula>, [R; MOST_PARAMETERS])>,
    /// Effects that depend on the last turn: one with a torque, and the sensor's play.
    keepers: [Option<(Kind, [R; MOST_PARAMETERS])>; 2],
    /// The effect with a mode of the rig.
    mode: Option<(Kind, [R; MOST_PARAMETERS])>,
    /// The effect with a corner.
    corner: Option<(Kind, [R; MOST_PARAMETERS])>,
    sideways: bool,
    plain: bool,
    /// Whether the load that friction can hold changes with the drive, and with the laboratory's
    /// time.
    holds: [bool; 2],
}

/// The accelerations of the drive at one time.
#[derive(Clone, Copy, Debug)]
pub struct Forcing<R> {
    /// Gravity times `1 + a`.
    pub vertical: R,
    /// Gravity times `l`.
    pub lateral: R,
    /// One over gravity.
    pub per_gravity: R,
    /// Time in the laboratory.
    pub lab: R,
    /// Phase of the harmonic drive, rad, if a formula uses it.
    pub phase: R,
}

impl Forcing<f64> {
    /// These accelerations in the shape of `number`.
    #[inline(always)]
    #[must_use]
    pub fn like<R: Real>(&self, number: R) -> Forcing<R> {
        Forcing {
            vertical: number.like(self.vertical),
            lateral: number.like(self.lateral),
            per_gravity: number.like(self.per_gravity),
            lab: number.like(self.lab),
            phase: number.like(self.phase),
        }
    }
}

impl<R: Real> Equation<R> {
    /// The equation of `pendulum`; `number` makes a number of a parameter and its value.
    pub fn lift(pendulum: &Pendulum, mut number: impl FnMut(Parameter, f64) -> R) -> Self {
        let [gamma, theta_r, torque, p, omega, phase] =
            Parameter::COMMON.map(|parameter| number(parameter, pendulum.value(parameter)));
        let zero = gamma.like(0.0);
        let mut motion = Motion {
            p,
            omega,
            phase,
            second: zero,
            second_phase: zero,
            lateral: zero,
            lateral_phase: zero,
            chirp: zero,
        };
        let (mut torques, mut inertias) = (Vec::new(), Vec::new());
        let (mut frictions, mut formulas) = (Vec::new(), Vec::new());
        let (mut sideways, mut plain) = (false, true);
        let mut holds = [false; 2];
        let (mut corner, mut mode, mut keepers) = (None, None, [None, None]);
        let probe = Point::nowhere(zero);
        for (index, effect) in pendulum.effects.iter().enumerate() {
            let parameters = effect.lift(index, &mut number);
            if effect.kind.switch(&parameters, &probe).is_some() {
                corner = Some((effect.kind.clone(), parameters));
            }
            if effect.kind.sway(&parameters, &probe).is_some() {
                mode = Some((effect.kind.clone(), parameters));
            }
            if effect.kind.kept(&parameters, &probe).is_some() {
                keepers[usize::from(effect.is(&[Action::Play]))] =
                    Some((effect.kind.clone(), parameters));
            }
            if let Kind::Formula(formula) = &effect.kind {
                holds[0] |= formula.is_driven();
                holds[1] |= formula.definition().mappable == Mappable::Frozen;
                torques.push((effect.kind.clone(), parameters));
                formulas.push((formula.clone(), parameters));
                continue;
            }
            match effect.kind.definition().action {
                Action::Position | Action::Velocity | Action::Kinked => {
                    torques.push((effect.kind.clone(), parameters));
                }
                Action::Driven | Action::Timed => {
                    torques.push((effect.kind.clone(), parameters));
                    plain = false;
                }
                Action::Inertia => {
                    torques.push((effect.kind.clone(), parameters));
                    inertias.push((effect.kind.clone(), parameters));
                }
                Action::Friction | Action::SlidingFriction | Action::LoadedFriction => {
                    holds[0] |= effect.is(&[Action::LoadedFriction]);
                    holds[1] |= effect.kind.definition().mappable == Mappable::Frozen;
                    frictions.push((effect.kind.clone(), parameters));
                }
                Action::Drive => effect.kind.drive(&parameters, &mut motion),
                Action::FurtherDrive => {
                    effect.kind.drive(&parameters, &mut motion);
                    (sideways, plain) = (true, false);
                }
                Action::Reading | Action::Play => {}
            }
        }
        let lab_time = gamma.like(pendulum.lab_time);
        let gravity = [gamma.like(1.0); 2];
        let ages = false;
        Self {
            gamma,
            theta_r,
            torque,
            motion,
            gravity,
            lab_time,
            ages,
            torques,
            inertias,
            frictions,
            formulas,
            keepers,
            mode,
            corner,
            sideways,
            plain,
            holds,
        }
    }

    /// This equation with gravity `(w0 / w_ref)^2`, time being counted in `1 / w_ref`.
    #[must_use]
    pub fn with_gravity(mut self, gravity: R) -> Self {
        self.gravity = [gravity, gravity.like(1.0) / gravity];
        self
    }

    /// Gravity.
    #[inline(always)]
    pub fn gravity(&self) -> R {
        self.gravity[0]
    }

    /// This equation with sideways accelerations taken into account even where no effect makes them, for
    /// forcings that are changed before use.
    #[must_use]
    pub fn with_lateral(mut self) -> Self {
        self.sideways = true;
        self
    }

    /// The drive at time `tau`.
    #[inline(always)]
    pub fn forcing(&self, tau: R) -> Forcing<R> {
        let lateral = if self.sideways { self.motion.sideways(tau) } else { tau.like(0.0) };
        self.pushed(self.motion.vertical(tau, self.plain), lateral, tau)
    }

    /// The drive of a pivot whose motion is known: `vertical` is `1 + a`.
    #[inline(always)]
    pub fn pushed(&self, vertical: R, lateral: R, tau: R) -> Forcing<R> {
        let [gravity, per_gravity] = self.gravity;
        let lab = if self.ages { self.lab_time + tau } else { self.lab_time };
        let Motion { omega, phase, .. } = self.motion;
        let phase = if self.asks_for_phase() { omega.mul_add(tau, phase) } else { lab };
        Forcing {
            vertical: gravity * vertical,
            lateral: gravity * lateral,
            per_gravity,
            lab,
            phase,
        }
    }

    /// Whether a user's own effect changes with the phase of the drive.
    #[inline(always)]
    fn asks_for_phase(&self) -> bool {
        for (formula, _) in &self.formulas {
            if formula.is_timed() {
                return true;
            }
        }
        false
    }

    /// The point at which formulas are evaluated; `sense` is 1 or -1.
    #[inline(always)]
    pub fn point(&self, forcing: &Forcing<R>, theta: R, velocity: R, sense: R) -> Point<R> {
        let mut at = self.point_held(forcing, theta, velocity, [sense, sense.like(1.0)]);
        if let Some(switch) = self.switch(&at) {
            at.side = switch.sign();
        }
        at
    }

    /// The point where formulas are evaluated, with the sense and the side of a corner that a step holds.
    #[inline(always)]
    pub fn point_held(
        &self,
        forcing: &Forcing<R>,
        theta: R,
        velocity: R,
        [sense, side]: [R; 2],
    ) -> Point<R> {
        let sine = theta.scale(FRAC_1_PI).sine::<Fine>();
        let Forcing { vertical, per_gravity, lab, phase, .. } = *forcing;
        let (past, sway) = ([theta, sense], [theta.like(0.0); 2]);
        Point { theta, velocity, sense, side, sine, vertical, per_gravity, lab, phase, past, sway }
    }

    /// Whether a torque depends on the last turn, and whether the sensor has play.
    #[must_use]
    pub fn keeps(&self) -> [bool; 2] {
        [self.keepers[0].is_some(), self.keepers[1].is_some()]
    }

    /// The memory of the torque, or the reading of the play less the angle; none if there is none.
    #[must_use]
    pub fn kept(&self, which: usize, at: &Point<R>) -> Option<R> {
        let (kind, parameters) = self.keepers[which].as_ref()?;
        kind.kept(parameters, at)
    }

    /// Whether a mode of the rig moves with the pendulum.
    #[inline(always)]
    #[must_use]
    pub fn sways(&self) -> bool {
        self.mode.is_some()
    }

    /// The displacement of the mode where a motion begins; 0 where there is none.
    #[must_use]
    pub fn aside(&self, at: &Point<R>) -> R {
        match &self.mode {
            Some((kind, parameters)) => kind.aside(parameters, at),
            None => at.constant(0.0),
        }
    }

    /// The rates of that mode's displacement and momentum; 0 where there is none.
    #[inline(always)]
    #[must_use]
    pub fn sway(&self, at: &Point<R>) -> [R; 2] {
        let rates = match &self.mode {
            Some((kind, parameters)) => kind.sway(parameters, at),
            None => None,
        };
        match rates {
            Some(rates) => rates,
            None => [at.constant(0.0); 2],
        }
    }

    /// The function at whose zeros an effect has a corner; none where no effect has.
    #[inline(always)]
    pub fn switch(&self, at: &Point<R>) -> Option<R> {
        match &self.corner {
            Some((kind, parameters)) => kind.switch(parameters, at),
            None => None,
        }
    }

    /// Whether an effect has a corner.
    #[must_use]
    pub fn has_corner(&self) -> bool {
        self.corner.is_some()
    }

    /// All torques per inertia except friction.
    pub fn load(&self, forcing: &Forcing<R>, at: &Point<R>) -> R {
        let mut sum = self.moving_load(forcing, at);
        for (formula, parameters) in &self.formulas {
            // A formula is summed as a whole.
            sum = sum + formula.friction(parameters, at) * at.sense;
        }
        sum
    }

    /// The magnitude of the friction.
    pub fn friction(&self, at: &Point<R>) -> R {
        let mut sum = self.library_friction(at);
        for (formula, parameters) in &self.formulas {
            sum = sum + formula.friction(parameters, at);
        }
        sum
    }

    /// `th''` while moving in the sense of `at`.
    #[inline(always)]
    pub fn acceleration(&self, forcing: &Forcing<R>, at: &Point<R>) -> R {
        let all = (-self.library_friction(at)).mul_add(at.sense, self.moving_load(forcing, at));
        if self.inertias.is_empty() { all } else { all / self.inertia(at) }
    }

    /// The acceleration by effects and friction, without gravity, constant torque and viscous damping,
    /// moving in the sense of `at`.
    #[inline(always)]
    pub fn besides(&self, forcing: &Forcing<R>, at: &Point<R>) -> R {
        self.extra(forcing, at) - self.library_friction(at) * at.sense
    }

    /// All torques, and the friction of formulas, moving in the sense of `at`.
    #[inline(always)]
    fn moving_load(&self, forcing: &Forcing<R>, at: &Point<R>) -> R {
        // Evaluated first, so that no other value has to be kept in registers.
        let extra = self.extra(forcing, at);
        let damping = Kind::ViscousDamping.torque(&Self::only(self.gamma), at);
        let bias = Kind::BiasTorque.torque(&Self::only(self.torque), at);
        (-forcing.vertical).mul_add(at.sine, extra + bias + damping)
    }

    /// The load by the sideways drive and by torques of effects.
    #[inline(always)]
    fn extra(&self, forcing: &Forcing<R>, at: &Point<R>) -> R {
        let mut sum = at.constant(0.0);
        if self.sideways {
            sum = -(forcing.lateral * at.cosine());
        }
        for (kind, parameters) in &self.torques {
            sum = sum + kind.torque(parameters, &at.hidden());
        }
        sum
    }

    /// The magnitude of the friction without that of formulas.
    #[inline(always)]
    fn library_friction(&self, at: &Point<R>) -> R {
        let mut sum = at.constant(0.0);
        for (kind, parameters) in &self.frictions {
            sum = sum + kind.friction(parameters, &at.hidden());
        }
        sum + Kind::CoulombFriction.friction(&Self::only(self.theta_r), at)
    }

    /// Whether only gravity under the harmonic drive and a constant torque load the pendulum at
    /// rest, against a constant friction.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        let none = self.torques.is_empty() && self.frictions.is_empty();
        self.plain && !self.sideways && none && self.formulas.is_empty()
    }

    /// Whether a pendulum at rest is loaded by gravity under the harmonic drive and by what does not
    /// change, against a friction that does not change.
    #[must_use]
    pub fn has_closed_release(&self) -> bool {
        let [loaded, drifting] = self.holds;
        let holds_alike = !(loaded || drifting && self.ages);
        self.plain && !self.sideways && holds_alike
    }

    /// The inertia over that without effects.
    #[inline(always)]
    fn inertia(&self, at: &Point<R>) -> R {
        let mut sum = at.constant(1.0);
        for (kind, parameters) in &self.inertias {
            sum = sum + kind.inertia(parameters, &at.hidden());
        }
        sum
    }

    #[inline(always)]
    fn only(value: R) -> [R; MOST_PARAMETERS] {
        let zero = value.like(0.0);
        let mut parameters = [zero; MOST_PARAMETERS];
        parameters[0] = value;
        parameters
    }
}

/// The load without damping, friction and effects: `torque - vertical sin(pi half_turns)`.
///
/// The angle is in half turns, as the kernel counts it (see [`crate::lanes::sine`]). Linear in
/// `vertical` and `torque`, so that an integrator may put its own factor into both.
#[inline(always)]
pub fn conservative_load<D: Degree, R: Real>(vertical: f64, torque: f64, half_turns: R) -> R {
    half_turns.sine::<D>().affine(-vertical, torque)
}
