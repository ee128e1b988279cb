//! Readings rounded to counts: their likelihood, and the resulting equations.

use pendmap::fit::levenberg_marquardt::Point;
use pendmap::fit::quantised::{Likelihood, likelihood, surplus};
use pendmap::fit::window::Window;
use pendmap::fit::{Counts, Problem, Slot};
use pendmap::model::Parameter;

use crate::fit_records::{free, record};
use crate::support::undriven;

/// `Phi(high) - Phi(low)` by Simpson's rule.
fn between(low: f64, high: f64) -> f64 {
    let count = 4000;
    let step = (high - low) / f64::from(count);
    let density = |k: i32| {
        let x = low + step * f64::from(k);
        (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
    };
    let inner: f64 =
        (1..count).map(|k| if k % 2 == 1 { 4.0 * density(k) } else { 2.0 * density(k) }).sum();
    step / 3.0 * (density(0) + inner + density(count))
}

#[test]
fn deviances_are_those_of_the_integral_over_a_count() {
    for spread in [0.1, 0.3, 1.0] {
        for k in -60..=60 {
            let apart = 0.025 * f64::from(k);
            let probability = between((apart - 0.5) / spread, (apart + 0.5) / spread);
            if probability < 1e-9 {
                continue; // Simpson's rule has too few digits here
            }
            let own = likelihood(apart, 1.0, 1.0 / spread).deviance;
            let expected = -2.0 * probability.ln();
            assert!((own - expected).abs() < 1e-7 * (1.0 + expected), "{spread} {apart}: {own}");
        }
    }
}

#[test]
fn residual_and_weight_are_slope_and_curvature() {
    for sharpness in [1.5, 4.0, 10.0] {
        for k in 0..80 {
            let apart = 0.05 * f64::from(k) + 0.01;
            let Likelihood { deviance, residual, weight } = likelihood(apart, 1.0, sharpness);
            let step = 1e-3 / sharpness;
            let at = |x: f64| likelihood(x, 1.0, sharpness).deviance;
            // The model's angle increases as the residual decreases.
            let slope = (at(apart + step) - at(apart - step)) / (4.0 * step);
            let bend = (at(apart + step) - 2.0 * deviance + at(apart - step)) / (2.0 * step * step);
            let scale = sharpness * sharpness;
            assert!(
                (residual * weight - slope).abs() < 1e-5 * sharpness * (1.0 + slope),
                "{apart}"
            );
            assert!((weight * weight - bend).abs() < 1e-4 * scale, "{apart}: {weight} {bend}");
            let mirrored = likelihood(-apart, 1.0, sharpness);
            assert_eq!((mirrored.residual, mirrored.weight), (-residual, weight));
        }
    }
}

#[test]
fn far_from_its_count_a_reading_is_a_value() {
    for apart in [30.0, 1e3, 1e6] {
        let Likelihood { residual, weight, .. } = likelihood(apart, 1.0, 10.0);
        assert!((weight / 10.0 - 1.0).abs() < 1e-4, "{weight}");
        assert!((residual / (10.0 * (apart - 0.5)) - 1.0).abs() < 1e-4, "{residual}");
    }
}

#[test]
fn counts_finer_than_the_noise_are_squares() {
    // Then the deviance is the square over s^2 + q^2/12, plus a constant that the surplus
    // subtracts.
    for apart in [0.0, 0.7, 2.0, 4.0] {
        let Likelihood { deviance, residual, weight } = likelihood(apart, 0.2, 1.0);
        let variance = 1.0 + 0.04 / 12.0;
        let square: f64 = apart * apart / variance;
        let over = surplus(0.2, 1.0);
        assert!((deviance - over - square).abs() < 2e-3, "{deviance} {over} {square}");
        assert!((residual - square.sqrt()).abs() < 1e-3 && (weight - variance.powf(-0.5)) < 1e-3);
    }
}

#[test]
fn the_pull_is_the_slope_of_the_likelihood() {
    let mut own = record(undriven(0.1, 0.0), None, [1.5, 0.0], 20.0);
    let count = 0.05;
    for reading in &mut own.readings {
        *reading = (*reading / count).round() * count;
    }
    own.weights.fill(1.0 / (0.15 * count));
    own.weights[7] = 0.0;
    own.counts = Some(Counts::new(count, &own.weights).expect("counts"));
    let number = own.times.len();
    let slots = [Slot::Gravity, Slot::Parameter(Parameter::Gamma)];
    let problem =
        Problem::new(vec![own], free(&slots, 1, &[1.002, 0.101]), 1e-13).expect("a problem");
    let window = Window { record: 0, from: 0, to: number, start: [1.503, 0.004] };
    let at = |change: [f64; 4]| {
        let start = [window.start[0] + change[2], window.start[1] + change[3]];
        let values = vec![1.002 + change[0], 0.101 + change[1]];
        Point::new(&problem, values, vec![Window { start, ..window }]).expect("a point").normal
    };
    let here = at([0.0; 4]);
    // The predicted gain of a small step agrees with the slope of the sum of deviances.
    let step = here.step(1e6, &[]);
    let size = 1e-4 / step.gain.sqrt();
    let all: Vec<f64> = step.values.iter().chain(&step.starts[0]).map(|x| x * size).collect();
    let along = |sense: f64| at([0, 1, 2, 3].map(|k| sense * all[k])).chi2;
    let slope = (along(-1.0) - along(1.0)) / 2.0;
    assert!((slope / (size * step.gain) - 1.0).abs() < 1e-4, "{slope} {}", size * step.gain);
}

#[test]
fn a_count_of_nothing_is_refused() {
    assert!(
        Counts::new(0.0, &[1.0])
            .expect_err("refused")
            .to_string()
            .contains("count must be a number above 0, got 0")
    );
}
