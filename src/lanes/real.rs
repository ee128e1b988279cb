//! The arithmetic of the equation of motion: over one number, a bundle of lanes, or either of them
//! with derivatives.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::elementary;
use super::sine::{self, Degree};

/// The number type of the model and the integrators.
///
/// `f64`, [`Fused`], [`super::pack::Bundle`] and [`crate::integrate::tangent::Tangent`] implement
/// it, so that the equation of motion and the Runge-Kutta-Nystrom step are written once.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The constant `value`, in the shape of `self`.
    #[must_use]
    fn like(self, value: f64) -> Self;
    /// `self * a + b`, fused where the instruction set can.
    #[must_use]
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// `self * factor + addend`, fused where the instruction set can.
    #[must_use]
    fn scale_add(self, factor: f64, addend: Self) -> Self;
    /// `self * factor + addend` with a constant addend.
    #[must_use]
    fn affine(self, factor: f64, addend: f64) -> Self;
    /// `self * factor`.
    #[must_use]
    fn scale(self, factor: f64) -> Self;
    /// `sin(pi self)`, to the precision of `D`: the angle is in half turns.
    #[must_use]
    fn sine<D: Degree>(self) -> Self;
    /// `cos(pi self)`, to the precision of `D`: the angle is in half turns.
    #[must_use]
    fn cosine<D: Degree>(self) -> Self;
    /// An angle in half turns less its whole turns, in [-1, 1].
    #[must_use]
    fn wrapped(self) -> Self;
    /// `exp self`, held to the range of normal numbers.
    #[must_use]
    fn exponential(self) -> Self;
    /// `ln self` of a positive normal number.
    #[must_use]
    fn logarithm(self) -> Self;
    /// The square root.
    #[must_use]
    fn root(self) -> Self;
    /// Does `work` in its own function, compiled for the instruction set of these numbers.
    fn aside<W: Work>(self, work: W);
    /// 1 or -1, the sign of `self`; no derivative.
    #[must_use]
    fn sign(self) -> Self;
}

/// Work called at several places that is compiled once, separately from them.
pub trait Work {
    /// The work; mark the implementation `#[inline(always)]`, and all that it calls.
    fn run(self);
}

/// A [`Real`] without derivatives: it can be stored, compared and reduced modulo a turn.
pub trait Lane: Real {
    /// The token of the instruction set that creates values; zero-sized.
    type Token: Copy;
    /// Number of trajectories side by side.
    const WIDTH: usize;
    /// Whether [`Real::mul_add`] rounds once.
    const FUSED: bool;

    /// Does `work` in its own function, compiled for the instruction set of these lanes.
    fn apart<W: Work>(token: Self::Token, work: W);
    /// A constant in every lane.
    fn splat(token: Self::Token, value: f64) -> Self;
    /// The first [`Lane::WIDTH`] values of `source`.
    fn load(token: Self::Token, source: &[f64]) -> Self;
    /// Writes [`Lane::WIDTH`] values to the front of `target`.
    fn store(self, target: &mut [f64]);
    /// The first lane.
    fn first(self) -> f64;
    /// The smaller of two values, lane by lane.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// The larger of two values, lane by lane.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// The magnitude of `self` with the sign of `other`.
    #[must_use]
    fn with_sign_of(self, other: Self) -> Self;
    /// A bit for each lane whose sign bit is set, the first lane's lowest.
    #[must_use]
    fn signs(self) -> u128;
    /// `self` times two to the integer that adding `1.5 * 2^52` has left in the bits of `count`.
    #[must_use]
    fn add_to_exponent(self, count: Self) -> Self;
    /// A positive normal number as a mantissa between `sqrt(1/2)` and `sqrt 2` and an exponent of 2.
    #[must_use]
    fn split(self) -> (Self, Self);
    /// Changes the sign in the lanes where the lowest bit of `count` is set.
    #[must_use]
    fn flip_where_odd(self, count: Self) -> Self;
}

/// Bits of `sqrt(1/2)` less those of 1, so that an exponent counts from 0 at the square root.
pub(super) const ROOT_BITS: u64 = 0x3fe6_a09e_667f_3bcd_u64.wrapping_sub(1023 << 52);
/// Sign and exponent of a number.
pub(super) const EXPONENT_BITS: u64 = 0xfff << 52;
/// Bits of `2^52`: an integer or-ed into them is that number plus `2^52`.
pub(super) const INTEGER_BITS: u64 = 0x433 << 52;
/// `2^52`, and the exponent's offset.
pub(super) const INTEGER_OFFSET: f64 = 4_503_599_627_370_496.0 + 1023.0;

macro_rules! scalar_lane {
    ($type:ty, $get:expr, $make:expr, $fused:expr, $mul_add:expr) => {
        impl Real for $type {
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                $make($mul_add($get(self), $get(a), $get(b)))
            }
            #[inline(always)]
            fn scale_add(self, factor: f64, addend: Self) -> Self {
                $make($mul_add($get(self), factor, $get(addend)))
            }
            #[inline(always)]
            fn affine(self, factor: f64, addend: f64) -> Self {
                $make($mul_add($get(self), factor, addend))
            }
            #[inline(always)]
            fn scale(self, factor: f64) -> Self {
                $make($get(self) * factor)
            }
            #[inline(always)]
            fn sine<D: Degree>(self) -> Self {
                sine::sine::<D, Self>(self)
            }
            #[inline(always)]
            fn cosine<D: Degree>(self) -> Self {
                sine::cosine::<D, Self>(self)
            }
            #[inline(always)]
            fn wrapped(self) -> Self {
                sine::wrap(self, 0.5).0
            }
            #[inline(always)]
            fn exponential(self) -> Self {
                elementary::exponential(self)
            }
            #[inline(always)]
            fn logarithm(self) -> Self {
                elementary::logarithm(self)
            }
            #[inline(always)]
            fn root(self) -> Self {
                $make($get(self).sqrt())
            }
            #[inline(always)]
            fn aside<W: Work>(self, work: W) {
                <Self as Lane>::apart((), work);
            }
            #[inline(always)]
            fn sign(self) -> Self {
                $make(1_f64.copysign($get(self)))
            }
            #[inline(always)]
            fn like(self, value: f64) -> Self {
                $make(value)
            }
        }

        impl Lane for $type {
            type Token = ();
            const WIDTH: usize = 1;
            const FUSED: bool = $fused;

            #[inline(always)]
            fn apart<W: Work>((): (), work: W) {
                // A single number has no instruction set: inlined, it uses its caller's.
                work.run();
            }
            #[inline(always)]
            fn splat((): (), value: f64) -> Self {
                $make(value)
            }
            #[inline(always)]
            fn load((): (), source: &[f64]) -> Self {
                $make(source[0])
            }
            #[inline(always)]
            fn store(self, target: &mut [f64]) {
                target[0] = $get(self);
            }
            #[inline(always)]
            fn first(self) -> f64 {
                $get(self)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if $get(self) < $get(other) { self } else { other }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if $get(self) > $get(other) { self } else { other }
            }
            #[inline(always)]
            fn with_sign_of(self, other: Self) -> Self {
                $make($get(self).copysign($get(other)))
            }
            #[inline(always)]
            fn signs(self) -> u128 {
                u128::from($get(self).to_bits() >> 63)
            }
            #[inline(always)]
            fn add_to_exponent(self, count: Self) -> Self {
                let shifted = $get(count).to_bits() << 52;
                $make(f64::from_bits($get(self).to_bits().wrapping_add(shifted)))
            }
            #[inline(always)]
            fn split(self) -> (Self, Self) {
                let bits = $get(self).to_bits();
                let part = bits.wrapping_sub(ROOT_BITS) & EXPONENT_BITS;
                let mantissa = bits.wrapping_sub(part).wrapping_add(1023 << 52);
                let exponent = f64::from_bits((part >> 52) | INTEGER_BITS) - INTEGER_OFFSET;
                ($make(f64::from_bits(mantissa)), $make(exponent))
            }
            #[inline(always)]
            fn flip_where_odd(self, count: Self) -> Self {
                $make(f64::from_bits($get(self).to_bits() ^ ($get(count).to_bits() << 63)))
            }
        }
    };
}

#[inline(always)]
fn multiply_then_add(x: f64, a: f64, b: f64) -> f64 {
    x * a + b
}

scalar_lane!(f64, |x: f64| x, |x: f64| x, false, multiply_then_add);

/// One number whose products and sums round once, as in a lane of an FMA instruction set.
///
/// Use it only inside [`super::dispatch`], where the compiler knows the instruction; elsewhere each
/// product is a call into the C library.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fused(pub f64);

impl Add for Fused {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Fused {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Fused {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Div for Fused {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
}

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

scalar_lane!(Fused, |x: Fused| x.0, Fused, true, f64::mul_add);
