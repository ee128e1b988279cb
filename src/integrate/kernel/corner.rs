//! Corners of the equation of motion, at which the switching function of an effect passes zero.
//!
//! Over a step its sign is held, so that the step is of order 8 however far the function goes to the
//! other side; a step in which it passes zero ends there, and the rest goes on with the other sign.
//! The equation is continuous across a corner: derivatives jump in nothing, and an error `e` in the
//! place of the corner is felt as `e^2`.

use crate::integrate::tangent::Tangent;
use crate::lanes::{Lane, Real};
use crate::model::Equation;
use crate::model::equation::Forcing;

/// The function may pass zero within a step if a straight line from either end does so in this part
/// of it: for a parabola that touches zero one end's line does so in less than half of it, for
/// cubics a little later.
pub const REACH: f64 = 0.4;

/// The equation over numbers that carry the derivatives of the switching function along the motion.
#[derive(Clone, Debug)]
pub struct Corner<L: Lane>(Box<Equation<Tangent<L, 2>>>, L);

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
    /// The corner of an equation, if it has one; `number` has the shape of all numbers.
    #[inline(always)]
    pub fn new(equation: &Equation<f64>, number: L) -> Option<Self> {
        let zero = number.like(0.0);
        let shape = Tangent { value: zero, slope: [zero; 2] };
        // No closure: it would lose the instruction set.
        if equation.has_corner() { Some(Self(Box::new(equation.map(shape)), zero)) } else { None }
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
    /// The side of the function, 1 or -1, or `held` if that is not 0.
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
