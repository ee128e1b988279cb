//! Exponential and logarithm on every instruction set, against the C library.

use pendmap::lanes::{InstructionSet, Lane};

use crate::support::{Function, each, instruction_sets};

struct Exponential;
struct Logarithm;

impl Function for Exponential {
    #[inline(always)]
    fn of<L: Lane>(x: L) -> L {
        x.exponential()
    }
}

impl Function for Logarithm {
    #[inline(always)]
    fn of<L: Lane>(x: L) -> L {
        x.logarithm()
    }
}

/// The largest relative error, in units of the last place.
fn worst(numbers: &[f64], values: &[f64], exact: fn(f64) -> f64) -> (f64, f64) {
    numbers
        .iter()
        .zip(values)
        .map(|(x, y)| (((y - exact(*x)) / exact(*x)).abs() / f64::EPSILON, *x))
        .fold((0.0, 0.0), |a, b| if b.0 > a.0 || b.0.is_nan() { b } else { a })
}

/// Numbers over a whole range, and the neighbours of each multiple of `ln 2 / 2` in it.
fn exponents() -> Vec<f64> {
    let mut all: Vec<f64> = (0..=200_000).map(|i| -707.9 + 0.007_084 * f64::from(i)).collect();
    all.extend((-2040..2040).flat_map(|k| {
        let at = 0.5 * std::f64::consts::LN_2 * f64::from(k);
        [at, at.next_up(), at.next_down()]
    }));
    all.extend((1..300).map(|k| 10_f64.powi(-k)));
    all
}

#[test]
fn the_exponential_is_good_to_the_last_place() {
    let numbers = exponents();
    for simd in instruction_sets() {
        let found = worst(&numbers, &each::<Exponential>(simd, &numbers), f64::exp);
        assert!(found.0 < 2.0, "{simd}: {found:?}");
    }
}

#[test]
fn the_exponential_stays_among_normal_numbers() {
    let far = [-1e300, f64::NEG_INFINITY, -750.0, 750.0, 1e300, f64::INFINITY];
    for simd in instruction_sets() {
        let found = each::<Exponential>(simd, &far);
        assert!(found.iter().all(|y| y.is_normal() && *y > 0.0), "{simd}: {found:?}");
        assert!(found[..3].iter().all(|y| *y < 1e-307) && found[3..].iter().all(|y| *y > 1e307));
    }
    let one = each::<Exponential>(InstructionSet::Portable, &[0.0, -0.0]);
    assert!(one.iter().all(|y| (y - 1.0).abs() == 0.0), "{one:?}");
}

#[test]
fn the_logarithm_is_good_to_the_last_places() {
    // All binades, and the neighbourhood of 1, at which the logarithm vanishes.
    let mut numbers: Vec<f64> =
        (0..200_000).map(|i| 10_f64.powf(-307.0 + 0.003_07 * f64::from(i))).collect();
    numbers.extend((0..20_000).map(|i| 0.5 + 1e-4 * f64::from(i)));
    numbers.extend((1..16).flat_map(|k| [1.0 + 10_f64.powi(-k), 1.0 - 10_f64.powi(-k)]));
    numbers.retain(|x| x.ln() != 0.0);
    for simd in instruction_sets() {
        let found = worst(&numbers, &each::<Logarithm>(simd, &numbers), f64::ln);
        assert!(found.0 < 4.0, "{simd}: {found:?}");
    }
    assert!(each::<Logarithm>(InstructionSet::Portable, &[1.0])[0].abs() == 0.0);
}

#[test]
fn exponential_and_logarithm_are_inverse() {
    let numbers: Vec<f64> = (-7000..7000).map(|i| 0.1 * f64::from(i)).collect();
    for simd in instruction_sets() {
        let there = each::<Exponential>(simd, &numbers);
        for (x, back) in numbers.iter().zip(each::<Logarithm>(simd, &there)) {
            assert!((back - x).abs() < 4e-16 * (1.0 + x.abs()), "{simd}: {x} {back}");
        }
    }
}
