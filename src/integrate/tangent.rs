//! Numbers with derivatives: the variational equations from the equation of motion itself.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::lanes::sine::{Degree, both};
use crate::lanes::{Lane, MAX_WIDTH, Real, Work, each};

/// Least root by which a derivative is divided: at 0 it is steep, but finite.
const LEAST_ROOT: f64 = 1e-150;

/// A value and its derivatives in `N` directions.
#[derive(Clone, Copy, Debug)]
pub struct Tangent<L, const N: usize> {
    /// The value.
    pub value: L,
    /// Its derivative in each direction.
    pub slope: [L; N],
}

// No closures: one that the compiler does not inline would lose the
// instruction set that the caller was compiled for.

impl<L: Lane, const N: usize> Add for Tangent<L, N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        each!(i in N => self.slope[i] = self.slope[i] + other.slope[i]);
        self.value = self.value + other.value;
        self
    }
}

impl<L: Lane, const N: usize> Sub for Tangent<L, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        each!(i in N => self.slope[i] = self.slope[i] - other.slope[i]);
        self.value = self.value - other.value;
        self
    }
}

impl<L: Lane, const N: usize> Mul for Tangent<L, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        each!(i in N => self.slope[i] = self.slope[i].mul_add(other.value, other.slope[i] * self.value));
        self.value = self.value * other.value;
        self
    }
}

impl<L: Lane, const N: usize> Div for Tangent<L, N> {
    type Output = Self;
    #[inline(always)]
    fn div(mut self, other: Self) -> Self {
        // d(a/b) = (da - (a/b) db)/b.
        self.value = self.value / other.value;
        each!(i in N => self.slope[i] = (self.slope[i] - self.value * other.slope[i]) / other.value);
        self
    }
}

impl<L: Lane, const N: usize> Neg for Tangent<L, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        each!(i in N => self.slope[i] = -self.slope[i]);
        self.value = -self.value;
        self
    }
}

impl<L: Lane, const N: usize> Real for Tangent<L, N> {
    #[inline(always)]
    fn mul_add(mut self, a: Self, b: Self) -> Self {
        each!(i in N => {
            let rest = self.value.mul_add(a.slope[i], b.slope[i]);
            self.slope[i] = self.slope[i].mul_add(a.value, rest);
        });
        self.value = self.value.mul_add(a.value, b.value);
        self
    }

    #[inline(always)]
    fn scale_add(mut self, factor: f64, addend: Self) -> Self {
        each!(i in N => self.slope[i] = self.slope[i].scale_add(factor, addend.slope[i]));
        self.value = self.value.scale_add(factor, addend.value);
        self
    }

    #[inline(always)]
    fn affine(mut self, factor: f64, addend: f64) -> Self {
        each!(i in N => self.slope[i] = self.slope[i].scale(factor));
        self.value = self.value.affine(factor, addend);
        self
    }

    #[inline(always)]
    fn scale(mut self, factor: f64) -> Self {
        each!(i in N => self.slope[i] = self.slope[i].scale(factor));
        self.value = self.value.scale(factor);
        self
    }

    #[inline(always)]
    fn sine<D: Degree>(mut self) -> Self {
        // d sin(pi x) = pi cos(pi x) dx.
        let (sine, cosine) = both::<D, L>(self.value);
        let slope_of_sine = cosine.scale(std::f64::consts::PI);
        each!(i in N => self.slope[i] = self.slope[i] * slope_of_sine);
        self.value = sine;
        self
    }

    #[inline(always)]
    fn cosine<D: Degree>(mut self) -> Self {
        let slope_of_cosine = self.value.sine::<D>().scale(-std::f64::consts::PI);
        each!(i in N => self.slope[i] = self.slope[i] * slope_of_cosine);
        self.value = self.value.cosine::<D>();
        self
    }

    #[inline(always)]
    fn wrapped(mut self) -> Self {
        self.value = self.value.wrapped();
        self
    }

    #[inline(always)]
    fn exponential(mut self) -> Self {
        self.value = self.value.exponential();
        each!(i in N => self.slope[i] = self.slope[i] * self.value);
        self
    }

    #[inline(always)]
    fn logarithm(mut self) -> Self {
        each!(i in N => self.slope[i] = self.slope[i] / self.value);
        self.value = self.value.logarithm();
        self
    }

    #[inline(always)]
    fn root(mut self) -> Self {
        self.value = self.value.root();
        let double = self.value.max(self.value.like(LEAST_ROOT)).scale(2.0);
        each!(i in N => self.slope[i] = self.slope[i] / double);
        self
    }

    #[inline(always)]
    fn aside<W: Work>(self, work: W) {
        self.value.aside(work);
    }

    #[inline(always)]
    fn sign(self) -> Self {
        Self { value: self.value.sign(), slope: [self.value.like(0.0); N] }
    }

    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self { value: self.value.like(value), slope: [self.value.like(0.0); N] }
    }
}

/// A single number whose value steers an integrator: with derivatives, or without.
///
/// Lanes of such a number have one value, and each lane of a slope is another direction: one trajectory
/// whose derivatives fill a register.
pub trait Number: Real {
    /// The value alone.
    fn value(self) -> f64;
    /// Another value; every derivative times `factor`.
    #[must_use]
    fn reset(self, value: f64, factor: f64) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }

    #[inline(always)]
    fn reset(self, value: f64, _: f64) -> Self {
        value
    }
}

impl<L: Lane, const N: usize> Number for Tangent<L, N> {
    #[inline(always)]
    fn value(self) -> f64 {
        self.value.first()
    }

    #[inline(always)]
    fn reset(mut self, value: f64, factor: f64) -> Self {
        each!(i in N => self.slope[i] = self.slope[i].scale(factor));
        Self { value: self.value.like(value), slope: self.slope }
    }
}

impl<L: Lane, const N: usize> Tangent<L, N> {
    /// The variable `value` whose derivative in one direction is 1, the lanes of the first slope being
    /// the first directions; a constant where there is no such direction.
    #[must_use]
    pub fn along(token: L::Token, value: f64, direction: usize) -> Self {
        let mut unit = [0.0; MAX_WIDTH];
        unit[direction % L::WIDTH] = 1.0;
        let mut slope = [L::splat(token, 0.0); N];
        if let Some(entry) = slope.get_mut(direction / L::WIDTH) {
            *entry = L::load(token, &unit);
        }
        Self { value: L::splat(token, value), slope }
    }

    /// Writes its derivatives, in whole registers and as many of them as `into` holds.
    #[inline(always)]
    pub fn slopes(&self, into: &mut [f64]) {
        for (slope, lanes) in self.slope.iter().zip(into.chunks_exact_mut(L::WIDTH)) {
            slope.store(lanes);
        }
    }
}

impl<const N: usize> Tangent<f64, N> {
    /// [`Tangent::along`] of numbers that are no lanes.
    #[must_use]
    pub fn seeded(value: f64, column: usize) -> Self {
        Self::along((), value, column)
    }

    /// The constant `value`.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self { value, slope: [0.0; N] }
    }
}
