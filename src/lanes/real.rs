//! The arithmetic that the equation of motion is written over: one number, a bundle of lanes, or
//! either of them with its derivatives.

use std::ops::{Add, Mul, Neg, Sub};

use super::sine::{self, Degree};

/// A number as the model and the integrators see it.
///
/// `f64`, [`Fused`], [`super::pack::Bundle`] and [`crate::integrate::tangent::Tangent`] are such
/// numbers, so that the equation of motion and the Runge-Kutta-Nystrom step stand once.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
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
}

/// A [`Real`] without derivatives: it can be stored, compared and reduced modulo a turn.
pub trait Lane: Real {
    /// What an instruction set needs to make a value; a marker without size.
    type Token: Copy;
    /// Number of trajectories side by side.
    const WIDTH: usize;
    /// Whether [`Lane::mul_add`] rounds once.
    const FUSED: bool;

    /// The same constant in every lane.
    fn splat(token: Self::Token, value: f64) -> Self;
    /// The first [`Lane::WIDTH`] values of `source`.
    fn load(token: Self::Token, source: &[f64]) -> Self;
    /// Writes [`Lane::WIDTH`] values to the front of `target`.
    fn store(self, target: &mut [f64]);
    /// The constant `value`, in the shape of `self`.
    #[must_use]
    fn like(self, value: f64) -> Self;
    /// `self * a + b`, fused where the instruction set can.
    #[must_use]
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// The smaller of two values, lane by lane.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// Changes the sign in the lanes where the lowest bit of `count` is set.
    #[must_use]
    fn flip_where_odd(self, count: Self) -> Self;

    /// `cos(pi self)`, to the precision of `D`: the angle is in half turns.
    #[inline(always)]
    #[must_use]
    fn cosine<D: Degree>(self) -> Self {
        sine::cosine::<D, Self>(self)
    }
}

macro_rules! scalar_lane {
    ($type:ty, $get:expr, $make:expr, $fused:expr, $mul_add:expr) => {
        impl Real for $type {
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
        }

        impl Lane for $type {
            type Token = ();
            const WIDTH: usize = 1;
            const FUSED: bool = $fused;

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
            fn like(self, value: f64) -> Self {
                $make(value)
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                $make($mul_add($get(self), $get(a), $get(b)))
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if $get(self) < $get(other) { self } else { other }
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

/// One number whose products and sums round once: what a lane of an FMA instruction set does.
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

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

scalar_lane!(Fused, |x: Fused| x.0, Fused, true, f64::mul_add);
