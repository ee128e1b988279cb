//! The attractors of a map, numbered by their keys and named by kind, period and winding.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;
use serde::{Deserialize, Serialize};

use super::chaos::ChaoticSet;
use super::kind::Kind;
use super::long_runs::Senses;
use super::region::Region;
use crate::integrate::State;
use crate::model::{Angle, Pendulum};
use crate::orbit::PeriodicOrbit;
use crate::orbit::newton::SAME;
use crate::orbit::rotation::Rotation;
use crate::orbit::symmetry::Mirror;

/// Angles this near to 0 or pi are set to it.
const EXACT: f64 = 1e-9;

/// An attractor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Attractor {
    /// Its kind.
    pub kind: Kind,
    /// Period in forcing periods; `None` if meaningless.
    pub n: Option<usize>,
    /// Net turns over that period; without one the sense of its turns: 1, -1 or 0.
    pub w: i64,
    /// Side to which one of two asymmetric twins without net turns leans: 1, -1, or 0 for no twins.
    pub lean: i64,
    /// Multiple of a turn around which it moves, on the line.
    pub turn: i64,
    /// Stroboscopic points: of a cycle in their order, of a chaotic attractor a sample.
    pub points: Vec<State>,
    /// Floquet multipliers; one for a running state without drive, none for chaos.
    pub multipliers: Vec<Complex<f64>>,
    /// Largest Lyapunov exponent per unit of tau, and its standard error where it is sampled.
    pub exponent: f64,
    /// Standard error of the exponent; 0 where it comes from multipliers.
    pub exponent_stderr: f64,
    /// Time after which it closes; `None` for chaos.
    pub period: Option<f64>,
    /// The region of its trajectories, if no trap determines membership.
    pub region: Option<Region>,
    /// A reproducible name: [`Self::plain_name`], with what tells it from others of that name.
    pub name: String,
    /// Topology of its angle.
    pub angle: Angle,
    /// Index of its mirror image in the catalogue: its own if symmetric.
    pub twin: Option<usize>,
}

impl Attractor {
    /// One of this description alone, without points.
    #[must_use]
    pub const fn described(kind: Kind, n: Option<usize>, w: i64, angle: Angle) -> Self {
        Self {
            kind,
            n,
            w,
            lean: 0,
            turn: 0,
            points: Vec::new(),
            multipliers: Vec::new(),
            exponent: f64::NAN,
            exponent_stderr: 0.0,
            period: None,
            region: None,
            name: String::new(),
            angle,
            twin: None,
        }
    }

    /// The attractor of a periodic orbit; also used to describe one that does not attract.
    #[must_use]
    pub fn periodic(pendulum: &Pendulum, orbit: &PeriodicOrbit) -> Self {
        let period = orbit.n as f64 * pendulum.period();
        let kind = classify(pendulum, orbit);
        Self {
            points: if kind.is_rest() {
                vec![[balanced(orbit.points[0][0]), 0.0]]
            } else {
                orbit.points.clone()
            },
            multipliers: orbit.multipliers.0.to_vec(),
            exponent: orbit.multipliers.exponent(period),
            period: Some(period),
            ..Self::described(kind, Some(orbit.n), orbit.w, orbit.angle)
        }
    }

    /// The set of states that friction holds for ever around `theta`, hanging or inverted.
    #[must_use]
    pub fn resting(angle: Angle, theta: f64) -> Self {
        let kind = if theta.cos() < 0.0 { Kind::InvertedRest } else { Kind::Rest };
        Self { points: vec![[theta, 0.0]], ..Self::described(kind, Some(1), 0, angle) }
    }

    /// The attractor of a running state without drive; its one multiplier is that of the angle section.
    #[must_use]
    pub fn running(rotation: &Rotation) -> Self {
        Self {
            points: vec![[0.0, rotation.velocity]],
            multipliers: vec![Complex::new(rotation.multiplier, 0.0)],
            exponent: 0.0,
            period: Some(rotation.period),
            ..Self::described(Kind::Rotation, Some(1), rotation.sense, Angle::Circle)
        }
    }

    /// The attractor of a set of trajectories that no trap captures.
    #[must_use]
    pub fn sampled(set: &ChaoticSet) -> Self {
        Self {
            points: set.points.clone(),
            exponent: set.exponent,
            exponent_stderr: set.exponent_stderr,
            region: set.band.is_none().then(|| set.region.clone()),
            ..Self::described(set.kind, None, set.sense, set.region.angle())
        }
    }

    /// Whether all multipliers lie inside the unit circle; without damping, when this is
    /// impossible, whether they lie on it as a pair.
    #[must_use]
    pub fn is_stable(&self, pendulum: &Pendulum) -> bool {
        if pendulum.is_dissipative() {
            return self.multipliers.iter().all(|m| m.norm() < 1.0);
        }
        if pendulum.is_autonomous() && self.kind == Kind::Rest {
            // The bottom of a potential, whose period may be the requested one.
            return true;
        }
        self.multipliers.iter().all(|m| m.im != 0.0)
    }

    /// Whether friction holds it: a set, not an orbit.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.exponent.is_nan()
    }

    /// Whether it is a running state without drive, with its own period.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.kind == Kind::Rotation && self.multipliers.len() == 1
    }

    /// Whether most of these points lie in its region, and it has this kind of turns.
    #[must_use]
    pub fn keeps(&self, points: &[State], senses: Senses) -> bool {
        let (kind, sense) = senses.kind();
        let turns = self.kind == Kind::TumblingChaos || (self.kind, self.w) == (kind, sense);
        turns && self.region.as_ref().is_some_and(|region| region.holds_most(points))
    }

    /// Whether one of its points lies within `tolerance` of a state.
    #[must_use]
    pub fn passes(&self, state: State, tolerance: f64) -> bool {
        self.points.iter().any(|p| self.angle.distance(*p, state) < tolerance)
    }

    /// Whether it is the orbit of these points.
    #[must_use]
    pub fn is_orbit(&self, points: &[State]) -> bool {
        self.n.is_some() && self.passes(points[0], SAME)
    }

    /// A key independent of the order of the catalogue: the bits of the first point.
    #[must_use]
    pub fn mark(&self) -> [u64; 2] {
        self.points.first().map_or([0; 2], |p| p.map(f64::to_bits))
    }

    /// Whether the other is this one's mirror image; `image` holds the images of its points.
    fn mirrors(&self, image: &[State], other: &Self, tolerance: f64) -> bool {
        if (self.kind, self.n, self.w) != (other.kind, other.n, -other.w) {
            return false;
        }
        if self.n.is_none() {
            return other.region.as_ref().is_none_or(|region| region.holds_most(image));
        }
        image.iter().all(|p| other.passes(*p, tolerance))
    }

    fn key(&self) -> (Kind, usize, i64, f64, f64) {
        let first = self.points.first().copied().unwrap_or([0.0; 2]);
        (self.kind, self.n.unwrap_or(0), self.w, first[0], first[1])
    }

    /// Its name from kind, period, turns, side and turn.
    #[must_use]
    pub fn plain_name(&self) -> String {
        let sign = |x: i64| if x < 0 { "-" } else { "+" };
        let mut name = self.pair_name();
        match self.n {
            Some(_) if self.w == 0 => {}
            Some(n) if !self.kind.is_rest() => name = format!("{} {n}:{:+}", self.word(), self.w),
            _ if matches!(self.kind, Kind::RotatingChaos | Kind::QuasiperiodicRotation) => {
                name = format!("{name} {}", sign(self.w));
            }
            _ => {}
        }
        if self.lean != 0 {
            name = format!("{name} ({})", sign(self.lean));
        }
        if self.turn != 0 { format!("{name} turn {:+}", self.turn) } else { name }
    }

    /// The name that it shares with its mirror image: without sense, side and turn.
    #[must_use]
    pub fn pair_name(&self) -> String {
        match self.n {
            Some(n) if !self.kind.is_rest() => format!("{} {n}:{}", self.word(), self.w.abs()),
            _ => self.word(),
        }
    }

    fn word(&self) -> String {
        self.kind.word().replace('_', " ")
    }
}

/// Mean angle of states.
fn mean_angle(states: &[State]) -> f64 {
    states.iter().map(|p| p[0]).sum::<f64>() / states.len().max(1) as f64
}

/// The angle of a rest: Newton's method leaves hanging and inverted rest at 1e-170; they are known
/// exactly.
fn balanced(theta: f64) -> f64 {
    match theta {
        hanging if hanging.abs() < EXACT => 0.0,
        inverted if (PI - inverted.abs()).abs() < EXACT => PI,
        _ => theta,
    }
}

/// The kind of a periodic orbit.
fn classify(pendulum: &Pendulum, orbit: &PeriodicOrbit) -> Kind {
    let [theta, velocity] = orbit.points[0];
    let still = orbit.n == 1 && orbit.w == 0 && velocity.abs() < 1e-9;
    // At a rest the torque balances gravity at every time: with drive only without torque.
    let known = [0.0, PI].contains(&balanced(theta));
    match (orbit.w, still && (pendulum.is_autonomous() || known)) {
        (0, true) if theta.cos() > 0.0 => Kind::Rest,
        (0, true) => Kind::InvertedRest,
        (0, false) => Kind::Oscillation,
        _ => Kind::Rotation,
    }
}

/// Sorts by key, pairs twins and names all.
///
/// Names are "rest", "rotation 1:+1", "oscillation 2:0"; of asymmetric twin oscillations the one
/// that leans to positive angles is "(+)"; on the line "turn +1" says around which multiple of a turn one
/// moves; if some share a name all the same, the angle of their
/// first point is added, to as many digits as tell them apart. No two names are the same.
///
/// Also returns the place that each of the given attractors has in the result.
#[must_use]
pub fn arrange(pendulum: &Pendulum, attractors: Vec<Attractor>) -> (Vec<Attractor>, Vec<usize>) {
    let mut keyed: Vec<(usize, Attractor)> = attractors.into_iter().enumerate().collect();
    keyed.sort_by(|(_, a), (_, b)| {
        let (x, y) = (a.key(), b.key());
        (x.0, x.1, x.2).cmp(&(y.0, y.1, y.2)).then(x.3.total_cmp(&y.3)).then(x.4.total_cmp(&y.4))
    });
    let mut place = vec![0; keyed.len()];
    for (to, (from, _)) in keyed.iter().enumerate() {
        place[*from] = to;
    }
    let mut sorted: Vec<Attractor> = keyed.into_iter().map(|(_, a)| a).collect();
    let mirror = Mirror::of(pendulum);
    let images: Vec<Vec<State>> = sorted
        .iter()
        .map(|a| {
            let image = |m: &Mirror| a.points.iter().map(|p| m.image(*p)).collect();
            mirror.as_ref().map_or_else(Vec::new, image)
        })
        .collect();
    let twin = |a: &Attractor, image: &[State]| {
        let tolerance = mirror.as_ref()?.tolerance();
        sorted.iter().position(|b| a.mirrors(image, b, tolerance))
    };
    let twins: Vec<Option<usize>> = sorted.iter().zip(&images).map(|(a, i)| twin(a, i)).collect();
    for (i, attractor) in sorted.iter_mut().enumerate() {
        // Twins lean to opposite sides, also where the image takes half a period.
        let own = mean_angle(&attractor.points);
        let lean = if images[i].is_empty() { own } else { own - mean_angle(&images[i]) };
        let swings = match attractor.n {
            Some(_) => attractor.w == 0 && !attractor.kind.is_rest(),
            None => attractor.kind == Kind::LibrationChaos,
        };
        let turn = if attractor.angle == Angle::Line { (own / TAU).round() } else { 0.0 };
        attractor.turn = turn as i64;
        if swings && attractor.turn == 0 && twins[i] != Some(i) {
            attractor.lean = if lean < 0.0 { -1 } else { 1 };
        }
        attractor.twin = twins[i];
    }
    let plain: Vec<String> = sorted.iter().map(Attractor::plain_name).collect();
    let names: Vec<String> = (0..sorted.len()).map(|i| unique(&sorted, &plain, i)).collect();
    for (attractor, name) in sorted.iter_mut().zip(names) {
        attractor.name = name;
    }
    (sorted, place)
}

/// The name of attractor `i`, with a suffix if others share its plain name.
fn unique(sorted: &[Attractor], plain: &[String], i: usize) -> String {
    let alike: Vec<usize> = (0..plain.len()).filter(|k| plain[*k] == plain[i]).collect();
    if alike.len() == 1 {
        return plain[i].clone();
    }
    let all = |digits: usize| -> Vec<String> {
        let theta = |k: &usize| sorted[*k].points.first().map_or(0.0, |p| p[0]);
        alike.iter().map(|k| format!("{} at {:+.digits$}", plain[*k], theta(k))).collect()
    };
    let own = alike.iter().position(|k| *k == i).unwrap_or(0);
    let differ =
        |names: &Vec<String>| names.iter().enumerate().all(|(k, name)| !names[..k].contains(name));
    match (4..=12).map(all).find(differ) {
        Some(names) => names[own].clone(),
        None => format!("{} ({})", plain[i], own + 1),
    }
}
