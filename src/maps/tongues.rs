//! Critical amplitudes at which hanging or inverted rest loses or gains stability, by Floquet
//! theory.
//!
//! The derivative `M` of the stroboscopic map at rest is the monodromy matrix of the linearised
//! equation, eq. 1.3 with damping, with the opposite sign of gravity upright. Rest changes where a multiplier passes +1,
//! `1 - tr M + det M = 0`, or -1, `1 + tr M + det M = 0`. As `p` stands in the linear equation linearly,
//! `M` is an entire function of it: its Chebyshev series on an interval soon says all about it.
//!
//! Under a constant torque rest is a periodic orbit; `continued` follows it.
//!
//! Without damping the two boundaries of a narrow tongue are nearly a double zero of that. The drive is
//! even in time then, so that `m11 = m22` and, on a boundary, `m12 m21 = m11^2 - 1 = 0`: one is a
//! simple zero of `m12`, the other of `m21`, however narrow the tongue (Magnus & Winkler 1966, Hill's
//! equation, section 1.1).

use std::f64::consts::PI;

use rayon::prelude::*;

use super::chebyshev::{Interpolant, Values};
use super::continuation;
use super::control::{Control, pool};
use super::kinked_tongues;
use crate::error::Error;
use crate::model::Pendulum;
use crate::orbit::fold::{Fold, fold_of_onset};
use crate::orbit::kink::QUICK;
use crate::orbit::{KinkedRest, PoincareMap};

/// Largest `p` of a request, in squares of the lowest frequency: at it solutions grow over a period by about
/// the exponential of 560, and twice that is beyond the range of numbers.
const MOST_P: f64 = 5e4;
/// Over a part of the range of `p` solutions grow at most by the exponential of about this.
const GROWTH: f64 = 8.0;
/// Relative difference below which entries, or products of multipliers, are equal.
const ALIKE: f64 = 1e-9;
/// Largest load on the pendulum at rest that is rounding.
const NO_LOAD: f64 = 1e-13;
/// Number of times in a period at which the load is sampled.
const TIMES: usize = 16;

/// The two angles at which gravity has no torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Balance {
    /// Angle 0.
    Hanging,
    /// Angle pi.
    Inverted,
}

impl Balance {
    /// Its angle.
    #[must_use]
    pub fn angle(self) -> f64 {
        if self == Self::Hanging { 0.0 } else { PI }
    }
}

/// A critical amplitude. Under a torque the orbit that continues rest ceases where its
/// multiplier is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Critical {
    /// Amplitude of the drive.
    pub p: f64,
    /// The critical multiplier: 1 or -1.
    pub multiplier: f64,
    /// Whether rest is stable just below, and just above.
    pub stable: [bool; 2],
}

/// Critical amplitudes at one frequency.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Frequency of the drive.
    pub omega: f64,
    /// In order of `p`.
    pub critical: Vec<Critical>,
    /// Whether rest is stable between `p = 0` and the first of them.
    pub stable_at_first: bool,
    /// Where the oscillation that is born at the first loss of stability turns back: below that `p`
    /// it is not. `None` where it is born toward larger `p`, and under a torque.
    pub fold: Option<Fold>,
}

impl Curve {
    /// The intervals of stable rest.
    pub(super) fn stable_intervals(&self, p_max: f64) -> Vec<[f64; 2]> {
        let inner = self.critical.iter().map(|c| c.p);
        let ends: Vec<f64> = [0.0].into_iter().chain(inner).chain([p_max]).collect();
        let above = self.critical.iter().map(|c| c.stable[1]);
        let stable = [self.stable_at_first].into_iter().chain(above);
        let of_both = ends.windows(2).zip(stable).filter(|(_, yes)| *yes);
        of_both.map(|(both, _)| [both[0], both[1]]).collect()
    }
}

/// A function of the monodromy matrix and its product that vanishes at critical amplitudes.
type Vanishing = fn(Values<5>) -> f64;

/// All critical amplitudes of a balance up to `p_max` at each of the frequencies, with `folds` of
/// oscillations of hanging rest if asked for.
///
/// # Errors
/// [`Error::Range`] for a `p_max` or frequency out of range, [`Error::NotMappable`] for effects that no
/// map can have, [`Error::NoRest`] where rest is no solution, or friction holds it,
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn tongues(
    pendulum: &Pendulum,
    balance: Balance,
    omegas: &[f64],
    p_max: f64,
    folds: bool,
    threads: usize,
    control: &Control,
) -> Result<Vec<Curve>, Error> {
    if let Some(value) = omegas.iter().find(|w| !(w.is_finite() && **w > 0.0)) {
        return Err(Error::Range { name: "omega", value: *value, allowed: "a number above 0" });
    }
    let lowest = omegas.iter().copied().fold(f64::INFINITY, f64::min);
    if !(p_max > 0.0 && p_max <= MOST_P * lowest * lowest && p_max.is_finite()) {
        let allowed = "above 0, up to 50000 times the square of the lowest omega";
        return Err(Error::Range { name: "p_max", value: p_max, allowed });
    }
    let mut level = pendulum.clone();
    level.torque = 0.0;
    check(&level, balance, omegas, p_max)?;
    control.begin(omegas.len());
    pool(threads)?.install(|| {
        let one = |omega: &f64| {
            control.check()?;
            let moved = pendulum.torque != 0.0;
            let mut curve = along(&level, balance, *omega, p_max, folds && !moved);
            if moved {
                curve = continuation::curve(pendulum, balance, &curve, p_max);
            }
            control.add(1);
            Ok(curve)
        };
        omegas.par_iter().map(one).collect()
    })
}

/// This pendulum with another drive.
pub(super) fn under(pendulum: &Pendulum, p: f64, omega: f64) -> Pendulum {
    let mut other = pendulum.clone();
    (other.drive.p, other.drive.omega, other.drive.phase) = (p, omega, 0.0);
    other
}

/// Whether rest is a solution with all these drives, and not held by friction.
fn check(pendulum: &Pendulum, balance: Balance, omegas: &[f64], p_max: f64) -> Result<(), Error> {
    pendulum.check_mappable()?;
    if pendulum.has_friction() {
        let why = "friction holds it whatever the drive, and rest never loses its stability: take theta_r = 0 \
                   and no effect that rubs";
        return Err(Error::NoRest { why });
    }
    for omega in omegas {
        let driven = under(pendulum, p_max, *omega);
        let loaded = (0..TIMES).any(|k| {
            let tau = driven.period() * k as f64 / TIMES as f64;
            driven.acceleration(tau, balance.angle(), 0.0).abs() > NO_LOAD
        });
        if loaded {
            let why =
                "a sideways drive or an effect moves it, and eq. 1.3 is not its linear equation";
            return Err(Error::NoRest { why });
        }
    }
    Ok(())
}

/// Entries of the monodromy matrix by rows, and its determinant; at a kink those of a diagonal matrix with its
/// multipliers, whose sum is real.
fn monodromy(pendulum: &Pendulum, balance: Balance, p: f64, omega: f64) -> Values<5> {
    // Without drive the period is arbitrary: so small a drive changes nothing.
    let driven = under(pendulum, p.max(f64::MIN_POSITIVE), omega);
    if let Some(rest) = KinkedRest::of(&driven, balance.angle()) {
        let [a, b] = rest.multipliers(QUICK).0;
        let half = 0.5 * (a + b).re;
        return [half, 0.0, 0.0, half, (a * b).re];
    }
    let map = PoincareMap::new(&driven);
    let image = map.once([balance.angle(), 0.0]);
    let m = image.derivative;
    let product = image.product.unwrap_or(m.determinant());
    [m[(0, 0)], m[(0, 1)], m[(1, 0)], m[(1, 1)], product]
}

/// `1 - m tr M + det M`: zero where `m`, 1 or -1, is a multiplier.
pub(super) fn gap(multiplier: f64, [a, _, _, d, product]: Values<5>) -> f64 {
    1.0 - multiplier * (a + d) + product
}

pub(super) fn is_stable(m: Values<5>) -> bool {
    let within = gap(1.0, m) > 0.0 && gap(-1.0, m) > 0.0;
    within && m[4] < 1.0 + ALIKE
}

fn along(pendulum: &Pendulum, balance: Balance, omega: f64, p_max: f64, folds: bool) -> Curve {
    let at = |p: f64| monodromy(pendulum, balance, p, omega);
    // Solutions grow by about the exponential of the period times the root of p.
    let period = std::f64::consts::TAU / omega;
    let parts = (0.4 * period * p_max.sqrt() / GROWTH).ceil().max(1.0) as usize;
    let end = |i: usize| p_max * (i as f64 / parts as f64).powi(2);
    if KinkedRest::of(&under(pendulum, p_max, omega), balance.angle()).is_some() {
        let (critical, stable_at_first) = kinked_tongues::critical(parts, p_max, at);
        return Curve { omega, critical, stable_at_first, fold: None };
    }
    let mut critical: Vec<(f64, f64)> = Vec::new();
    let mut panels = Vec::new();
    for i in 0..parts {
        let panel = Interpolant::of(end(i), end(i + 1), at);
        let begin: Values<5> = std::array::from_fn(|k| panel.value(k, end(i)));
        let even = (begin[0] - begin[3]).abs() < ALIKE * (1.0 + begin[0].abs())
            && (begin[4] - 1.0).abs() < ALIKE;
        let functions: [(f64, Vanishing); 2] = if even {
            [(0.0, |m| m[1]), (0.0, |m| m[2])]
        } else {
            [(1.0, |m| gap(1.0, m)), (-1.0, |m| gap(-1.0, m))]
        };
        for (multiplier, function) in functions {
            for zero in panel.zeros(function) {
                let p = corrected(&panel, zero, function, at);
                let sign = if even { panel.value(0, zero).signum() } else { multiplier };
                critical.push((p.clamp(0.0, p_max), sign));
            }
        }
        panels.push((end(i + 1), panel));
    }
    let stable = |p: f64| {
        let panel = panels.iter().find(|(end, _)| p <= *end).map_or(&panels[0].1, |(_, one)| one);
        is_stable(std::array::from_fn(|k| panel.value(k, p)))
    };
    let (critical, stable_at_first) = bordered(critical, p_max, stable);
    let onset = critical.iter().find(|c| c.stable == [true, false]);
    let mirrored = pendulum.is_mirror_symmetric();
    let fold = onset
        .filter(|c| {
            folds && balance == Balance::Hanging && c.p > 0.0 && (mirrored || c.multiplier > 0.0)
        })
        .and_then(|c| fold_of_onset(&under(pendulum, c.p, omega), c.multiplier));
    Curve { omega, critical, stable_at_first, fold }
}

/// Critical amplitudes in order, each with the stability on both sides, and that before the first; `stable`
/// tells it between two of them.
pub(super) fn bordered(
    mut critical: Vec<(f64, f64)>,
    p_max: f64,
    stable: impl Fn(f64) -> bool,
) -> (Vec<Critical>, bool) {
    critical.sort_by(|a, b| a.0.total_cmp(&b.0));
    let inner = critical.iter().map(|c| c.0);
    let ends: Vec<f64> = [0.0].into_iter().chain(inner).chain([p_max]).collect();
    let between: Vec<bool> =
        ends.windows(2).map(|both| stable(0.5 * (both[0] + both[1]))).collect();
    let with_sides = |((p, multiplier), both): (&(f64, f64), &[bool])| Critical {
        p: *p,
        multiplier: *multiplier,
        stable: [both[0], both[1]],
    };
    (critical.iter().zip(between.windows(2)).map(with_sides).collect(), between[0])
}

/// A zero of the interpolant, corrected by one step of Newton's method on the function itself.
fn corrected(
    panel: &Interpolant<5>,
    zero: f64,
    function: fn(Values<5>) -> f64,
    at: impl Fn(f64) -> Values<5>,
) -> f64 {
    let width = 1e-5 * zero.max(1e-3);
    let side = |by: f64| function(std::array::from_fn(|k| panel.value(k, zero + by)));
    let slope = (side(width) - side(-width)) / (2.0 * width);
    let step = function(at(zero)) / slope;
    // At a tip the slope vanishes, and no correction is possible.
    if step.abs() < width { zero - step } else { zero }
}
