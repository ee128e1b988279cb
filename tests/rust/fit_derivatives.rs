//! Fits: derivatives against finite differences, gravity against another unit of time.

use std::sync::Arc;

use pendmap::fit::linear::Linear;
use pendmap::fit::window::Window;
use pendmap::fit::{Problem, Record, RodSensor, Slot};
use pendmap::integrate::State;
use pendmap::integrate::reference::event::EventKind;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::integrate::reference::sample::sample;
use pendmap::lanes::InstructionSet;
use pendmap::model::recorded::{Quantity, Samples};
use pendmap::model::{Kind, Parameter, Pendulum, Recorded};

use crate::fit_records::{TOLERANCE, every, everything, free, line, record, with};
use crate::support::{driven, instruction_sets, undriven};

/// The largest difference of the rows from finite differences, over the size of the column or 1, on
/// all instruction sets of this processor.
fn worst(record: Record, values: Option<Vec<f64>>, start: State) -> f64 {
    let (mut slots, mut own) = everything(&record.pendulum);
    if let Some(sensor) = record.rod_sensor {
        slots.push(Slot::Bias);
        own.push(sensor.bias);
    }
    let values = values.unwrap_or(own);
    let count = record.times.len();
    let mut problem =
        Problem::new(vec![record], free(&slots, 1, &values), TOLERANCE).expect("a problem");
    let window = Window { record: 0, from: 0, to: count, start };
    let mut worst = 0_f64;
    for simd in instruction_sets() {
        problem.simd = simd;
        worst = worst.max(worst_of(&problem, &values, window));
    }
    worst
}

fn worst_of(problem: &Problem, values: &[f64], window: Window) -> f64 {
    let count = window.to;
    let found = line(problem, values, &window);
    let columns = problem.columns(0);
    let places: Vec<usize> = columns.places().collect();
    let mut worst = 0_f64;
    for column in 0..found.width {
        let residuals = |h: f64| {
            let (mut values, mut window) = (values.to_vec(), window);
            match places.get(column) {
                Some(place) => values[*place] += h,
                None => window.start[column - places.len()] += h,
            }
            line(problem, &values, &window).residuals
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
fn instruction_sets_agree_and_passes_have_the_same_motion() {
    // Six directions, and more than one pass can compute; turns, sticks and every stage of the
    // formulas.
    let pendulum = with(
        driven(0.02, 0.5, 2.1).with_friction(0.1).expect("in range"),
        &[
            (Kind::QuadraticDrag, &[0.004]),
            (Kind::PowerLawDrag, &[0.003, 2.5]),
            (Kind::StribeckFriction, &[0.02, 0.3]),
            (Kind::BearingHarmonic, &[0.03, 3.0, 0.4]),
            (Kind::Magnet, &[0.02, 0.2]),
            (Kind::InertiaRipple, &[0.02, 2.0, 0.3]),
        ],
    );
    let (slots, values) = everything(&pendulum);
    assert!(slots.len() + 2 > 16);
    let record = record(pendulum, None, [2.0, 0.1], 40.0);
    let window = Window { record: 0, from: 0, to: record.times.len(), start: [2.0, 0.1] };
    let linear = |count: usize, simd: InstructionSet| {
        let free = free(&slots[..count], 1, &values[..count]);
        let mut problem = Problem::new(vec![record.clone()], free, TOLERANCE).expect("a problem");
        problem.simd = simd;
        line(&problem, &values[..count], &window)
    };
    let all = linear(slots.len(), InstructionSet::Portable);
    for simd in instruction_sets() {
        let [few, many] = [4, slots.len()].map(|count| linear(count, simd));
        assert_eq!(few.states, many.states, "{simd}");
        for column in 0..all.width {
            let of = |linear: &Linear, k: usize| linear.row(k)[column];
            let samples = 0..all.states.len();
            let size = samples.clone().map(|k| of(&all, k).abs()).fold(1.0, f64::max);
            let apart = samples.map(|k| (of(&all, k) - of(&many, k)).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-8 * size, "{simd}, column {column}: {apart:e} of {size:e}");
        }
    }
    if InstructionSet::Avx512.available() {
        let [wide, narrow] =
            [InstructionSet::Avx512, InstructionSet::Avx2].map(|simd| linear(4, simd));
        assert_eq!((wide.states, wide.rows), (narrow.states, narrow.rows));
    }
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
    // Also at other frequencies than its own.
    values[0] = 1.21;
    let error = worst(record, Some(values), start);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn derivatives_hold_for_a_gyroscope() {
    let pendulum = with(
        undriven(0.02, 0.003).with_friction(0.05).expect("in range"),
        &[(Kind::LoadDependentFriction, &[0.01]), (Kind::QuadraticDrag, &[0.004])],
    );
    let start = [2.0, -0.1];
    let mut record = record(pendulum, None, start, 90.0);
    record.angles = Some(record.readings.clone());
    record.rod_sensor = Some(RodSensor { rate: 1.1, bias: 0.01 });
    let error = worst(record, None, start);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn derivatives_hold_where_a_contact_yields() {
    let dahl: (Kind, &[f64]) = (Kind::DahlFriction, &[0.05, 0.1]);
    let start = [1.2, -0.1];
    // Down to swings far smaller than the yield of the contact.
    let decay = with(undriven(0.02, 0.0), &[dahl.clone(), (Kind::QuadraticDrag, &[0.01])]);
    let error = worst(record(decay, None, start, 60.0), None, start);
    assert!(error < 1e-6, "{error:e}");
    // With sticks, and measured by a gyroscope.
    let rubbing = with(driven(0.05, 0.9, 0.87).with_friction(0.1).expect("in range"), &[dahl]);
    let mut record = record(rubbing.clone(), None, start, 30.0);
    let ode = OdeProblem::new(&rubbing, true, TOLERANCE, |_, value| value);
    let events = sample(&ode, 0.0, start, &[30.0], |_, _| true).events;
    assert!(events.iter().any(|event| event.kind == EventKind::Release), "{events:?}");
    let error = worst(record.clone(), None, start);
    assert!(error < 1e-6, "{error:e}");
    record.rod_sensor = Some(RodSensor { rate: 1.0, bias: 0.0 });
    let error = worst(record, None, start);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn derivatives_hold_where_the_pivot_gives_way() {
    let happens = |pendulum: &Pendulum, start: State, until: f64, kind: EventKind| {
        let ode = OdeProblem::new(pendulum, true, TOLERANCE, |_, value| value);
        let events = sample(&ode, 0.0, start, &[until], |_, _| true).events;
        events.iter().filter(|event| event.kind == kind).count()
    };
    let check = |pendulum: Pendulum, start: State, until: f64| {
        let error = worst(record(pendulum, None, start, until), None, start);
        assert!(error < 1e-6, "{error:e}");
    };
    let compliance: (Kind, &[f64]) = (Kind::PivotCompliance, &[0.05, 5.3, 0.03]);
    // Rotating, then swinging without friction.
    check(with(undriven(0.1, 0.01), std::slice::from_ref(&compliance)), [0.4, 2.8], 25.0);
    // Turns at which the acceleration jumps, before a rest on which the mode oscillates.
    let rubbing = with(
        undriven(0.02, 0.0).with_friction(0.06).expect("in range"),
        std::slice::from_ref(&compliance),
    );
    let start = [1.6, -0.1];
    assert!(happens(&rubbing, start, 40.0, EventKind::Turn) > 4);
    assert_eq!(happens(&rubbing, start, 40.0, EventKind::StuckForEver), 1);
    check(rubbing, start, 40.0);
    // With sticks, released by the drive.
    let forced = driven(0.1, 1.5, 0.87).with_friction(0.2).expect("in range");
    let (held, start) = (with(forced, &[compliance]), [-0.43, 1.03]);
    assert!(happens(&held, start, 15.0, EventKind::Release) > 1);
    check(held, start, 15.0);
    // Released by the mode, which continues to oscillate.
    let ringing: (Kind, &[f64]) = (Kind::PivotCompliance, &[0.3, 3.23, 0.01]);
    let base = undriven(0.008, 0.0).with_friction(0.078).expect("in range");
    let (shaken, start) = (with(base, &[ringing]), [0.3, 1.29]);
    assert!(happens(&shaken, start, 40.0, EventKind::Release) > 1);
    check(shaken, start, 40.0);
}

#[test]
fn a_motion_that_asks_for_ever_shorter_steps_is_given_up() {
    let start = [1.6, -0.1];
    let mut record = record(undriven(0.02, 0.0), None, start, 10.0);
    let stiff: (Kind, &[f64]) = (Kind::PivotCompliance, &[0.2, 15.0, 1e4]);
    record.pendulum = with(record.pendulum, &[stiff]);
    let window = Window { record: 0, from: 0, to: record.times.len(), start };
    let problem = Problem::new(vec![record], Vec::new(), TOLERANCE).expect("sound");
    assert!(!line(&problem, &[], &window).chi2.is_finite());
}

#[test]
fn derivatives_hold_for_a_gyroscope_where_the_pivot_gives_way() {
    let compliance: (Kind, &[f64]) = (Kind::PivotCompliance, &[0.05, 5.3, 0.03]);
    let rubbing = with(
        undriven(0.02, 0.0).with_friction(0.06).expect("in range"),
        std::slice::from_ref(&compliance),
    );
    let start = [1.6, -0.1];
    let mut record = record(rubbing, None, start, 20.0);
    record.rod_sensor = Some(RodSensor { rate: 1.0, bias: 0.0 });
    let error = worst(record, None, start);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn derivatives_hold_where_a_sensor_has_play() {
    // No sample is so near the end of the backlash that a difference step crosses it.
    for (theta_r, until) in [(0.004, 40.0), (0.03, 60.0)] {
        let effects: [(Kind, &[f64]); 3] = [
            (Kind::EncoderGain, &[0.02]),
            (Kind::EncoderBacklash, &[0.07]),
            (Kind::DahlFriction, &[0.02, 0.1]),
        ];
        let base = undriven(0.05, 0.0).with_friction(theta_r).expect("in range");
        let start = [1.2, -0.1];
        let record = record(with(base, &effects), None, start, until);
        let last = record.readings.len() - 1;
        let rests = (record.readings[last] - record.readings[last - 50]).abs() < 1e-12;
        assert_eq!(rests, theta_r > 0.01);
        let error = worst(record, None, start);
        assert!(error < 1e-6, "{theta_r}: {error:e}");
    }
}

#[test]
fn a_bias_needs_a_sensor_on_the_rod() {
    let record = record(undriven(0.02, 0.0), None, [1.0, 0.0], 20.0);
    let fault = Problem::new(vec![record], free(&[Slot::Bias], 1, &[0.0]), TOLERANCE);
    assert!(fault.expect_err("no such sensor").to_string().contains("gyroscope"));
}

#[test]
fn derivatives_hold_for_forced_motion_with_sticks() {
    let mut pendulum = with(
        driven(0.1, 1.5, 0.87).with_friction(0.2).expect("in range"),
        &[
            (Kind::DriveFrequency, &[0.01]),
            (Kind::EncoderGain, &[0.01]),
            (Kind::EncoderDrift, &[0.002]),
            (Kind::EddyBrake, &[0.02, 0.8]),
        ],
    );
    pendulum.lab_time = 20.0;
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
    // A missing term of a model may lead there.
    let mut pendulum = with(undriven(0.05, 0.0), &[(Kind::QuadraticDrag, &[0.1])]);
    pendulum.set(Parameter::ThetaR, -0.01);
    let start = [1.5, 0.0];
    let record = record(pendulum.clone(), None, [1.5, -0.2], 30.0);
    let turns = {
        let ode = OdeProblem::new(&pendulum, true, TOLERANCE, |_, value| value);
        sample(&ode, 0.0, start, &[30.0], |_, _| true).events
    };
    assert!(turns.len() > 8 && turns.iter().all(|event| event.kind == EventKind::Turn));
    let error = worst(record, None, [1.5, -0.2]);
    assert!(error < 1e-6, "{error:e}");
}

/// Gravity `s` in a fixed unit of time is equivalent to another unit of time.
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
        let ode = OdeProblem::new(pendulum, true, 1e-14, |_, value| value).with_gravity(gravity);
        sample(&ode, 0.0, start, times, |_, _| true)
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
