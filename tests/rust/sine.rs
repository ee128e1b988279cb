//! Sine, cosine and reduction of angles in half turns, on every instruction set, against the C library.

use std::f64::consts::PI;
use std::marker::PhantomData;

use pendmap::lanes::sine::{Coarse, Degree, Fine, wrap};
use pendmap::lanes::{InstructionSet, Lane};

use crate::support::{Function, each, instruction_sets};

struct Sine<D>(PhantomData<D>);
struct Cosine<D>(PhantomData<D>);
struct Wrapped;
struct Turns;

impl<D: Degree> Function for Sine<D> {
    #[inline(always)]
    fn of<L: Lane>(x: L) -> L {
        x.sine::<D>()
    }
}

impl<D: Degree> Function for Cosine<D> {
    #[inline(always)]
    fn of<L: Lane>(x: L) -> L {
        x.cosine::<D>()
    }
}

impl Function for Wrapped {
    #[inline(always)]
    fn of<L: Lane>(x: L) -> L {
        wrap(x, 0.5).0
    }
}

impl Function for Turns {
    #[inline(always)]
    fn of<L: Lane>(x: L) -> L {
        wrap(x, 0.5).1
    }
}

/// Half turns over all of [-limit, limit], and the neighbours of every quarter turn in it.
fn half_turns(limit: i32) -> Vec<f64> {
    let count = 100_000;
    let mut all: Vec<f64> = (0..=count)
        .map(|i| f64::from(limit) * (2.0 * f64::from(i) / f64::from(count) - 1.0))
        .collect();
    for k in -2 * limit..=2 * limit {
        let at = 0.5 * f64::from(k);
        all.extend([at, at.next_up(), at.next_down()]);
        for power in 1..16 {
            let gap = 10_f64.powi(-power);
            all.extend([at + gap, at - gap]);
        }
    }
    all
}

/// `sin(pi x)` by the C library: the reduction is exact, and the rounding error of the product with
/// pi is compensated.
fn exact_sine(x: f64) -> f64 {
    let k = x.round();
    let r = x - k;
    let product = r * PI;
    let rest = r.mul_add(PI, -product) + r * 1.224_646_799_147_353_2e-16;
    let sine = product.sin() + rest * product.cos();
    if k.rem_euclid(2.0) == 0.0 { sine } else { -sine }
}

fn exact_cosine(x: f64) -> f64 {
    // An eighth of a turn from the maximum of the cosine, the cosine series is more accurate.
    let (k, r) = (x.round(), x - x.round());
    let cosine = if r.abs() < 0.25 { (r * PI).cos() } else { exact_sine(0.5 - r.abs()) };
    if k.rem_euclid(2.0) == 0.0 { cosine } else { -cosine }
}

/// Largest difference, and its angle.
fn worst(angles: &[f64], values: &[f64], exact: fn(f64) -> f64) -> (f64, f64) {
    angles
        .iter()
        .zip(values)
        .map(|(x, y)| ((y - exact(*x)).abs(), *x))
        .fold((0.0, 0.0), |a, b| if b.0 > a.0 || b.0.is_nan() { b } else { a })
}

fn check_accuracy<D: Degree>(name: &str, rounding: f64) {
    // 16 half turns are 50 rad.
    for limit in [1, 16] {
        let angles = half_turns(limit);
        for simd in instruction_sets() {
            let (s, c) = (each::<Sine<D>>(simd, &angles), each::<Cosine<D>>(simd, &angles));
            let sine = worst(&angles, &s, exact_sine);
            let cosine = worst(&angles, &c, exact_cosine);
            let allowed = D::ERROR + rounding;
            assert!(sine.0 < allowed, "{name} sine on {simd}: {sine:?} over {allowed:e}");
            // x - 1/2 is rounded once, to half a unit in the last place of x.
            let allowed = allowed + PI * f64::from(limit) * 0.5 * f64::EPSILON;
            assert!(cosine.0 < allowed, "{name} cosine on {simd}: {cosine:?} over {allowed:e}");
        }
    }
}

#[test]
fn fine_sine_and_cosine_are_good_to_rounding() {
    check_accuracy::<Fine>("fine", 4e-16);
}

#[test]
fn coarse_sine_and_cosine_keep_their_bound() {
    check_accuracy::<Coarse>("coarse", 4e-16);
    // The bound is that of the polynomial, without a margin.
    let angles = half_turns(1);
    let found =
        worst(&angles, &each::<Sine<Coarse>>(InstructionSet::Portable, &angles), exact_sine);
    assert!(found.0 > 0.9 * Coarse::ERROR, "{found:?}");
}

#[test]
fn far_angles_are_as_good_as_near_ones() {
    // A pendulum after a hundred thousand rotations.
    let angles: Vec<f64> = (0..50_000).map(|i| 2e5 + f64::from(i) * 0.123_456_7).collect();
    for simd in instruction_sets() {
        let found = worst(&angles, &each::<Sine<Fine>>(simd, &angles), exact_sine);
        assert!(found.0 < Fine::ERROR + 3e-16, "{simd}: {found:?}");
    }
}

#[test]
fn small_angles_keep_their_relative_accuracy() {
    // The first coefficient is pi: a pendulum near rest is as precise as one far from it.
    let small: Vec<f64> = (30..3000).map(|i| 10_f64.powf(-0.1 * f64::from(i))).collect();
    for simd in instruction_sets() {
        for (x, y) in small.iter().zip(each::<Sine<Fine>>(simd, &small)) {
            assert!((y / exact_sine(*x) - 1.0).abs() < 4e-16, "{simd}: sin(pi {x:e}) = {y:e}");
        }
    }
}

#[test]
fn the_equilibria_are_exact() {
    let whole: Vec<f64> = (-40..=40).map(f64::from).collect();
    for simd in instruction_sets() {
        assert!(each::<Sine<Fine>>(simd, &whole).iter().all(|y| *y == 0.0), "{simd}");
        assert!(each::<Sine<Coarse>>(simd, &whole).iter().all(|y| *y == 0.0), "{simd}");
    }
}

/// Whether two numbers are opposite to the last bit. A zero results from a difference and may have
/// either sign.
fn opposite(a: f64, b: f64) -> bool {
    (-a).to_bits() == b.to_bits() || (a == 0.0 && b == 0.0)
}

#[test]
fn sine_and_reduction_are_odd_bit_for_bit() {
    let right = half_turns(16);
    let left: Vec<f64> = right.iter().map(|x| -x).collect();
    for simd in instruction_sets() {
        let pairs = [
            ("fine sine", each::<Sine<Fine>>(simd, &right), each::<Sine<Fine>>(simd, &left)),
            ("coarse sine", each::<Sine<Coarse>>(simd, &right), each::<Sine<Coarse>>(simd, &left)),
            ("angle", each::<Wrapped>(simd, &right), each::<Wrapped>(simd, &left)),
            ("turns", each::<Turns>(simd, &right), each::<Turns>(simd, &left)),
        ];
        for (what, a, b) in pairs {
            for ((x, a), b) in right.iter().zip(a).zip(b) {
                assert!(opposite(a, b), "{what} of {x:?} and its opposite on {simd}: {a:?}, {b:?}");
            }
        }
    }
}

#[test]
fn wrapping_takes_whole_turns_off_and_loses_nothing() {
    let mut angles = half_turns(16);
    angles.extend((0..20_000).map(|i| f64::from(i) * 1.234_567 - 1e4));
    for simd in instruction_sets() {
        let (wrapped, turns) = (each::<Wrapped>(simd, &angles), each::<Turns>(simd, &angles));
        for ((x, r), k) in angles.iter().zip(&wrapped).zip(&turns) {
            assert!(k.fract() == 0.0 && r.abs() <= 1.0, "{x} is {k} turns and {r} on {simd}");
            assert!((x - r).to_bits() == (2.0 * k).to_bits() || *k == 0.0, "{x} on {simd}");
            assert!(*k != 0.0 || r.to_bits() == x.to_bits() || *x == 0.0, "{x} on {simd}");
        }
    }
}
