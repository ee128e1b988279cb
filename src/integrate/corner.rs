//! Corners of the equation of motion: where the switching function of an effect passes zero.
//!
//! Over a step its sign is held, so that the step is of order 8 however far the function goes to the
//! other side; a step in which it passes zero ends there, and the rest goes on with the other sign.
//! The equation is continuous across a corner: derivatives jump in nothing, and an error `e` in the
//! place of the corner is felt as `e^2`.

use super::course::Course;
use super::dense::Leap;
use super::tangent::{Number, Tangent};
use crate::lanes::{Lane, Real};
use crate::model::Equation;
use crate::model::equation::Forcing;

/// The function may pass zero within a step where a straight line from either end does so in this part
/// of it: a parabola that touches zero does so from one end in less than half of it, cubics a little
/// later.
pub const REACH: f64 = 0.4;
/// Parts of a step at which a single trajectory looks at it.
const LOOKS: usize = 16;
/// A parabola through three looks counts as touching zero below this part of their fall.
const MARGIN: f64 = 0.25;
/// Halvings and sections of a bracket.
const HALVINGS: usize = 60;
const SECTIONS: usize = 40;

/// The equation over numbers that carry the derivatives of the switching function along the motion.
#[derive(Clone, Debug)]
pub struct Corner<L: Lane>(Equation<Tangent<L, 2>>, L);

/// The drive at one time, with its rates.
pub type Moving<L> = Forcing<Tangent<L, 2>>;

/// The switching function at one state, and what its rate is made of.
#[derive(Clone, Copy, Debug)]
pub struct Switch<L> {
    /// Its value.
    pub value: L,
    drift: L,
    by_velocity: L,
}

impl<L: Lane> Corner<L> {
    /// Of an equation that has one; `number` is of the shape of the others.
    #[inline(always)]
    pub fn new(equation: &Equation<f64>, number: L) -> Option<Self> {
        let zero = number.like(0.0);
        let shape = Tangent { value: zero, slope: [zero; 2] };
        // No closure: it would lose the instruction set.
        if equation.has_corner() { Some(Self(equation.map(shape), zero)) } else { None }
    }

    /// The drive at time `tau`.
    #[inline(always)]
    pub fn forcing(&self, tau: L) -> Moving<L> {
        self.0.forcing(Tangent { value: tau, slope: [tau.like(1.0), self.1] })
    }

    /// The switching function of a state.
    #[inline(always)]
    pub fn at(&self, forcing: &Moving<L>, theta: L, velocity: L) -> Switch<L> {
        let (zero, one) = (self.1, self.1.like(1.0));
        let theta = Tangent { value: theta, slope: [velocity, zero] };
        let velocity = Tangent { value: velocity, slope: [zero, one] };
        let sign = theta.like(1.0);
        let at = self.0.point_held(forcing, theta, velocity, [sign; 2]);
        let found = match self.0.switch(&at) {
            Some(found) => found,
            None => sign,
        };
        Switch { value: found.value, drift: found.slope[0], by_velocity: found.slope[1] }
    }
}

impl<L: Lane> Switch<L> {
    /// The side on which it is, 1 or -1, or `held` where that is not 0.
    #[inline(always)]
    pub fn side(&self, held: L) -> L {
        held.scale_add(f64::MAX, self.value).sign()
    }

    /// Its rate under this acceleration.
    #[inline(always)]
    pub fn rate(&self, acceleration: L) -> L {
        self.by_velocity.mul_add(acceleration, self.drift)
    }
}

/// The lanes in which a function may pass zero from `side`, by its values and rates at both ends of a
/// step.
#[inline(always)]
pub fn passages<L: Lane>(side: L, values: [L; 2], rates: [L; 2], length: L) -> u128 {
    let reach = (length * side).scale(REACH);
    let near = rates[0].mul_add(reach, values[0] * side);
    let far = values[1] * side;
    far.signs() | near.signs() | (far - rates[1] * reach).signs()
}

/// The length of the step to the first corner within `leap`; none where there is none. `since` says
/// that the leap starts from one. Derivatives are left out.
pub fn first<N: Number>(course: &Course<N>, leap: &Leap<N>, since: bool) -> Option<f64> {
    let (field, mut step) = (course.plain(), leap.values());
    let (start, side, length) = (leap.tau, leap.signs[1], leap.length);
    let curve = step.curve(field);
    let value = |part: f64| {
        let tau = start + part * length;
        side * course.switch(tau, curve.at(tau))
    };
    let part = first_below_zero(&value, since)?;
    // What the curve is off, once.
    step.shorten(field, part * length);
    let rest = side * course.switch(start + part * length, step.end);
    let by = 1e-3_f64.min(0.5 * part);
    let slope = (value(part + by) - value(part - by)) / (2.0 * by);
    let next = part - rest / slope;
    let better = (next - part).abs() < by && next < 1.0;
    Some(if better { next } else { part } * length)
}

/// The first part of a step from which on the function is negative. Where it starts `since` a zero,
/// that one does not count.
fn first_below_zero(value: &impl Fn(f64) -> f64, since: bool) -> Option<f64> {
    let place = |k: usize| k as f64 / LOOKS as f64;
    let all: [f64; LOOKS + 1] = std::array::from_fn(|k| value(place(k)));
    for k in 1..=LOOKS {
        if all[k] < 0.0 {
            let mut low = place(k - 1);
            if k == 1 && (since || all[0] <= 0.0) {
                // It rises from the zero first, or not at all.
                low = lowest(&|x| -value(x), [0.0, place(1)], true);
                if value(low) <= 0.0 {
                    return Some(0.0);
                }
            }
            return Some(passage(value, low, place(k)));
        }
        let [before, here, after] = [all[k - 1], all[k], all[(k + 1).min(LOOKS)]];
        let hollow =
            if k == LOOKS || (k == 1 && since) { false } else { here <= before && here <= after };
        if hollow && here < MARGIN * (before.max(after) - here) + f64::MIN_POSITIVE {
            let at = lowest(value, [place(k - 1), place(k + 1)], false);
            if value(at) < 0.0 {
                return Some(passage(value, place(k - 1), at));
            }
        }
    }
    None
}

/// Where the function is least between two parts, by the golden section; with `any` wherever it is
/// found negative first.
fn lowest(value: &impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2], any: bool) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = inner.map(value);
    for _ in 0..SECTIONS {
        if any && values[0].min(values[1]) < 0.0 {
            break;
        }
        if values[0] < values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [value(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], value(inner[1])];
        }
    }
    if values[0] < values[1] { inner[0] } else { inner[1] }
}

/// Where it passes from above to below zero.
fn passage(value: &impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if value(middle) < 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}
