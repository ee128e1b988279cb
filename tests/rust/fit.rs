//! Fits: derivatives against finite differences, the eliminated equations against the whole ones,
//! parameters found again.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::{DMatrix, DVector};
use pendmap::fit::descent::{Limit, Point, descend};
use pendmap::fit::linear::{Linear, linearise};
use pendmap::fit::normal::Normal;
use pendmap::fit::profile::intervals;
use pendmap::fit::window::{Window, cut};
use pendmap::fit::{Free, Problem, Record, Settings, Slot, fit};
use pendmap::integrate::State;
use pendmap::integrate::course::Course;
use pendmap::integrate::event::EventKind;
use pendmap::integrate::sample::sample;
use pendmap::model::recorded::{Quantity, Samples};
use pendmap::model::{Effect, Kind, Observation, Pendulum, Recorded};

use crate::support::{driven, undriven};

const TOLERANCE: f64 = 1e-13;

fn every(interval: f64, until: f64) -> Vec<f64> {
    (0..=(until / interval) as usize).map(|k| k as f64 * interval).collect()
}

fn with(pendulum: Pendulum, effects: &[(Kind, &[f64])]) -> Pendulum {
    effects.iter().fold(pendulum, |pendulum, (kind, values)| {
        pendulum.with_effect(Effect::new(*kind, values).expect("in range")).expect("once")
    })
}

/// A record of `pendulum` without noise.
fn record(pendulum: Pendulum, recorded: Option<Arc<Recorded>>, start: State, until: f64) -> Record {
    let times = every(0.06, until);
    let mut course = Course::new(&pendulum, true, 1e-14, |_, value| value);
    if let Some(recorded) = &recorded {
        course = course.driven_by(Arc::clone(recorded));
    }
    let states = sample(&course, 0.0, start, &times, |_, _| true).states;
    let sensor = Observation::lift(&pendulum, |_, value| value);
    let readings = states.iter().map(|state| sensor.read(state[0])).collect();
    let weights = vec![1.0; times.len()];
    Record { pendulum, recorded, times, readings, weights, longest: f64::INFINITY }
}

/// The same parameters free in all records.
fn free(slots: &[Slot], records: usize, start: &[f64]) -> Vec<Free> {
    let all = |slot: &Slot| (0..records).map(|record| (record, *slot)).collect();
    slots.iter().zip(start).map(|(slot, start)| Free { places: all(slot), start: *start }).collect()
}

/// Gravity, then all parameters of the pendulum, and their values.
fn everything(pendulum: &Pendulum) -> (Vec<Slot>, Vec<f64>) {
    let parameters = pendulum.parameters();
    let slots = (0..parameters.len()).map(Slot::Parameter);
    let values = parameters.iter().map(|(_, value)| *value);
    (
        std::iter::once(Slot::Gravity).chain(slots).collect(),
        std::iter::once(1.0).chain(values).collect(),
    )
}

fn line(problem: &Problem, values: &[f64], window: &Window) -> Linear {
    let shaped = problem.shaped(window.record, values).expect("in range");
    linearise(problem, &shaped, &problem.columns(window.record), window)
}

/// The largest difference of the rows from finite differences, over the size of the column or 1.
fn worst(record: Record, values: Option<Vec<f64>>, start: State) -> f64 {
    let (slots, own) = everything(&record.pendulum);
    let values = values.unwrap_or(own);
    let count = record.times.len();
    let problem =
        Problem::new(vec![record], free(&slots, 1, &values), TOLERANCE).expect("a problem");
    let window = Window { record: 0, from: 0, to: count, start };
    let found = line(&problem, &values, &window);
    let columns = problem.columns(0);
    let places: Vec<usize> = columns.places().collect();
    let mut worst = 0_f64;
    for column in 0..found.width {
        let residuals = |h: f64| {
            let (mut values, mut window) = (values.clone(), window);
            match places.get(column) {
                Some(place) => values[*place] += h,
                None => window.start[column - places.len()] += h,
            }
            line(&problem, &values, &window).residuals
        };
        let [a, b, c, d] = [2e-5, -2e-5, 1e-5, -1e-5].map(residuals);
        let size = (0..count).map(|k| found.row(k)[column].abs()).fold(1.0, f64::max);
        for k in 0..count {
            let (coarse, fine) = ((b[k] - a[k]) / 4e-5, (d[k] - c[k]) / 2e-5);
            let expected = (4.0 * fine - coarse) / 3.0;
            worst = worst.max((found.row(k)[column] - expected).abs() / size);
        }
    }
    worst
}

#[test]
fn derivatives_hold_for_a_decay_to_rest() {
    let pendulum = with(
        undriven(0.02, 0.003).with_friction(0.05).expect("in range"),
        &[
            (Kind::EncoderOffset, &[0.01]),
            (Kind::EncoderGain, &[0.02]),
            (Kind::EncoderEccentricity, &[0.03, 0.4]),
            (Kind::LoadDependentFriction, &[0.01]),
            (Kind::QuadraticDrag, &[0.004]),
        ],
    );
    let start = [2.0, -0.1];
    let record = record(pendulum, None, start, 90.0);
    let last = record.readings.len() - 1;
    assert!((record.readings[last] - record.readings[last - 50]).abs() < 1e-12, "at rest");
    let mut values = everything(&record.pendulum).1;
    let error = worst(record.clone(), None, start);
    assert!(error < 1e-6, "{error:e}");
    // Away from its own frequency too.
    values[0] = 1.21;
    let error = worst(record, Some(values), start);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn derivatives_hold_for_forced_motion_with_sticks() {
    let pendulum = with(
        driven(0.1, 1.5, 0.87).with_friction(0.2).expect("in range"),
        &[(Kind::DriveFrequency, &[0.01]), (Kind::EncoderGain, &[0.01])],
    );
    let start = [-0.43, 1.03];
    let error = worst(record(pendulum, None, start, 15.0), None, start);
    assert!(error < 1e-6, "{error:e}");
}

fn shaken() -> Arc<Recorded> {
    let times = every(0.05, 40.0);
    let up: Vec<f64> = times.iter().map(|t| 0.9 * (1.3 * t).cos()).collect();
    let side: Vec<f64> = times.iter().map(|t| 0.5 * (0.8 * t).sin()).collect();
    let samples = |values| Some(Samples { quantity: Quantity::Acceleration, values });
    Arc::new(Recorded::new(&times, samples(&up), samples(&side)).expect("samples"))
}

#[test]
fn derivatives_hold_under_a_recorded_motion() {
    let pendulum = undriven(0.1, 0.0).with_friction(0.3).expect("in range");
    let start = [1.0, 0.4];
    let error = worst(record(pendulum, Some(shaken()), start, 20.0), None, start);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn derivatives_hold_where_friction_is_negative() {
    // What is missing in a model may ask for that.
    let mut pendulum = with(undriven(0.05, 0.0), &[(Kind::QuadraticDrag, &[0.1])]);
    pendulum.set_parameter(1, -0.01);
    let start = [1.5, 0.0];
    let record = record(pendulum.clone(), None, [1.5, -0.2], 30.0);
    let turns = {
        let course = Course::new(&pendulum, true, TOLERANCE, |_, value| value);
        sample(&course, 0.0, start, &[30.0], |_, _| true).events
    };
    assert!(turns.len() > 8 && turns.iter().all(|event| event.kind == EventKind::Turn));
    let error = worst(record, None, [1.5, -0.2]);
    assert!(error < 1e-6, "{error:e}");
}

/// Gravity `s` in a fixed unit of time is another unit of time.
#[test]
fn gravity_is_the_square_of_the_frequency() {
    let pendulum = with(
        driven(0.1, 1.5, 0.87).with_friction(0.2).expect("in range"),
        &[(Kind::LoadDependentFriction, &[0.05]), (Kind::QuadraticDrag, &[0.02])],
    );
    let gravity = 1.3_f64;
    let ratio = gravity.sqrt();
    let mut slow = pendulum.clone();
    // In units of the reference: rates times w0 / w_ref, torques times its square.
    slow.gamma *= ratio;
    slow.theta_r *= gravity;
    slow.drive.omega *= ratio;
    slow.effects[0].parameters[0] *= gravity;
    let times = every(0.5, 30.0);
    let run = |pendulum: &Pendulum, gravity: f64, start: State, times: &[f64]| {
        let course = Course::new(pendulum, true, 1e-14, |_, value| value).with_gravity(gravity);
        sample(&course, 0.0, start, times, |_, _| true)
    };
    let own = run(&pendulum, 1.0, [-0.43, 1.03], &times);
    assert!(own.events.iter().any(|event| event.kind == EventKind::Release));
    let scaled: Vec<f64> = times.iter().map(|time| time / ratio).collect();
    let other = run(&slow, gravity, [-0.43, 1.03 * ratio], &scaled);
    for (a, b) in own.states.iter().zip(&other.states) {
        assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1] / ratio).abs() < 1e-9, "{a:?} {b:?}");
    }
    assert_eq!(own.events.len(), other.events.len());
}

fn noise(k: usize) -> f64 {
    // Not random, but like nothing in the model.
    ((k as f64 * 12.9898).sin() * 43_758.545_3).fract() - 0.5
}

/// Three records, one of them forced, and the wrong values to start from.
fn several() -> (Problem, Vec<f64>) {
    let gain: (Kind, &[f64]) = (Kind::EncoderOffset, &[0.01]);
    let own = |p: f64| with(driven(0.02, p, 2.1).with_friction(0.03).expect("in range"), &[gain]);
    let mut records = vec![
        record(own(0.0), None, [2.8, -0.01], 60.0),
        record(own(0.0), None, [1.2, 0.3], 40.0),
        record(own(0.4), None, [1.0, 0.2], 40.0),
    ];
    records[2].longest = 15.0;
    let slots = [Slot::Gravity, Slot::Parameter(0), Slot::Parameter(1), Slot::Parameter(6)];
    let mut free = free(&slots, 3, &[1.05_f64.powi(2), 0.06, 0.01, 0.0]);
    free.push(Free { places: vec![(2, Slot::Parameter(5))], start: 0.2 });
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
    let windows = cut(&problem, 9.0, at);
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
    // The state's part of the information is 1e10 times what is left of the parameters' part.
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
fn intervals_end_where_the_best_of_the_rest_is_that_much_worse() {
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
            let limit = Limit { gain: 1e-6, part: 0.0, steps: 50 };
            descend(&problem, &mut held, &[which], limit, &cancel).expect("converges");
            let rise = held.normal.chi2 - found.normal.chi2;
            assert!((rise - level).abs() < 0.05, "{which}: {end} {rise}");
            let width = (end - found.values[which]).abs() / errors[(which, which)].sqrt();
            assert!((1.5..2.5).contains(&width), "{which}: {width} standard errors");
        }
    }
}

#[test]
fn what_is_stuck_says_where_it_is_and_no_more() {
    // At rest all along: angle and offset are one number, nothing is said about the rest.
    let pendulum = with(undriven(0.1, 0.0), &[(Kind::EncoderOffset, &[0.0])]);
    let pendulum = pendulum.with_friction(0.2).expect("in range");
    let record = record(pendulum, None, [0.05, 0.0], 20.0);
    let count = record.times.len();
    let slots = [Slot::Gravity, Slot::Parameter(0), Slot::Parameter(1)];
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
fn what_cannot_be_fitted_is_refused() {
    let (problem, _) = several();
    let refusal = |change: &dyn Fn(&mut Vec<Record>, &mut Vec<Free>)| {
        let (mut records, mut free) = (problem.records.clone(), problem.free.clone());
        change(&mut records, &mut free);
        Problem::new(records, free, 1e-9).expect_err("refused").to_string()
    };
    assert!(refusal(&|r, _| r[0].times[3] = r[0].times[2]).contains("after the one before"));
    assert!(refusal(&|r, _| r[0].readings[3] = f64::NAN).contains("reading or weight"));
    assert!(refusal(&|r, _| r[1].weights[3] = -1.0).contains("weight is -1"));
    assert!(refusal(&|r, _| r[1].weights.fill(0.0)).contains("trusted samples"));
    assert!(
        refusal(&|r, _| {
            r[1].weights.pop();
        })
        .contains("weights has")
    );
    assert!(refusal(&|_, f| f[0].start = f64::INFINITY).contains("start of a free parameter"));
    assert!(refusal(&|_, f| f[0].places.push((9, Slot::Gravity))).contains("record of a free"));
    assert!(refusal(&|_, f| f[0].places[0].1 = Slot::Parameter(40)).contains("place of a free"));
    let cancel = AtomicBool::new(true);
    assert!(fit(&problem, Settings::default(), None, &cancel).is_err());
}
