//! Exponential and logarithm over any [`Lane`].
//!
//! `exp x = 2^n exp r` with `r = x - n ln 2`, `|r| <= ln 2 / 2`, by a polynomial of degree 11;
//! `ln x = k ln 2 + 2 artanh f` with `f = (m - 1)/(m + 1)` for a mantissa `m` between `sqrt(1/2)` and
//! `sqrt 2`, by an odd one of degree 15. Their coefficients interpolate at Chebyshev's points, which
//! takes two or three terms less than the Taylor series; their relative errors are 1.7e-17 and
//! 4.5e-18, so that those of the results are a few units in the last place.

use std::f64::consts::{LN_2, LOG2_E};

use super::real::Lane;

/// Adding it rounds to an integer, in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` to 33 bits, so that its product with an exponent is exact.
const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
/// The rest of `ln 2`.
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Bounds beyond which the result is 0 or exceeds the largest number.
const RANGE: [f64; 2] = [-708.0, 709.0];
/// `(exp r - 1 - r) / r^2`, in powers of `r`.
const EXPONENTIAL: [f64; 10] = [
    0.500_000_000_000_000_1,
    0.166_666_666_666_666_69,
    0.041_666_666_666_624_164,
    0.008_333_333_333_330_065,
    0.001_388_888_891_719_673_6,
    0.000_198_412_698_630_405_59,
    2.480_152_132_234_228e-5,
    2.755_726_848_028_971_6e-6,
    2.762_007_589_254_816_4e-7,
    2.510_037_584_222_37e-8,
];
/// `(2 artanh f - 2 f) / f^3`, in powers of `f^2`.
const LOGARITHM: [f64; 7] = [
    0.666_666_666_666_667,
    0.399_999_999_998_995_05,
    0.285_714_286_259_755_15,
    0.222_222_111_347_905_45,
    0.181_828_891_255_921,
    0.153_317_215_895_743_07,
    0.146_164_498_207_824_76,
];

/// `exp x`, held to the range of normal numbers.
#[inline(always)]
pub fn exponential<L: Lane>(x: L) -> L {
    let x = x.max(x.like(RANGE[0])).min(x.like(RANGE[1]));
    let count = x.affine(LOG2_E, ROUND);
    let n = count - x.like(ROUND);
    let r = n.scale_add(-LN_2_LOW, n.scale_add(-LN_2_HIGH, x));
    let mut sum = x.like(EXPONENTIAL[9]);
    let mut i = 9;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(r, x.like(EXPONENTIAL[i]));
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
    let mut sum = x.like(LOGARITHM[6]);
    let mut i = 6;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(z, x.like(LOGARITHM[i]));
    }
    let small = (sum * z).mul_add(f, f.scale(2.0));
    exponent.scale_add(LN_2, small)
}
