//! Sine, cosine and reduction modulo a turn, on every path, against the C library.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::marker::PhantomData;

use pendmap::lanes::sine::{Coarse, Degree, Fine, wrap};
use pendmap::lanes::{Isa, Job, Lane, Path, dispatch};

use crate::support::{bits, paths};

/// What one function of the lane arithmetic makes of many numbers.
struct Each<'a, F>(&'a [f64], F);

/// A function over any lane; written as a trait, since a closure cannot be generic.
trait Function {
    fn of<L: Lane>(x: L) -> L;
}

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
        wrap(x).0
    }
}

impl Function for Turns {
    #[inline(always)]
    fn of<L: Lane>(x: L) -> L {
        wrap(x).1
    }
}

impl<F: Function> Job for Each<'_, F> {
    type Output = [Vec<f64>; 2];
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) -> [Vec<f64>; 2] {
        let width = S::Lanes::WIDTH;
        let mut lanes = self.0.to_vec();
        lanes.resize(self.0.len().next_multiple_of(width), 0.0);
        for chunk in lanes.chunks_exact_mut(width) {
            F::of(S::Lanes::load(isa, chunk)).store(chunk);
        }
        lanes.truncate(self.0.len());
        let mut singles = self.0.to_vec();
        for x in singles.chunks_exact_mut(1) {
            F::of(S::Single::load((), x)).store(x);
        }
        [lanes, singles]
    }
}

/// `F` on `path`; lanes and single numbers must agree bit for bit.
fn each<F: Function>(path: Path, numbers: &[f64], function: F) -> Vec<f64> {
    let [lanes, singles] = dispatch::run(path, Each(numbers, function));
    assert_eq!(bits(&lanes), bits(&singles), "lanes and single numbers on {path}");
    lanes
}

fn sine<D: Degree>(path: Path, numbers: &[f64]) -> Vec<f64> {
    each(path, numbers, Sine::<D>(PhantomData))
}

fn cosine<D: Degree>(path: Path, numbers: &[f64]) -> Vec<f64> {
    each(path, numbers, Cosine::<D>(PhantomData))
}

/// Numbers all over [-limit, limit], and the neighbours of every multiple of pi/2 in it.
fn angles(limit: f64) -> Vec<f64> {
    let count = 100_000;
    let mut all: Vec<f64> =
        (0..=count).map(|i| limit * (2.0 * f64::from(i) / f64::from(count) - 1.0)).collect();
    let most = (limit / FRAC_PI_2) as i32;
    for k in -most..=most {
        let at = f64::from(k) * FRAC_PI_2;
        all.extend([at, at.next_up(), at.next_down()]);
        for power in 1..16 {
            let gap = 10_f64.powi(-power);
            all.extend([at + gap, at - gap]);
        }
    }
    all.retain(|x| x.abs() <= limit);
    all
}

/// Largest difference, with the angle where it is.
fn worst(angles: &[f64], values: &[f64], exact: impl Fn(f64) -> f64) -> (f64, f64) {
    angles
        .iter()
        .zip(values)
        .map(|(x, y)| ((y - exact(*x)).abs(), *x))
        .fold((0.0, 0.0), |a, b| if b.0 > a.0 || b.0.is_nan() { b } else { a })
}

fn check_accuracy<D: Degree>(name: &str, rounding: f64) {
    for limit in [PI, 50.0] {
        let angles = angles(limit);
        // The fused reduction is off by 3.9e-17 of the angle, half a unit in its last place.
        let allowed = D::ERROR + rounding + 4e-17 * limit;
        for path in paths() {
            let (s, c) = (sine::<D>(path, &angles), cosine::<D>(path, &angles));
            for (what, found) in
                [("sin", worst(&angles, &s, f64::sin)), ("cos", worst(&angles, &c, f64::cos))]
            {
                assert!(found.0 < allowed, "{name} {what} on {path}: {found:?} over {allowed:e}");
            }
        }
    }
}

#[test]
fn fine_sine_and_cosine_are_good_to_rounding() {
    check_accuracy::<Fine>("fine", 2.5e-16);
}

#[test]
fn coarse_sine_and_cosine_keep_their_bound() {
    check_accuracy::<Coarse>("coarse", 4e-16);
    // The bound is the polynomial's own and not a generous one.
    let angles = angles(PI);
    let found = worst(&angles, &sine::<Coarse>(Path::Portable, &angles), f64::sin);
    assert!(found.0 > 0.9 * Coarse::ERROR, "{found:?}");
}

#[test]
fn small_angles_keep_their_relative_accuracy() {
    // The first coefficient is 1: a pendulum near rest is as precise as one far from it.
    let angles: Vec<f64> = (0..3000).map(|i| 10_f64.powf(-0.1 * f64::from(i))).collect();
    let small: Vec<f64> = angles.into_iter().filter(|x| *x < 1e-3).collect();
    for path in paths() {
        for (x, y) in small.iter().zip(sine::<Fine>(path, &small)) {
            assert!((y / x.sin() - 1.0).abs() < 3e-16, "{path}: sin {x:e} = {y:e}");
        }
    }
}

/// Whether two numbers are each other's opposite to the last bit. A zero is made by a difference
/// and has the sign +, so that zeros are their own opposites.
fn opposite(a: f64, b: f64) -> bool {
    (-a).to_bits() == b.to_bits() || (a == 0.0 && b == 0.0)
}

#[test]
fn sine_and_reduction_are_odd_bit_for_bit() {
    let right = angles(50.0);
    let left: Vec<f64> = right.iter().map(|x| -x).collect();
    for path in paths() {
        let pairs = [
            ("fine sine", sine::<Fine>(path, &right), sine::<Fine>(path, &left)),
            ("coarse sine", sine::<Coarse>(path, &right), sine::<Coarse>(path, &left)),
            ("angle", each(path, &right, Wrapped), each(path, &left, Wrapped)),
            ("turns", each(path, &right, Turns), each(path, &left, Turns)),
        ];
        for (what, a, b) in pairs {
            for ((x, a), b) in right.iter().zip(a).zip(b) {
                assert!(opposite(a, b), "{what} of {x:?} and its opposite on {path}: {a:?}, {b:?}");
            }
        }
    }
}

#[test]
fn wrapping_takes_whole_turns_off() {
    let mut angles = angles(50.0);
    angles.extend((0..20_000).map(|i| f64::from(i) * 1.234_567 - 1e4));
    for path in paths() {
        let (wrapped, turns) = (each(path, &angles, Wrapped), each(path, &angles, Turns));
        for ((x, r), k) in angles.iter().zip(&wrapped).zip(&turns) {
            assert!(k.fract() == 0.0, "{k} turns from {x} on {path}");
            assert!(r.abs() <= PI + 2e-15 * (1.0 + x.abs()), "{x} wraps to {r} on {path}");
            // Exact but for the last rounding: the double next to 2 pi and what it lacks.
            let exact = k.mul_add(-2.449_293_598_294_706_4e-16, k.mul_add(-TAU, *x));
            assert!((r - exact).abs() < 1e-18 + 2.3e-16 * r.abs(), "{x}: {r} for {exact} on {path}");
        }
    }
}
