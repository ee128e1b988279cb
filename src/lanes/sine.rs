//! Sine, cosine and the reduction of an angle modulo a turn, over any [`Lane`].
//!
//! The angle is reduced to `x = k pi + r`, `|r| <= pi/2`, by adding and subtracting 1.5 * 2^52,
//! which rounds `x / pi` to the integer `k` and leaves its parity in the lowest bit. Then
//! `sin x = (-1)^k (r + r^3 P(r^2))`, where `P` minimises the largest absolute error (Remez
//! exchange in 60 digits with the first coefficient held at 1). Every operation is odd in `x`, so
//! `sine(-x) = -sine(x)` bit for bit.

use std::f64::consts::FRAC_1_PI;

use super::real::Lane;

/// How good a sine has to be: the coefficients of `P`, lowest power first.
pub trait Degree: Copy {
    /// Number of coefficients.
    const COUNT: usize;
    /// Coefficients of `P`; entries from [`Degree::COUNT`] on are unused.
    const P: [f64; 7];
    /// Largest absolute error of the polynomial.
    const ERROR: f64;
}

/// Degree 15, absolute error 1.1e-16 and rounding.
#[derive(Clone, Copy, Debug)]
pub struct Fine;

impl Degree for Fine {
    const COUNT: usize = 7;
    const P: [f64; 7] = [
        -0.1666666666666581,
        0.00833333333326288,
        -0.0001984126982009422,
        2.7557316077009097e-06,
        -2.5051851497090662e-08,
        1.6047301198896088e-10,
        -7.364646474891763e-13,
    ];
    const ERROR: f64 = 1.2e-16;
}

/// Degree 11, absolute error 1.8e-11: enough for step errors above 1e-8, and quicker.
#[derive(Clone, Copy, Debug)]
pub struct Coarse;

impl Degree for Coarse {
    const COUNT: usize = 5;
    const P: [f64; 7] = [
        -0.16666666606467134,
        0.008333330495676392,
        -0.00019840804039772254,
        2.7522618881191256e-06,
        -2.384669445332355e-08,
        0.0,
        0.0,
    ];
    const ERROR: f64 = 1.8e-11;
}

/// Adding it rounds to an integer, whose parity is then the lowest bit of the sum.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// pi, and what its double lacks.
const PI_FUSED: [f64; 2] = [std::f64::consts::PI, 1.2246467991473532e-16];
/// pi in parts of 33 bits: `k` times the first two is exact for `|k| < 2^20`.
const PI_SPLIT: [f64; 3] = [3.1415926534682512, 1.2154201012607932e-10, 4.044532497591901e-21];

/// `x - k pi` for a whole or half number `k`, to half a unit in the last place of `x`.
///
/// Fused, `k pi` with the double nearest to pi is off by `x 3.9e-17`, less than the rounding of `x`
/// itself, so that one operation serves.
#[inline(always)]
fn reduce<L: Lane>(x: L, k: L) -> L {
    if L::FUSED { k.scale_add(-PI_FUSED[0], x) } else { minus_half_turns(x, k) }
}

/// `x - k pi` for a whole or half number `k`.
#[inline(always)]
fn minus_half_turns<L: Lane>(x: L, k: L) -> L {
    if L::FUSED {
        k.scale_add(-PI_FUSED[1], k.scale_add(-PI_FUSED[0], x))
    } else {
        k.scale_add(-PI_SPLIT[2], k.scale_add(-PI_SPLIT[1], k.scale_add(-PI_SPLIT[0], x)))
    }
}

#[inline(always)]
fn polynomial<D: Degree, L: Lane>(r: L) -> L {
    let z = r * r;
    let mut sum = z.affine(D::P[D::COUNT - 1], D::P[D::COUNT - 2]);
    let mut i = D::COUNT - 2;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(z, r.like(D::P[i]));
    }
    sum.mul_add(z * r, r)
}

/// sin x, for `|x| < 1e6`.
#[inline(always)]
pub fn sine<D: Degree, L: Lane>(x: L) -> L {
    let count = x.affine(FRAC_1_PI, ROUND);
    let k = count - x.like(ROUND);
    polynomial::<D, L>(reduce(x, k)).flip_where_odd(count)
}

/// cos x, for `|x| < 1e6`: with `x = (k + 1/2) pi + r` it is `-(-1)^k sin r`.
#[inline(always)]
pub fn cosine<D: Degree, L: Lane>(x: L) -> L {
    let count = x.affine(FRAC_1_PI, -0.5) + x.like(ROUND);
    let k = count - x.like(ROUND) + x.like(0.5);
    -polynomial::<D, L>(reduce(x, k)).flip_where_odd(count)
}

/// The angle in [-pi, pi] and the whole turns taken off.
#[inline(always)]
pub fn wrap<L: Lane>(x: L) -> (L, L) {
    let turns = x.affine(0.5 * FRAC_1_PI, ROUND) - x.like(ROUND);
    (minus_half_turns(x, turns + turns), turns)
}
