//! The problem of the reference integrator: equation of motion, events and tolerance.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::integrate::tangent::{Number, Tangent};
use crate::lanes::Work;
use crate::model::effects::Point;
use crate::model::equation::Forcing;
use crate::model::recorded::Recorded;
use crate::model::{Equation, Parameter, Pendulum};

/// The longest step is this times a power of the tolerance, over the greatest rate of small motions
/// or of the drive. At fine tolerances it is that allowed by the error of a linear oscillator:
/// otherwise steps at rest would be too long for its derivatives. At coarse ones it is smaller, and
/// motions smaller than the tolerance keep seven digits, so that their turns are resolved. It
/// decreases with the tolerance everywhere, so that tightening always has an effect.
const LONGEST_STEP: (f64, f64) = (1.6, 1.0 / 14.0);
/// Part of the rate of a mode that limits the longest step: the mode moves little compared to the
/// pendulum, and the error of each step includes it.
const MODE: f64 = 0.25;
/// Least error of a step that can be estimated despite rounding.
pub const FINEST: f64 = 1e-15;
/// Number of angles, and of times in a drive's period, at which the rate is evaluated.
const LOOKS: [usize; 2] = [32, 8];

/// State besides angle and velocity: the angle of the last turn, the memories of an effect and of the
/// sensor's play there, displacement and momentum of a mode of the rig.
pub type Past<N> = [N; 5];

/// The right-hand side: the equation of motion over numbers of some kind, and the motion
/// of the pivot that was recorded.
#[derive(Clone, Debug)]
pub struct Field<N> {
    equation: Equation<N>,
    recorded: Option<Arc<Recorded>>,
}

/// The equation of motion over numbers of some kind, and the error allowed to a step.
#[derive(Clone, Debug)]
pub struct OdeProblem<N> {
    field: Field<N>,
    /// The field over plain numbers, for times of events: where the velocity passes zero, when a stuck
    /// pendulum is released.
    plain: Field<f64>,
    finds_turns: bool,
    jumps: bool,
    harmonic: bool,
    period: Option<f64>,
    look: f64,
    longest: f64,
    tolerance: f64,
}

impl<N: Number> OdeProblem<N> {
    /// The problem of `pendulum`, with an error of about `tolerance` a step in angle and velocity; `number`
    /// makes a number of each parameter as [`Equation::lift`] does.
    ///
    /// Where `ages`, time in the laboratory goes on; otherwise it is held, as in a map. The
    /// tolerance is held above [`FINEST`].
    #[must_use]
    pub fn new(
        pendulum: &Pendulum,
        ages: bool,
        tolerance: f64,
        number: impl FnMut(Parameter, f64) -> N,
    ) -> Self {
        Self::with_rate(pendulum, greatest_rate(pendulum), ages, tolerance, number)
    }

    /// The problem with a known [`greatest_rate`], for several problems with one pendulum.
    #[must_use]
    pub fn with_rate(
        pendulum: &Pendulum,
        rate: f64,
        ages: bool,
        tolerance: f64,
        number: impl FnMut(Parameter, f64) -> N,
    ) -> Self {
        let mut equation = Equation::lift(pendulum, number);
        equation.ages = ages;
        let mut plain = pendulum.equation();
        plain.ages = ages;
        let changes = ages && pendulum.drifts();
        // Negative friction, which a fit may pass through, never holds, but jumps all the same.
        let jumps = pendulum.has_friction() || pendulum.theta_r < 0.0;
        let tolerance = tolerance.max(FINEST);
        let harmonic = plain.has_closed_release() && !plain.keeps()[0];
        Self {
            finds_turns: jumps || pendulum.has_events() || plain.keeps()[1],
            field: Field { equation, recorded: None },
            plain: Field { equation: plain, recorded: None },
            jumps,
            harmonic,
            period: (!changes).then(|| pendulum.period()),
            look: pendulum.time_scale(),
            longest: LONGEST_STEP.0 * tolerance.powf(LONGEST_STEP.1) / rate,
            tolerance,
        }
    }

    /// This problem with the recorded motion of the pivot added to the drive.
    #[must_use]
    pub fn driven_by(mut self, recorded: Arc<Recorded>) -> Self {
        self.field = self.field.driven_by(Arc::clone(&recorded));
        self.harmonic = false;
        self.period = None;
        self.look = self.look.min(8.0 * recorded.spacing());
        self.longest /= (1.0 + recorded.greatest()).sqrt();
        self.plain = self.plain.driven_by(recorded);
        self
    }

    /// This problem with gravity `(w0 / w_ref)^2`, time being counted in `1 / w_ref`.
    #[must_use]
    pub fn with_gravity(mut self, gravity: N) -> Self {
        let value = gravity.value();
        self.longest /= value.max(1.0).sqrt();
        self.plain.equation = self.plain.equation.with_gravity(value);
        self.field.equation = self.field.equation.with_gravity(gravity);
        self
    }

    /// This problem with every turn found, also where nothing changes there: derivatives by the
    /// strength of a friction that is 0 need them.
    #[must_use]
    pub fn finding_turns(mut self) -> Self {
        self.finds_turns = true;
        self
    }

    /// The field of accelerations.
    #[must_use]
    pub fn field(&self) -> &Field<N> {
        &self.field
    }

    /// The field without derivatives.
    #[must_use]
    pub fn plain(&self) -> &Field<f64> {
        &self.plain
    }

    /// [`Field::acceleration`].
    pub fn acceleration(&self, tau: f64, state: [N; 2], signs: [f64; 2], past: Past<N>) -> N {
        self.field.acceleration(tau, state, signs, past)
    }

    /// The memories of a motion that begins in this state; the mode is in its equilibrium.
    #[must_use]
    pub fn begin(&self, tau: f64, state: [N; 2]) -> Past<N> {
        let zero = state[0].like(0.0);
        let past = [state[0], zero, zero, zero, zero];
        if !self.field.sways() {
            return past;
        }
        let x = self.field.equation.aside(&self.field.place(tau, state, [1.0; 2], past));
        let [rate, _] = self.field.sway(state, past);
        [state[0], zero, zero, x, -rate]
    }

    /// Whether anything depends on the last turn.
    #[must_use]
    pub fn keeps(&self) -> bool {
        self.plain.equation.keeps() != [false; 2]
    }

    /// The angle of a turn and what an effect keeps there, reached in this sense from the last one.
    #[must_use]
    pub fn turned(&self, theta: N, sense: f64, past: Past<N>) -> Past<N> {
        if !self.keeps() {
            return past;
        }
        let at = self.field.place(0.0, [theta; 2], [sense, 1.0], past);
        let kept = self.field.equation.kept(0, &at).unwrap_or(past[1]);
        [theta, kept, self.played(theta, sense, past) - theta, past[3], past[4]]
    }

    /// The angle behind the sensor's play, reached in this sense from the last turn.
    #[must_use]
    pub fn played(&self, theta: N, sense: f64, [turned, _, played, x, y]: Past<N>) -> N {
        if !self.plain.equation.keeps()[1] {
            return theta;
        }
        let past = [turned, played, played, x, y];
        let at = self.field.place(0.0, [theta; 2], [sense, 1.0], past);
        self.field.equation.kept(1, &at).map_or(theta, |apart| theta + apart)
    }

    /// The switching function of an effect with a corner; 1 if there is none.
    #[must_use]
    pub fn switch(&self, tau: f64, [theta, velocity]: [f64; 2]) -> f64 {
        let past = [theta, 1.0, 0.0, 0.0, 0.0];
        let at = self.plain.point(tau, [theta, velocity], [1.0; 2], past).1;
        self.plain.equation.switch(&at).unwrap_or(1.0)
    }

    /// Whether an effect has a corner.
    #[must_use]
    pub fn has_corner(&self) -> bool {
        self.plain.equation.has_corner()
    }

    /// Whether the equation changes at zeros of the velocity, or turns are requested anyway.
    #[must_use]
    pub fn finds_turns(&self) -> bool {
        self.finds_turns
    }

    /// Whether friction makes the acceleration jump with the sense of the motion; where it is
    /// positive, it can hold the pendulum.
    #[must_use]
    pub fn jumps(&self) -> bool {
        self.jumps
    }

    /// Whether the load of a pendulum at rest is known in closed form, except for a mode of the
    /// rig.
    #[must_use]
    pub fn is_harmonic(&self) -> bool {
        self.harmonic
    }

    /// The period of that load; `None` if it is not periodic.
    #[must_use]
    pub fn period(&self) -> Option<f64> {
        self.period
    }

    /// The time scale of its changes.
    #[must_use]
    pub fn look(&self) -> f64 {
        self.look
    }

    /// The longest step.
    #[must_use]
    pub fn longest_step(&self) -> f64 {
        self.longest
    }

    /// The error allowed to a step.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }
}

impl<N: Number> Field<N> {
    fn driven_by(self, recorded: Arc<Recorded>) -> Self {
        Self { equation: self.equation.with_lateral(), recorded: Some(recorded) }
    }

    /// The equation of motion.
    #[must_use]
    pub fn equation(&self) -> &Equation<N> {
        &self.equation
    }

    /// The drive at time `tau`, in the shape of `number`.
    #[inline(always)]
    #[must_use]
    pub fn forcing(&self, tau: f64, number: N) -> Forcing<N> {
        let mut forcing = self.equation.forcing(number.like(tau));
        if let Some(recorded) = &self.recorded {
            let [up, side] = recorded.acceleration(tau);
            let gravity = self.equation.gravity();
            forcing.vertical = gravity.scale_add(up, forcing.vertical);
            forcing.lateral = gravity.scale_add(side, forcing.lateral);
        }
        forcing
    }

    /// The drive, and the point where the formulas are evaluated.
    #[inline(always)]
    fn point(
        &self,
        tau: f64,
        [theta, velocity]: [N; 2],
        [sense, side]: [f64; 2],
        past: Past<N>,
    ) -> (Forcing<N>, Point<N>) {
        let forcing = self.forcing(tau, theta);
        let signs = [theta.like(sense), theta.like(side)];
        let at = self.equation.point_held(&forcing, theta, velocity, signs);
        (forcing, Point { past: [past[0], past[1]], sway: [past[3], past[4]], ..at })
    }

    /// The point for evaluating the formulas, of single states.
    #[inline(never)]
    fn place(&self, tau: f64, state: [N; 2], signs: [f64; 2], past: Past<N>) -> Point<N> {
        let mut at = Point::nowhere(state[0]);
        state[0].aside(Placing { field: self, tau, state, signs, past, into: &mut at });
        at
    }

    /// Whether a mode of the rig moves with the pendulum.
    #[inline(always)]
    #[must_use]
    pub fn sways(&self) -> bool {
        self.equation.sways()
    }

    /// The rates of that mode's displacement and momentum; 0 if there is none.
    #[inline(never)]
    #[must_use]
    pub fn sway(&self, state: [N; 2], past: Past<N>) -> [N; 2] {
        let mut rates = [state[0].like(0.0); 2];
        if self.sways() {
            state[0].aside(Swaying { field: self, state, past, into: &mut rates });
        }
        rates
    }

    /// The acceleration at time `tau`, moving in the sense and on the side of a corner that `signs`
    /// says (1 or -1), since the turn that `past` says.
    #[inline(never)]
    pub fn acceleration(&self, tau: f64, state: [N; 2], signs: [f64; 2], past: Past<N>) -> N {
        let mut acceleration = state[1];
        let into = &mut acceleration;
        state[0].aside(Accelerating { field: self, tau, state, signs, past, into });
        acceleration
    }

    /// The acceleration, inlined.
    #[inline(always)]
    pub fn at(&self, tau: f64, state: [N; 2], signs: [f64; 2], past: Past<N>) -> N {
        let (forcing, at) = self.point(tau, state, signs, past);
        self.equation.acceleration(&forcing, &at)
    }
}

/// The acceleration, in its own function.
struct Accelerating<'a, N> {
    field: &'a Field<N>,
    tau: f64,
    state: [N; 2],
    signs: [f64; 2],
    past: Past<N>,
    into: &'a mut N,
}

impl<N: Number> Work for Accelerating<'_, N> {
    #[inline(always)]
    fn run(self) {
        let Self { field, tau, state, signs, past, into } = self;
        *into = field.at(tau, state, signs, past);
    }
}

/// The point where formulas are evaluated, in its own function.
struct Placing<'a, N> {
    field: &'a Field<N>,
    tau: f64,
    state: [N; 2],
    signs: [f64; 2],
    past: Past<N>,
    into: &'a mut Point<N>,
}

impl<N: Number> Work for Placing<'_, N> {
    #[inline(always)]
    fn run(self) {
        let Self { field, tau, state, signs, past, into } = self;
        *into = field.point(tau, state, signs, past).1;
    }
}

/// The rates of a mode of the rig, in their own function.
struct Swaying<'a, N> {
    field: &'a Field<N>,
    state: [N; 2],
    past: Past<N>,
    into: &'a mut [N; 2],
}

impl<N: Number> Work for Swaying<'_, N> {
    #[inline(always)]
    fn run(self) {
        let Self { field, state, past, into } = self;
        *into = field.equation.sway(&field.point(0.0, state, [1.0; 2], past).1);
    }
}

/// The greatest frequency or rate of decay of small motions about any angle at any time, or that of the
/// drive; at least 1.
#[must_use]
pub fn greatest_rate(pendulum: &Pendulum) -> f64 {
    let equation = Equation::lift(pendulum, |_, value| Tangent::<f64, 2>::constant(value));
    let (mut stiffness, mut damping) = (1_f64, 0_f64);
    for k in 0..LOOKS[1] {
        let tau = pendulum.period() * k as f64 / LOOKS[1] as f64;
        let forcing = equation.forcing(Tangent::constant(tau));
        for i in 0..LOOKS[0] {
            let theta = PI * (2.0 * i as f64 / LOOKS[0] as f64 - 1.0);
            let (theta, velocity) = (Tangent::seeded(theta, 0), Tangent::seeded(0.0, 1));
            let mut at = equation.point(&forcing, theta, velocity, Tangent::constant(1.0));
            // The memory of an effect changes fastest right after a turn.
            at.past = [theta.value, -1.0].map(Tangent::constant);
            let [by_theta, by_velocity] = equation.acceleration(&forcing, &at).slope;
            stiffness = stiffness.max(by_theta.abs());
            damping = damping.max(by_velocity.abs());
        }
    }
    let drive = if pendulum.is_autonomous() { 0.0 } else { pendulum.motion().omega };
    let own = if equation.sways() { MODE * rate_of_mode(pendulum) } else { 0.0 };
    stiffness.sqrt().max(damping).max(drive).max(own)
}

/// The greatest frequency or rate of decay of a mode of the rig, the pendulum giving way.
fn rate_of_mode(pendulum: &Pendulum) -> f64 {
    let equation = Equation::lift(pendulum, |_, value| Tangent::<f64, 4>::constant(value));
    let forcing = equation.forcing(Tangent::constant(0.0));
    let (mut stiffness, mut damping) = (0_f64, 0_f64);
    for i in 0..LOOKS[0] {
        let theta = PI * (2.0 * i as f64 / LOOKS[0] as f64 - 1.0);
        let (theta, velocity) = (Tangent::seeded(theta, 0), Tangent::seeded(0.0, 1));
        let mut at = equation.point(&forcing, theta, velocity, Tangent::constant(1.0));
        at.sway = [2, 3].map(|column| Tangent::seeded(0.0, column));
        let pull = equation.acceleration(&forcing, &at).slope;
        let [rate, force] = equation.sway(&at).map(|of| of.slope);
        // `x''` by `x` and by the momentum.
        let by = |column: usize| rate[1] * pull[column] + rate[3] * force[column];
        stiffness = stiffness.max(by(2).abs());
        damping = damping.max(by(3).abs());
    }
    stiffness.sqrt().max(damping)
}
