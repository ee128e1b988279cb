//! The library of effects: loops over all effects, for every property.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::fs;

use pendmap::integrate::State;
use pendmap::integrate::tangent::Tangent;
use pendmap::model::effects::{
    Action, Definition, Family, Group, MOST_PARAMETERS, Mappable, Parameter, Power, Role,
};
use pendmap::model::{self, Effect, Equation, Kind, Observation, Pendulum};

use crate::support::{driven, spread};

/// Deterministic numbers in (0, 1) that look random.
pub struct Draws(pub u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.next()
    }

    /// The effect with typical values; a number of periods is a whole one.
    pub fn effect(&mut self, kind: &Kind) -> Effect {
        let value = |p: Parameter| {
            let value = self.between(p.typical);
            if matches!(kind, Kind::BearingHarmonic | Kind::InertiaRipple) && p.name == "n" {
                value.round()
            } else {
                value
            }
        };
        let values: Vec<f64> = kind.definition().parameters.iter().map(value).collect();
        Effect::new(kind.clone(), &values).expect("typical values are in range")
    }
}

/// The pendulum with the effect, 250 after the origin of the laboratory's time.
pub fn has(pendulum: Pendulum, effect: Effect) -> Pendulum {
    let mut pendulum = pendulum.with_effect(effect).expect("once");
    pendulum.lab_time = 250.0;
    pendulum
}

/// A driven pendulum with the effect alone.
fn alone(effect: Effect) -> Pendulum {
    has(Pendulum::new(0.0, 0.7, 1.3, 0.4, 0.0).expect("in range"), effect)
}

#[test]
fn definitions_are_whole() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/model/effects");
    let files: BTreeSet<String> = fs::read_dir(folder)
        .expect("the library")
        .map(|entry| entry.expect("a file").file_name().into_string().expect("a name"))
        .filter(|name| !["law.rs", "mod.rs", "parameter.rs"].contains(&name.as_str()))
        .collect();
    let names: BTreeSet<String> =
        Kind::ALL.iter().map(|kind| format!("{}.rs", kind.definition().name)).collect();
    assert_eq!(names, files);
    assert_eq!(names.len(), Kind::ALL.len(), "names are unique");
    for kind in Kind::ALL {
        let Definition { name, group, family, action, formula, parameters, revealed_by, mappable } =
            kind.definition();
        assert_eq!(Kind::named(name), Ok(kind.clone()));
        assert!(!revealed_by.is_empty(), "{name}");
        assert!((1..=MOST_PARAMETERS).contains(&parameters.count()), "{name}");
        let expected = match action {
            Action::Velocity
            | Action::Kinked
            | Action::Friction
            | Action::SlidingFriction
            | Action::LoadedFriction => Group::Damping,
            // The effect reduces to a constant torque, equal in both senses.
            Action::Position if *kind == Kind::AsymmetricCoulomb => Group::Damping,
            Action::Position | Action::Driven | Action::Timed | Action::Inertia => Group::Torque,
            Action::Drive | Action::FurtherDrive => Group::Drive,
            Action::Reading | Action::Play => Group::Reading,
        };
        assert_eq!(group, expected, "{name}");
        assert_ne!(family, Family::Own, "{name}");
        let words: Vec<&str> = formula.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
        for (k, parameter) in parameters.iter().enumerate() {
            let Parameter { name: own, role, unit, range, typical, meaning, power } = parameter;
            assert_eq!(k == 0, role == Role::Size, "{name}.{own}");
            assert!(words.contains(&own), "{name}: {formula} has no {own}");
            assert!(parameters.iter().take(k).all(|p| p.name != own), "{name}: {own} twice");
            assert!(!unit.is_empty() && !meaning.is_empty(), "{name}.{own}");
            assert!(range[0] < range[1] && typical[0] < typical[1], "{name}.{own}");
            assert!(range[0] <= typical[0] && typical[1] <= range[1], "{name}.{own}");
            assert!(typical.iter().all(|x| x.is_finite()), "{name}.{own}");
            if let Power::TwoMinus(other) = power {
                assert!(other < parameters.count() && other != k, "{name}.{own}");
            }
        }
        let barred = kind.bars_maps(&Draws(1).effect(kind).parameters).is_some();
        assert_eq!(barred, mappable == Mappable::No, "{name}");
    }
}

/// Every effect's acceleration in SI by textbook formulas: velocities in rad/s, times in s.
#[allow(clippy::too_many_lines)] // one line an effect
fn in_si(kind: &Kind, value: &[f64], w0: f64, theta: f64, velocity: f64, lab: f64, t: f64) -> f64 {
    let (p, omega, phase) = (0.7, 1.3 * w0, 0.4);
    let sign = velocity.signum();
    let speed = velocity.abs();
    let drive = |p: f64, omega: f64, phase: f64| p * (omega * t + phase).cos();
    let mut up = drive(p, omega, phase);
    let mut side = 0.0;
    let mut own = 0.0;
    match (kind.definition().name, value) {
        ("viscous_damping", [c_over_m]) => own = -c_over_m * velocity,
        ("coulomb_friction", [tr]) => own = -tr * sign,
        ("quadratic_drag", [q]) => own = -q * velocity * speed,
        ("cubic_damping", [k3]) => own = -k3 * velocity.powi(3),
        ("power_law_drag", [q, n]) => own = -q * speed.powf(*n) * sign,
        ("eddy_brake", [b, vc]) => own = -b * velocity * vc * vc / (vc * vc + velocity * velocity),
        // After a long motion in one sense.
        ("dahl_friction", [f, _]) => own = -f * sign,
        ("stribeck_friction", [a, vs]) => own = -a * (-(velocity / vs).powi(2)).exp() * sign,
        ("load_dependent_friction", [k]) => {
            let load = (1.0 + up) * theta.cos() + (velocity / w0).powi(2);
            own = -k * (load.abs() - 1.0) * sign;
        }
        ("asymmetric_viscous", [b]) => own = -b * speed,
        ("coulomb_drift", [r]) => own = -r * lab * sign,
        ("viscous_drift", [r]) => own = -r * lab * velocity,
        ("coulomb_warm_up", [f, tau]) => own = -f * (-lab / tau).exp_m1() * sign,
        ("viscous_warm_up", [b, tau]) => own = -b * (-lab / tau).exp_m1() * velocity,
        ("bias_torque", [torque]) => own = *torque,
        ("bearing_harmonic", [a, n, psi]) => own = a * (n * theta + psi).sin(),
        ("magnet", [a, w]) => {
            let x = theta - 2.0 * PI * (theta / (2.0 * PI)).round();
            own = -a * (x / w) * (-x * x / (2.0 * w * w)).exp();
        }
        ("natural_frequency_drift", [r]) => {
            own = -r * lab * w0 * w0 * (1.0 + up) * theta.sin();
        }
        ("elastic_restoring", [k]) => own = -k * theta,
        ("drive_amplitude", [e]) => up = drive(p * (1.0 + e), omega, phase),
        ("drive_phase", [d]) => up = drive(p, omega, phase + d),
        ("drive_frequency", [e]) => up = drive(p, omega * (1.0 + e), phase),
        ("drive_second_harmonic", [e, psi]) => {
            up += e * p * (2.0 * (omega * t + phase) + psi).cos();
        }
        ("lateral_drive", [e, psi]) => {
            side = e * p * (omega * t + phase + psi).cos();
        }
        ("base_sway", [amplitude, ws, psi]) => {
            own = -w0 * w0 * amplitude * (ws * lab + psi).cos() * theta.cos();
        }
        ("impulses", [jump, t0]) => {
            let w = 0.05 / w0;
            own = jump * (-0.5 * ((lab - t0) / w).powi(2)).exp() / (w * (2.0 * PI).sqrt());
        }
        ("asymmetric_coulomb", [d]) => own = -d * sign.abs(),
        ("rough_spot", [f, th0, w]) => {
            own = -f * (-(1.0 - (theta - th0).cos()) / (w * w)).exp() * sign;
        }
        ("added_mass", [e]) => own = -e * w0 * w0 * up * theta.sin(),
        ("rig_tilt", [d]) => own = -w0 * w0 * ((theta + d).sin() - theta.sin()),
        ("drive_chirp", [r]) => up = p * (omega * t + 0.5 * r * t * t + phase).cos(),
        ("timebase", [e]) => up = drive(p, omega / (1.0 + e), phase),
        ("inertia_ripple", [e, n, psi]) => {
            let angle = n * theta + psi;
            let gravity = -w0 * w0 * (1.0 + up) * theta.sin();
            let all = gravity + 0.5 * e * n * angle.sin() * velocity * velocity;
            own = all / (1.0 + e * angle.cos()) - gravity;
        }
        // With displacement and momentum `x' + mu v cos th` of the mode equal to 0.
        ("pivot_compliance", [mu, wx, z]) => {
            let (sine, cosine) = theta.sin_cos();
            let gravity = -w0 * w0 * (1.0 + up) * sine;
            let rate = -mu * velocity * cosine;
            let pull = 2.0 * z * wx * rate - mu * velocity * velocity * sine;
            own = (gravity + pull * cosine) / (1.0 - mu * cosine * cosine) - gravity;
        }
        (name, _) if kind.definition().group == Group::Reading => {
            assert!(name.starts_with("encoder") || name == "sensor_lag");
        }
        (name, _) => panic!("{name} has no formula here"),
    }
    own - w0 * w0 * ((1.0 + up) * theta.sin() + side * theta.cos())
}

#[test]
fn formulas_and_powers_of_w0_are_right() {
    let mut draws = Draws(2);
    for kind in Kind::ALL {
        for _ in 0..200 {
            let mut effect = draws.effect(kind);
            if *kind == Kind::Impulses {
                effect.parameters[1] = 250.0 + draws.between([-0.1, 0.1]);
            }
            let pendulum = alone(effect.clone());
            let w0 = draws.between([0.5, 8.0]);
            let [theta, velocity] = [draws.between([-9.0, 9.0]), draws.between([-3.0, 3.0])];
            let tau = draws.between([0.0, 20.0]);
            let values: Vec<f64> = effect
                .values()
                .iter()
                .zip(kind.definition().parameters.iter())
                .map(|(value, parameter)| match parameter.power {
                    Power::Of(k) => value * w0.powi(k),
                    Power::Real(k) => value * w0.powf(k),
                    Power::TwoMinus(n) => value * w0.powf(2.0 - effect.parameters[n]),
                })
                .collect();
            let (lab, t) = (pendulum.lab_time / w0, tau / w0);
            let expected = in_si(kind, &values, w0, theta, w0 * velocity, lab, t);
            let found = w0 * w0 * pendulum.acceleration(tau, theta, velocity);
            let error = (found - expected).abs() / (w0 * w0);
            assert!(error < 1e-11, "{effect:?} at {theta} {velocity} {tau}: {error:e}");
        }
    }
}

#[test]
fn readings_match_their_formulas() {
    for (kind, values, theta, expected) in [
        (Kind::EncoderOffset, &[0.1][..], 2.0, 2.1),
        (Kind::EncoderGain, &[0.1], -20.0, -22.0),
        // 250 after the origin of the laboratory's time, and 40 more.
        (Kind::EncoderDrift, &[1e-3], 2.0, 2.29),
        (Kind::EncoderEccentricity, &[0.1, 0.5 * PI], 2.0 * PI, 2.0 * PI + 0.1),
        (Kind::SensorLag, &[0.01], 2.0, 2.0 - 0.01 * 3.0),
    ] {
        let pendulum = alone(Effect::new(kind.clone(), values).expect("in range"));
        let found = Observation::lift(&pendulum, |_, value| value).read(theta, 3.0, 290.0);
        assert!((found - expected).abs() < 1e-14, "{kind:?}: {found}");
    }
}

#[test]
fn readings_follow_one_another_in_order() {
    let offset = Effect::new(Kind::EncoderOffset, &[0.1]).expect("in range");
    let gain = Effect::new(Kind::EncoderGain, &[0.5]).expect("in range");
    for (effects, expected) in
        [([offset.clone(), gain.clone()], 1.5 * 1.1), ([gain, offset], 1.5 + 0.1)]
    {
        let pendulum = effects.clone().into_iter().fold(driven(0.1, 1.0, 2.0), has);
        let found = Observation::lift(&pendulum, |_, value| value).read(1.0, 3.0, 0.0);
        assert!((found - expected).abs() < 1e-14, "{effects:?}: {found}");
    }
}

/// Number of derivatives, at least the effect's: its pendulum's parameters, angle and velocity.
const MOST: usize = model::Parameter::COMMON.len() + MOST_PARAMETERS + 2;
pub type Dual = Tangent<f64, MOST>;

/// Acceleration and reading, with derivatives if `R` has them.
pub fn evaluated(
    pendulum: &Pendulum,
    tau: f64,
    at: State,
    changed: Option<(usize, f64)>,
) -> [f64; 2] {
    let change = |index: usize, value: f64| match changed {
        Some((which, h)) if which == index => value + h,
        _ => value,
    };
    let all = pendulum.parameters();
    let place =
        |one: model::Parameter| all.iter().position(|other| *other == one).expect("its own");
    let of_model = |one: model::Parameter, value: f64| change(place(one), value);
    let count = all.len();
    let equation = Equation::lift(pendulum, of_model);
    let [theta, velocity] = [change(count, at[0]), change(count + 1, at[1])];
    let forcing = equation.forcing(tau);
    let point = equation.point(&forcing, theta, velocity, 1_f64.copysign(at[1]));
    let lab = pendulum.lab_time + tau;
    let reading = Observation::lift(pendulum, of_model).read(theta, velocity, lab);
    [equation.acceleration(&forcing, &point), reading]
}

pub fn derivatives(pendulum: &Pendulum, tau: f64, at: State) -> [Dual; 2] {
    let all = pendulum.parameters();
    let place =
        |one: model::Parameter| all.iter().position(|other| *other == one).expect("its own");
    let seeded = |index: usize, value: f64| Dual::seeded(value, index);
    let of_model = |one: model::Parameter, value: f64| seeded(place(one), value);
    let count = all.len();
    let constant = |value: f64| Dual { value, slope: [0.0; MOST] };
    let equation = Equation::lift(pendulum, of_model);
    let [theta, velocity] = [seeded(count, at[0]), seeded(count + 1, at[1])];
    let forcing = equation.forcing(constant(tau));
    let point = equation.point(&forcing, theta, velocity, constant(1_f64.copysign(at[1])));
    let lab = constant(pendulum.lab_time + tau);
    let reading = Observation::lift(pendulum, of_model).read(theta, velocity, lab);
    [equation.acceleration(&forcing, &point), reading]
}

#[test]
fn derivatives_agree_with_differences() {
    let mut draws = Draws(3);
    for kind in Kind::ALL {
        for _ in 0..100 {
            let pendulum = alone(draws.effect(kind));
            let at = [draws.between([-9.0, 9.0]), draws.between([-3.0, 3.0])];
            let tau = draws.between([0.0, 20.0]);
            let exact = derivatives(&pendulum, tau, at);
            for index in 0..pendulum.parameters().len() + 2 {
                let difference = |h: f64| {
                    let [plus, minus] =
                        [h, -h].map(|h| evaluated(&pendulum, tau, at, Some((index, h))));
                    [0, 1].map(|k| (plus[k] - minus[k]) / (2.0 * h))
                };
                // Richardson extrapolation from two steps leaves errors of the fourth order.
                let (coarse, fine) = (difference(2e-4), difference(1e-4));
                for k in 0..2 {
                    let expected = (4.0 * fine[k] - coarse[k]) / 3.0;
                    let error = (exact[k].slope[index] - expected).abs();
                    // A narrow magnet has large fifth derivatives.
                    let allowed = 1e-8 * (1.0 + 100.0 * expected.abs());
                    // Finite differences are meaningless across the corner of a load.
                    let corner = *kind == Kind::LoadDependentFriction && near_no_load(tau, at);
                    let what = format!("{:?} by {index}, {at:?}", pendulum.effects);
                    assert!(corner || error < allowed, "{what}: {error:e} of {expected}");
                }
            }
        }
    }
}

/// Whether the load on the rod of [`alone`] is almost zero.
fn near_no_load(tau: f64, [theta, velocity]: State) -> bool {
    let up = 0.7 * (1.3 * tau + 0.4).cos();
    ((1.0 + up) * theta.cos() + velocity * velocity).abs() < 0.01
}

#[test]
fn derivatives_are_finite_at_rest_and_everywhere() {
    let mut draws = Draws(4);
    for kind in Kind::ALL {
        let mut effect = draws.effect(kind);
        // The least power has the steepest torque.
        if *kind == Kind::PowerLawDrag {
            effect.parameters[1] = kind.definition().parameters.at(1).range[0];
        }
        let pendulum = alone(effect.clone());
        for theta in [0.0, PI, -PI, 1e3, 1e-300] {
            for velocity in [0.0, -0.0, 1e-300, -1e-12, 40.0, -1e4] {
                for number in derivatives(&pendulum, 0.3, [theta, velocity]) {
                    let finite = number.value.is_finite()
                        && number.slope.iter().all(|slope| slope.is_finite());
                    assert!(finite, "{effect:?} at {theta} {velocity}: {number:?}");
                }
            }
        }
    }
}

#[test]
fn effects_report_their_mirror_symmetry() {
    let mut draws = Draws(5);
    let psi = |psi: f64| Effect::new(Kind::BearingHarmonic, &[0.1, 3.0, psi]).expect("in range");
    let mut all: Vec<Effect> = Kind::ALL.iter().map(|kind| draws.effect(kind)).collect();
    all.extend([psi(0.0), psi(PI), psi(-PI), psi(0.4)]);
    all.push(Effect::new(Kind::LateralDrive, &[0.0, 0.3]).expect("in range"));
    all.push(Effect::new(Kind::AsymmetricViscous, &[0.0]).expect("in range"));
    for mut effect in all {
        if effect.kind == Kind::Impulses {
            effect.parameters[1] = 250.0;
        }
        let pendulum = alone(effect.clone());
        let mut worst = 0_f64;
        for state in spread(100, 9.0, 3.0) {
            let [a, b] = [1.0, -1.0].map(|side| {
                pendulum.acceleration(1.7 + state[0], side * state[0], side * state[1])
            });
            worst = worst.max((a + b).abs());
        }
        let claimed = pendulum.is_mirror_symmetric();
        assert_eq!(claimed, worst < 1e-13, "{effect:?}: {worst:e}");
        assert!(claimed || worst > 1e-5, "{effect:?}: {worst:e}");
    }
}
