//! Shares of uncertain starts, in planes with a known boundary.

use std::f64::consts::PI;

use pendmap::error::Error;
use pendmap::integrate::State;
use pendmap::maps::basins::{Options, basins};
use pendmap::maps::boundary_distance::Thinned;
use pendmap::maps::control::Control;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::maps::uncertainty::{Uncertainty, uncertainty};

use crate::support::{driven, plane};

/// A window of `count` cells, far from the unit square.
fn window(side: usize) -> [Axis; 2] {
    [(-PI, PI), (2.0, 3.0)].map(|(low, high)| Axis { low, high, count: side })
}

fn measured(side: usize, seed: u64, of: impl Fn(f64, f64) -> i16) -> Uncertainty {
    let [theta, velocity] = window(side);
    let cell = |k: usize| {
        let centre = |place: usize| (place as f64 + 0.5) / side as f64;
        of(centre(k % side), centre(k / side))
    };
    let map: Vec<i16> = (0..side * side).map(cell).collect();
    uncertainty([&theta, &velocity], &Thinned::new(&map, side), seed, |states: Vec<State>| {
        let part = |value: f64, axis: &Axis| (value - axis.low) / (axis.high - axis.low);
        let labels = states.iter().map(|s| of(part(s[0], &theta), part(s[1], &velocity)));
        Ok::<_, Error>(labels.collect())
    })
    .expect("labels")
}

/// Difference of each count from the expected share, in standard deviations.
fn deviations(found: &Uncertainty, share: impl Fn(f64) -> f64) -> Vec<f64> {
    let all = found.eps.iter().zip(&found.uncertain).zip(&found.tried);
    all.map(|((eps, uncertain), tried)| {
        let (f, n) = (share(*eps), *tried as f64);
        (*uncertain as f64 - n * f) / (n * f * (1.0 - f)).sqrt()
    })
    .collect()
}

#[test]
fn near_a_circle_the_share_is_its_length_times_the_mean_reach() {
    // A start within eps |cos| of the line, on either side: 2 eps 2/pi over a length of 2 pi r.
    let radius = 0.3;
    let inside = |x: f64, y: f64| 1 + i16::from((x - 0.5).hypot(y - 0.5) < radius);
    let found = measured(1000, 3, inside);
    assert!(found.eps.len() > 4 && found.eps.is_sorted_by(|a, b| a > b), "{found:?}");
    for deviation in deviations(&found, |eps| 8.0 * radius * eps) {
        assert!(deviation.abs() < 4.0, "{found:?}");
    }
    assert_ne!(measured(1000, 4, inside), found);
    assert_eq!(measured(1000, 3, inside), found);
}

/// The slope of the logarithm of the share, points weighted by their counts.
fn exponent(found: &Uncertainty) -> f64 {
    let points: Vec<[f64; 3]> = (0..found.eps.len())
        .map(|k| {
            let (hit, tried) = (found.uncertain[k] as f64, found.tried[k] as f64);
            [hit, found.eps[k].ln(), ((hit + 0.25) / tried).ln()]
        })
        .collect();
    let mean = |of: &dyn Fn(&[f64; 3]) -> f64| {
        points.iter().map(|p| p[0] * of(p)).sum::<f64>() / points.iter().map(|p| p[0]).sum::<f64>()
    };
    let (x, y) = (mean(&|p| p[1]), mean(&|p| p[2]));
    mean(&|p| (p[1] - x) * (p[2] - y)) / mean(&|p| (p[1] - x).powi(2))
}

/// The level of the gap of the middle-thirds Cantor set that contains `x`, even or odd.
fn thirds(mut x: f64) -> i16 {
    for level in 0..40 {
        x *= 3.0;
        if (1.0..2.0).contains(&x) {
            return 1 + level % 2;
        }
        x -= if x < 1.0 { 0.0 } else { 2.0 };
    }
    1
}

#[test]
fn exponents_that_are_known_are_found_on_maps_of_any_size() {
    type Plane = (f64, fn(f64, f64) -> i16);
    let planes: [Plane; 4] = [
        (1.0, |x, y| 1 + i16::from((x - 0.5).hypot(y - 0.5) < 0.31)),
        (1.0, |x, y| 1 + i16::from(y > 0.45 + 0.2 * (7.0 * x).sin())),
        (1.0, |x, y| 1 + i16::from(x + 0.37 * y > 0.61) + i16::from(x < 0.2)),
        (1.0 - 2_f64.ln() / 3_f64.ln(), |x, y| thirds((x + 0.013 * y).fract())),
    ];
    for (known, of) in planes {
        // Maps of few cells have few labels: the widths are three standard errors.
        for (side, seed, width) in [(100, 1, 0.12), (400, 2, 0.06), (1000, 3, 0.04)] {
            let found = measured(side, seed, of);
            let value = exponent(&found);
            assert!((value - known).abs() < width, "{value} for {known} on {side}: {found:?}");
        }
    }
}

#[test]
fn random_labels_are_uncertain_at_any_distance() {
    let random = |x: f64, y: f64| {
        let mixed = (x.to_bits() ^ y.to_bits().rotate_left(29)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        1 + ((mixed >> 40) % 2) as i16
    };
    let found = measured(100, 0, random);
    assert!(found.eps.first() == Some(&2_f64.powi(-6)) && found.eps.last() < Some(&2e-8));
    let far = deviations(&found, |_| 0.75).into_iter().filter(|d| d.abs() > 3.0).count();
    assert!(far <= 1, "{found:?}");
}

#[test]
fn starts_with_unknown_ends_are_left_out() {
    // Half of the plane is unknown: at the line in the other half results are unchanged.
    let half = |x: f64, y: f64| if y < 0.5 { 0 } else { 1 + i16::from(x > 0.4) };
    let found = measured(1000, 1, half);
    for (k, deviation) in deviations(&found, |eps| 4.0 * eps / PI).into_iter().enumerate() {
        assert!(deviation.abs() < 4.0 + 20.0 * found.eps[k], "{found:?}");
    }
    assert_eq!(measured(1000, 1, |_, _| 1), Uncertainty::default());
    assert_eq!(measured(1000, 1, |_, _| -1), Uncertainty::default());
}

#[test]
fn only_checked_grids_have_an_uncertainty() {
    let pendulum = driven(0.1, 0.6, 2.0);
    let made = |starts: &Starts, check: bool| {
        let options = Options { check, ..Options::default() };
        basins(&pendulum, starts, &options, &Control::default()).expect("a map").uncertainty
    };
    let grid = plane(100);
    let found = made(&grid, true).expect("a grid that is checked");
    assert!(found.uncertain.iter().sum::<u64>() > 100, "{found:?}");
    assert_eq!(made(&grid, false), None);
    assert_eq!(made(&plane(99), true), None);
    assert_eq!(made(&Starts::List(vec![[1.0, 0.0], [2.0, 0.0]]), true), None);
}
