//! Exponential and logarithm over any [`Lane`].
//!
//! `exp x = 2^n exp r` with `r = x - n ln 2`, `|r| <= ln 2 / 2`, by its Taylor series of degree 13
//! (the next term is 4e-18); `ln x = k ln 2 + 2 artanh f` with `f = (m - 1)/(m + 1)` for a mantissa
//! `m` between `sqrt(1/2)` and `sqrt 2`, by its series of degree 21. Errors are a few units in the
//! last place.

use std::f64::consts::{LN_2, LOG2_E};

use super::real::Lane;

/// Adding it rounds to an integer, which then stands in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` to 33 bits, so that its product with an exponent is exact.
const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
/// The rest of `ln 2`.
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Beyond these the result is 0 or more than the largest number.
const RANGE: [f64; 2] = [-708.0, 709.0];
/// 1/k! from k = 2 on.
const FACTORIALS: [f64; 12] = [
    0.5,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5040.0,
    1.0 / 40320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];
/// Terms of the series of the logarithm.
const TERMS: usize = 10;

/// `exp x`, held to the range of normal numbers.
#[inline(always)]
pub fn exponential<L: Lane>(x: L) -> L {
    let x = x.max(x.like(RANGE[0])).min(x.like(RANGE[1]));
    let count = x.affine(LOG2_E, ROUND);
    let n = count - x.like(ROUND);
    let r = n.scale_add(-LN_2_LOW, n.scale_add(-LN_2_HIGH, x));
    let mut sum = x.like(FACTORIALS[11]);
    let mut i = 11;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(r, x.like(FACTORIALS[i]));
    }
    let sum = sum.mul_add(r * r, r) + x.like(1.0);
    sum.add_to_exponent(count)
}

/// `ln x` of a positive normal number.
#[inline(always)]
pub fn logarithm<L: Lane>(x: L) -> L {
    let (mantissa, exponent) = x.split();
    let one = x.like(1.0);
    let f = (mantissa - one) / (mantissa + one);
    let z = f * f;
    let mut sum = x.like(2.0 / (2 * TERMS + 1) as f64);
    let mut i = TERMS;
    while i > 1 {
        i -= 1;
        sum = sum.mul_add(z, x.like(2.0 / (2 * i + 1) as f64));
    }
    let small = (sum * z).mul_add(f, f.scale(2.0));
    exponent.scale_add(LN_2, small)
}
