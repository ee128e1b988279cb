//! Layers and measures of a map: turns and exponents, texture, reliability.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use nalgebra::Vector2;
use pendmap::integrate::Strobe;
use pendmap::maps::basin_entropy::{TextureSum, texture};
use pendmap::maps::basins::{Options, basins};
use pendmap::maps::control::{Control, pool};
use pendmap::maps::finite_time::finite_time;
use pendmap::maps::starts::Starts;
use pendmap::orbit::PoincareMap;

use crate::support::{driven, plane, simd, spread, undriven};

#[test]
fn turns_and_exponents_are_those_of_the_precise_map() {
    let pendulum = driven(0.05, 0.9, 1.7);
    let starts = Starts::List(spread(200, 3.1, 2.5));
    let strobe = Strobe::new(&pendulum, 60, simd());
    let layers = finite_time(&strobe, &starts, 3, &pool(1).expect("a pool"), &Control::default())
        .expect("layers");
    let map = PoincareMap::new(&pendulum);
    for i in 0..starts.len() {
        let start = starts.get(i);
        let image = map.iterate(start, 3);
        let tangent = image.derivative * Vector2::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2);
        let exponent = tangent.norm().ln() / (3.0 * pendulum.period());
        assert!((f64::from(layers.exponent[i]) - exponent).abs() < 1e-6, "start {i}");
        let net = image.turns as f64 + (image.state[0] - start[0]) / TAU;
        // Values at one half are rounded either way by rounding errors.
        let near = (net - net.round()).abs() < 0.499;
        assert!(!near || layers.turns[i] == net.round() as i32, "start {i}: {net}");
    }
}

#[test]
fn without_drive_and_damping_energy_decides_rotation() {
    let pendulum = undriven(0.0, 0.0);
    let starts = plane(40);
    let strobe = Strobe::new(&pendulum, 40, simd());
    let layers = finite_time(&strobe, &starts, 20, &pool(2).expect("a pool"), &Control::default())
        .expect("layers");
    for i in 0..starts.len() {
        let [theta, velocity] = starts.get(i);
        let energy = 0.5 * velocity * velocity - theta.cos();
        // Below the threshold it swings and ends less than a turn away; above it rotates for ever.
        if energy < 1.0 {
            assert!(layers.turns[i].abs() <= 1, "start {i} swings");
        } else if energy > 1.01 {
            assert!(layers.turns[i] * velocity.signum() as i32 > 10, "start {i} turns");
        }
        // There is no chaos here: growth is that of a shear.
        assert!(energy > 0.9 && energy < 1.1 || layers.exponent[i] < 0.08, "start {i}");
    }
}

#[test]
fn texture_of_known_patterns() {
    let pattern = |f: &dyn Fn(usize, usize) -> i16| {
        let labels: Vec<i16> = (0..400).map(|i| f(i % 20, i / 20)).collect();
        texture(&labels, 20, &pool(2).expect("a pool"))
    };
    let plain = pattern(&|_, _| 1);
    assert_eq!(
        [plain.basin_entropy, plain.neighbours_agree, plain.chance].map(f64::to_bits),
        [0.0, 1.0, 1.0].map(f64::to_bits)
    );
    // Halves along the edges of boxes: 20 of 760 pairs differ.
    let halves = pattern(&|column, _| if column < 10 { 1 } else { 2 });
    assert!(halves.basin_entropy.abs() < 1e-15);
    assert!((halves.neighbours_agree - 740.0 / 760.0).abs() < 1e-12);
    assert!((halves.chance - 0.5).abs() < 1e-12);
    // A chequerboard: 13 and 12 cells in each box of 25.
    let chequers = pattern(&|column, row| ((column + row) % 2) as i16 + 1);
    let (a, b) = (13.0_f64 / 25.0, 12.0_f64 / 25.0);
    assert!((chequers.basin_entropy + a * a.ln() + b * b.ln()).abs() < 1e-12);
    assert!(chequers.neighbours_agree.abs() < 1e-12 && (chequers.chance - 0.5).abs() < 1e-12);
}

#[test]
fn a_texture_in_parts_is_that_of_the_whole() {
    let (columns, pool) = (23, pool(2).expect("a pool"));
    for rows in [30, 31, 37, 4] {
        let labels: Vec<i16> = (0..columns * rows).map(|k| (k * k % 7 % 3) as i16).collect();
        let mut sum = TextureSum::new(columns, rows);
        for first in (0..rows).step_by(10) {
            // A part ends with the first row of the next one.
            let last = (first + 11).min(rows);
            sum.add(&labels[first * columns..last * columns], &pool);
        }
        let whole = texture(&labels, columns, &pool);
        assert_eq!(format!("{:?}", sum.total()), format!("{whole:?}"), "{rows} rows");
    }
}

#[test]
fn smooth_labels_are_reliable_and_fractal_ones_are_not() {
    let made = |p: f64| {
        let map =
            basins(&driven(0.1, p, 2.0), &plane(100), &Options::default(), &Control::default());
        map.expect("a map")
    };
    let smooth = made(0.6);
    assert_eq!(smooth.reliability.sampled, 2000);
    assert!(smooth.reliability.either < 0.003, "{:?}", smooth.reliability);
    assert!(smooth.texture.neighbours_agree > 0.9 && smooth.texture.basin_entropy < 0.15);

    let fractal = made(1.7);
    let found = fractal.reliability;
    assert!(found.either > 0.05, "{found:?}");
    let mirror = found.mirror.expect("a symmetric plane");
    assert!(found.half_step > 0.05 && mirror > 0.05, "{found:?}");
    assert!(found.either >= found.half_step.max(mirror));
    assert!(found.either <= found.half_step + mirror + 1e-12);
    // Neighbours agree little better than by chance.
    let texture = fractal.texture;
    assert!(texture.neighbours_agree < texture.chance + 0.1, "{texture:?}");
    assert!(texture.basin_entropy > 0.5, "{texture:?}");
    assert!((fractal.fractions[0] - 0.5).abs() < 0.02, "{:?}", fractal.fractions);
}

#[test]
fn a_torque_has_no_mirror_check() {
    let map = basins(&undriven(0.1, 0.5), &plane(30), &Options::default(), &Control::default());
    let found = map.expect("a map").reliability;
    assert_eq!((found.mirror, found.sampled), (None, 900));
    assert!((found.either - found.half_step).abs() < 1e-12);
}
