//! Sine, cosine and reduction of an angle in half turns, over any [`Lane`].
//!
//! The kernel counts angles in half turns, `x = theta / pi`: then the reduction `x = k + r`,
//! `|r| <= 1/2`, is exact, needs no product, and taking off whole turns loses nothing however long a
//! pendulum rotates. Adding and subtracting 1.5 * 2^52 rounds `x` to the integer `k` and leaves its
//! parity in the lowest bit. Then `sin(pi x) = (-1)^k r (pi + r^2 P(r^2))`, where `P` minimises the
//! largest absolute error (Remez exchange in 60 digits with the first coefficient held at pi). Every
//! operation is odd in `x`, so `sine(-x) = -sine(x)` bit for bit. With a derivative the cosine is needed
//! too: `cos(pi x) = (-1)^k (1 + r^2 Q(r^2))`, `Q` found likewise, from the same `k` and `r`.

use std::f64::consts::PI;

use super::real::Lane;

/// Precision of a sine: the coefficients of `P`, lowest power first.
pub trait Degree: Copy {
    /// Number of coefficients.
    const COUNT: usize;
    /// Coefficients of `P`; entries from [`Degree::COUNT`] on are unused.
    const P: [f64; 7];
    /// Largest absolute error of the polynomial.
    const ERROR: f64;
    /// Number of coefficients of `Q`.
    const EVEN: usize;
    /// Coefficients of `Q`; entries from [`Degree::EVEN`] on are unused.
    const Q: [f64; 8];
}

/// Degree 15, absolute error 1.4e-16 and rounding.
#[derive(Clone, Copy, Debug)]
pub struct Fine;

impl Degree for Fine {
    const COUNT: usize = 7;
    const P: [f64; 7] = [
        -5.167712780049705,
        2.550164039855785,
        -0.5992645286812263,
        0.08214587723027385,
        -0.007370355368129299,
        0.0004659618374591986,
        -2.110571136903869e-05,
    ];
    const ERROR: f64 = 1.4e-16;
    const EVEN: usize = 8;
    const Q: [f64; 8] = [
        -4.934802200544677,
        4.058712126416545,
        -1.3352627688446645,
        0.23533063014598798,
        -0.02580688886269012,
        0.0019295568179546485,
        -0.00010456780753150726,
        4.1507503706039085e-06,
    ];
}

/// Degree 11, absolute error 1.8e-11: enough for step errors above 1e-10, and quicker.
#[derive(Clone, Copy, Debug)]
pub struct Coarse;

impl Degree for Coarse {
    const COUNT: usize = 5;
    const P: [f64; 7] = [
        -5.167712761384337,
        2.550163171498463,
        -0.5992504607497056,
        0.08204244801460123,
        -0.007015793323563478,
        0.0,
        0.0,
    ];
    const ERROR: f64 = 1.8e-11;
    const EVEN: usize = 5;
    const Q: [f64; 8] = [
        -4.934802156087909,
        4.05870959976713,
        -1.335216104967877,
        0.23495392612837324,
        -0.024420700772337704,
        0.0,
        0.0,
        0.0,
    ];
}

/// Adding it rounds to an integer, whose parity is then the lowest bit of the sum.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// `sin(pi x)`, for `|x| < 2^50`.
#[inline(always)]
pub fn sine<D: Degree, L: Lane>(x: L) -> L {
    both::<D, L>(x).0
}

/// `sin(pi x)` and, to 2.5e-10 where coarse, `cos(pi x)`, for `|x| < 2^50`.
#[inline(always)]
pub fn both<D: Degree, L: Lane>(x: L) -> (L, L) {
    let count = x + x.like(ROUND);
    let r = (x - (count - x.like(ROUND))).flip_where_odd(count);
    let z = r * r;
    let odd = polynomial(z, &D::P, D::COUNT).mul_add(z, r.like(PI)) * r;
    let even = polynomial(z, &D::Q, D::EVEN).mul_add(z, r.like(1.0));
    (odd, even.flip_where_odd(count))
}

/// The polynomial of `z` with the first `count` coefficients.
#[inline(always)]
fn polynomial<L: Lane>(z: L, coefficients: &[f64], count: usize) -> L {
    let mut sum = z.affine(coefficients[count - 1], coefficients[count - 2]);
    let mut i = count - 2;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(z, z.like(coefficients[i]));
    }
    sum
}

/// `cos(pi x) = -sin(pi (x - 1/2))`, to half a unit in the last place of `x`.
#[inline(always)]
pub fn cosine<D: Degree, L: Lane>(x: L) -> L {
    -sine::<D, L>(x - x.like(0.5))
}

/// The angle less whole turns, in half turns, and the turns taken off, both exact: the whole number nearest to
/// `part` times the angle. One half leaves an angle in [-1, 1], and 0 all of it.
#[inline(always)]
pub fn wrap<L: Lane>(x: L, part: f64) -> (L, L) {
    let turns = x.scale(part) + x.like(ROUND) - x.like(ROUND);
    (x - (turns + turns), turns)
}
