//! Fits: the eliminated equations against the full ones, recovered parameters, intervals.

use std::sync::atomic::AtomicBool;

use nalgebra::{DMatrix, DVector};
use pendmap::fit::levenberg_marquardt::{Limit, Point, descend};
use pendmap::fit::normal::Normal;
use pendmap::fit::profile::intervals;
use pendmap::fit::window::{Window, windows_of};
use pendmap::fit::{Free, Problem, Record, Settings, Slot, fit};
use pendmap::model::{Kind, Parameter};

use crate::fit_records::{TOLERANCE, everything, free, line, record, with};
use crate::support::{driven, undriven};

fn noise(k: usize) -> f64 {
    // Not random, but unlike any term of the model.
    ((k as f64 * 12.9898).sin() * 43_758.545_3).fract() - 0.5
}

/// Three records, one of them forced, and wrong starting values.
fn several() -> (Problem, Vec<f64>) {
    let gain: (Kind, &[f64]) = (Kind::EncoderOffset, &[0.01]);
    let own = |p: f64| {
        with(
            driven(0.02, p, 2.1).with_friction(0.03).expect("in range"),
            std::slice::from_ref(&gain),
        )
    };
    let mut records = vec![
        record(own(0.0), None, [2.8, -0.01], 60.0),
        record(own(0.0), None, [1.2, 0.3], 40.0),
        record(own(0.4), None, [1.0, 0.2], 40.0),
    ];
    records[2].longest = 15.0;
    let offset = Parameter::OfEffect { effect: 0, place: 0 };
    let slots = [
        Slot::Gravity,
        Slot::Parameter(Parameter::Gamma),
        Slot::Parameter(Parameter::ThetaR),
        Slot::Parameter(offset),
    ];
    let mut free = free(&slots, 3, &[1.05_f64.powi(2), 0.06, 0.01, 0.0]);
    free.push(Free { places: vec![(2, Slot::Parameter(Parameter::Phase))], start: 0.2 });
    let truth = vec![1.0, 0.02, 0.03, 0.01, 0.0];
    (Problem::new(records, free, TOLERANCE).expect("a problem"), truth)
}

#[test]
fn parameters_are_found_again_from_far() {
    let (problem, truth) = several();
    let cancel = AtomicBool::new(false);
    // Frequency off by 5 %, damping by a factor of 3.
    let settings = Settings { gain: 1e-20, ..Settings::default() };
    let found = fit(&problem, settings, None, &cancel).expect("a fit");
    assert!(found.converged && found.stages > 2);
    for (value, truth) in found.point.values.iter().zip(&truth) {
        assert!((value - truth).abs() < 1e-8, "{:?}", found.point.values);
    }
    let of = |record: usize| found.point.windows.iter().filter(|w| w.record == record).count();
    assert_eq!([of(0), of(1), of(2)], [1, 1, 3]);
}

#[test]
fn initial_states_are_eliminated_exactly() {
    let (mut problem, truth) = several();
    for record in &mut problem.records {
        for (k, reading) in record.readings.iter_mut().enumerate() {
            *reading += 0.01 * noise(k);
        }
    }
    let at = |record: usize, sample: usize| {
        let record = &problem.records[record];
        pendmap::fit::window::guess(record, sample)
    };
    let windows = windows_of(&problem, 9.0, at);
    assert!(windows.len() > 12);
    let point = Point::new(&problem, truth.clone(), windows.clone()).expect("a point");
    // The whole problem: all parameters and all initial states at once.
    let count = truth.len() + 2 * windows.len();
    let mut rows: Vec<f64> = Vec::new();
    let mut right = Vec::new();
    for (index, window) in windows.iter().enumerate() {
        let linear = line(&problem, &truth, window);
        let places: Vec<usize> = problem.columns(window.record).places().collect();
        for (k, residual) in linear.residuals.iter().enumerate() {
            let mut row = vec![0.0; count];
            for (place, slope) in places.iter().zip(linear.row(k)) {
                row[*place] = *slope;
            }
            for of in 0..2 {
                row[truth.len() + 2 * index + of] = linear.row(k)[places.len() + of];
            }
            rows.extend(row);
            right.push(*residual);
        }
    }
    let matrix = DMatrix::from_row_slice(right.len(), count, &rows);
    let right = DVector::from_vec(right);
    let whole = matrix.clone().svd(true, true).solve(&right, 1e-14).expect("a solution");
    let step = point.normal.step(0.0, &[]);
    let flat: Vec<f64> =
        step.values.iter().copied().chain(step.starts.into_iter().flatten()).collect();
    for (a, b) in flat.iter().zip(whole.iter()) {
        assert!((a - b).abs() < 1e-9 * whole.amax(), "{a} {b}");
    }
    let gain = right.norm_squared() - (&right - &matrix * &whole).norm_squared();
    assert!((step.gain - gain).abs() < 1e-9 * gain, "{} {gain}", step.gain);
    let covariance = (matrix.transpose() * &matrix).try_inverse().expect("regular");
    let own = point.normal.covariance();
    for i in 0..truth.len() {
        for j in 0..truth.len() {
            let size = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            assert!((own[(i, j)] - covariance[(i, j)]).abs() < 1e-7 * size);
        }
    }
}

#[test]
fn chaotic_motion_takes_no_digits_from_the_covariance() {
    // The information of the state exceeds that of the parameters 1e10 times.
    let pendulum = driven(0.05, 1.7, 0.87).with_friction(0.02).expect("in range");
    let start = [1.0, 0.4];
    let record = record(pendulum, None, start, 45.0);
    let (slots, values) = everything(&record.pendulum);
    let count = record.times.len();
    let problem =
        Problem::new(vec![record], free(&slots, 1, &values), TOLERANCE).expect("a problem");
    let window = Window { record: 0, from: 0, to: count, start };
    let linear = line(&problem, &values, &window);
    let matrix = DMatrix::from_row_slice(count, linear.width, &linear.rows);
    let growth = matrix.column(values.len()).amax();
    assert!(growth > 100.0, "{growth}");
    let scale = DVector::from_iterator(linear.width, matrix.column_iter().map(|c| c.norm()));
    let scaled = DMatrix::from_fn(count, linear.width, |i, j| matrix[(i, j)] / scale[j]);
    let whole = scaled.svd(false, true);
    let right = whole.v_t.expect("asked for");
    let own = Normal::at(&problem, &values, &[window]).expect("equations").covariance();
    for k in 0..values.len() {
        let sum: f64 = (0..linear.width)
            .map(|j| (right[(j, k)] / whole.singular_values[j] / scale[k]).powi(2))
            .sum();
        let ratio = own[(k, k)] / sum;
        assert!((ratio - 1.0).abs() < 1e-5, "{k}: {ratio}");
    }
}

#[test]
fn intervals_end_where_the_profile_exceeds_the_level() {
    let (mut problem, _) = several();
    let sigma = 0.3 / 12_f64.sqrt();
    for record in &mut problem.records {
        for (k, reading) in record.readings.iter_mut().enumerate() {
            *reading += 0.3 * noise(k);
        }
        record.weights.fill(1.0 / sigma);
    }
    let cancel = AtomicBool::new(false);
    let found = fit(&problem, Settings::default(), None, &cancel).expect("a fit").point;
    let level = 3.84;
    let ends = intervals(&problem, &found, &[0, 1, 2, 3, 4], level, &cancel).expect("intervals");
    let errors = found.normal.covariance();
    for (which, ends) in ends.iter().enumerate() {
        for end in ends {
            let mut held = found.clone();
            held.values[which] = *end;
            held = Point::new(&problem, held.values, held.windows).expect("a point");
            let limit = Limit { gain: 1e-6, part: 0.0, steps: 50, target: f64::INFINITY };
            descend(&problem, &mut held, &[which], limit, &cancel).expect("converges");
            let rise = held.normal.chi2 - found.normal.chi2;
            assert!((rise - level).abs() < 0.05, "{which}: {end} {rise}");
            let width = (end - found.values[which]).abs() / errors[(which, which)].sqrt();
            assert!((1.5..2.5).contains(&width), "{which}: {width} standard errors");
        }
    }
}

#[test]
fn a_stuck_pendulum_determines_only_its_angle() {
    // At rest throughout: angle and offset are degenerate, other parameters undetermined.
    let pendulum = with(undriven(0.1, 0.0), &[(Kind::EncoderOffset, &[0.0])]);
    let pendulum = pendulum.with_friction(0.2).expect("in range");
    let record = record(pendulum, None, [0.05, 0.0], 20.0);
    let count = record.times.len();
    let slots =
        [Slot::Gravity, Slot::Parameter(Parameter::Gamma), Slot::Parameter(Parameter::ThetaR)];
    let problem =
        Problem::new(vec![record], free(&slots, 1, &[1.0, 0.1, 0.2]), 1e-9).expect("a problem");
    let window = Window { record: 0, from: 0, to: count, start: [0.07, 0.0] };
    let normal = Normal::at(&problem, &[1.0, 0.1, 0.2], &[window]).expect("equations");
    let step = normal.step(0.0, &[]);
    assert!(step.values.iter().all(|value| *value == 0.0));
    assert!((step.starts[0][0] + 0.02).abs() < 1e-12 && step.starts[0][1] == 0.0);
    let covariance = normal.covariance();
    assert!((0..3).all(|k| covariance[(k, k)].is_infinite()));
}

#[test]
fn a_gap_in_trust_is_bridged() {
    let (mut problem, truth) = several();
    problem.records.truncate(1);
    problem.free.truncate(4);
    for free in &mut problem.free {
        free.places.truncate(1);
    }
    for k in 200..320 {
        problem.records[0].readings[k] = 7.0;
        problem.records[0].weights[k] = 0.0;
    }
    let cancel = AtomicBool::new(false);
    let settings = Settings { gain: 1e-20, ..Settings::default() };
    let found = fit(&problem, settings, None, &cancel).expect("a fit").point;
    assert_eq!(found.windows.len(), 1);
    for (value, truth) in found.values.iter().zip(&truth) {
        assert!((value - truth).abs() < 1e-8, "{:?}", found.values);
    }
}

#[test]
fn invalid_fits_are_refused() {
    let (problem, _) = several();
    let refusal = |change: &dyn Fn(&mut Vec<Record>, &mut Vec<Free>)| {
        let (mut records, mut free) = (problem.records.clone(), problem.free.clone());
        change(&mut records, &mut free);
        Problem::new(records, free, 1e-9).expect_err("refused").to_string()
    };
    assert!(refusal(&|r, _| r[0].times[3] = r[0].times[2]).contains("after the one before"));
    assert!(refusal(&|r, _| r[0].readings[3] = f64::NAN).contains("reading or weight"));
    assert!(refusal(&|r, _| r[1].weights[3] = -1.0).contains("weight must be 0 or more, got -1"));
    assert!(refusal(&|r, _| r[1].weights.fill(0.0)).contains("trusted samples"));
    assert!(
        refusal(&|r, _| {
            r[1].weights.pop();
        })
        .contains("weights must be as many")
    );
    assert!(refusal(&|_, f| f[0].start = f64::INFINITY).contains("start of a free parameter"));
    assert!(refusal(&|_, f| f[0].places.push((9, Slot::Gravity))).contains("record of a free"));
    let none = Slot::Parameter(Parameter::OfEffect { effect: 40, place: 0 });
    assert!(refusal(&|_, f| f[0].places[0].1 = none).contains("one of the model"));
    let cancel = AtomicBool::new(true);
    assert!(fit(&problem, Settings::default(), None, &cancel).is_err());
}
