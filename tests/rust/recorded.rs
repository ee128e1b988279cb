//! A recorded motion of the pivot.

use std::sync::Arc;

use pendmap::integrate::State;
use pendmap::integrate::reference::driver::Driver;
use pendmap::integrate::reference::event::EventKind;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::integrate::reference::sample::sample;
use pendmap::model::Pendulum;
use pendmap::model::recorded::{Quantity, Recorded, Samples};

use crate::support::{driven, undriven};

/// Unequal times from `from` to `to`.
fn times(from: f64, to: f64, count: usize) -> Vec<f64> {
    let last = (count - 1) as f64;
    (0..count)
        .map(|k| {
            let part = k as f64 / last;
            from + (to - from) * (part + 0.3 / last * (7.0 * k as f64).sin() * part * (1.0 - part))
        })
        .collect()
}

fn values(times: &[f64], of: impl Fn(f64) -> f64) -> Vec<f64> {
    times.iter().map(|time| of(*time)).collect()
}

#[test]
fn polynomials_of_degree_five_come_out_exactly() {
    let times = times(-1.0, 2.0, 23);
    let position =
        |t: f64| 0.3 - t + 0.5 * t * t - 0.7 * t.powi(3) + 0.2 * t.powi(4) + 0.1 * t.powi(5);
    let velocity = |t: f64| -1.0 + t - 2.1 * t * t + 0.8 * t.powi(3) + 0.5 * t.powi(4);
    let acceleration = |t: f64| 1.0 - 4.2 * t + 2.4 * t * t + 2.0 * t.powi(3);
    for (quantity, sampled) in [
        (Quantity::Position, values(&times, position)),
        (Quantity::Velocity, values(&times, velocity)),
        (Quantity::Acceleration, values(&times, acceleration)),
    ] {
        let samples = Samples { quantity, values: &sampled };
        let recorded = Recorded::new(&times, Some(samples), Some(samples)).expect("samples");
        for k in 0..=300 {
            let time = -1.0 + 0.01 * f64::from(k);
            for found in recorded.acceleration(time) {
                let error = (found - acceleration(time)).abs();
                assert!(error < 1e-10, "{quantity:?} at {time}: {error:e}");
            }
        }
    }
}

#[test]
fn a_recorded_harmonic_motion_drives_as_the_harmonic_drive() {
    let (p, omega) = (1.1, 1.7);
    let until = 20.0;
    let pendulum = driven(0.1, p, omega).with_friction(0.05).expect("in range");
    let still = Pendulum { drive: undriven(0.1, 0.0).drive, ..pendulum.clone() };
    let ode = OdeProblem::new(&pendulum, true, 1e-13, |_, value| value);
    let mut direct = Driver::new(&ode, 0.0, [1.0, 0.0], until);
    direct.finish(|_| ());
    let times = times(-0.5, until + 0.5, 1500);
    let cases = [
        (Quantity::Acceleration, values(&times, |t| p * (omega * t).cos()), 1e-10),
        (Quantity::Velocity, values(&times, |t| p / omega * (omega * t).sin()), 1e-9),
        (Quantity::Position, values(&times, |t| -p / omega.powi(2) * (omega * t).cos()), 2e-6),
    ];
    for (quantity, sampled, allowed) in cases {
        let samples = Samples { quantity, values: &sampled };
        let recorded = Recorded::new(&times, Some(samples), None).expect("samples");
        let ode =
            OdeProblem::new(&still, true, 1e-13, |_, value| value).driven_by(Arc::new(recorded));
        let mut driver = Driver::new(&ode, 0.0, [1.0, 0.0], until);
        driver.finish(|_| ());
        let error = distance(driver.state, direct.state);
        assert!(error < allowed, "{quantity:?}: {error:e}");
        assert_eq!(driver.events.len(), direct.events.len());
        for (a, b) in driver.events.iter().zip(&direct.events) {
            assert_eq!(a.kind, b.kind);
            assert!((a.tau - b.tau).abs() < 100.0 * allowed, "{a:?} {b:?}");
        }
    }
}

fn distance(a: State, b: State) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn a_pivot_pushed_to_one_side_leaves_the_pendulum_behind() {
    // In the frame of a pivot with acceleration l toward positive theta gravity points to -atan l.
    let times = times(0.0, 200.0, 400);
    let side = values(&times, |t| 0.5 * 0.4 * t * t);
    let samples = Samples { quantity: Quantity::Position, values: &side };
    let recorded = Arc::new(Recorded::new(&times, None, Some(samples)).expect("samples"));
    let ode =
        OdeProblem::new(&undriven(0.4, 0.0), true, 1e-12, |_, value| value).driven_by(recorded);
    let end = sample(&ode, 0.0, [0.3, 0.0], &[190.0], |_, _| true).states[0];
    assert!(distance(end, [-0.4_f64.atan(), 0.0]) < 1e-8, "{end:?}");
}

#[test]
fn a_recorded_push_frees_a_stuck_pendulum_when_it_is_strong_enough() {
    // The sideways acceleration 0.01 t exceeds a friction of 0.3 at th = 0 at t = 30.
    let times = times(0.0, 60.0, 300);
    let side = values(&times, |t| 0.01 * t);
    let samples = Samples { quantity: Quantity::Acceleration, values: &side };
    let recorded = Arc::new(Recorded::new(&times, None, Some(samples)).expect("samples"));
    let pendulum = undriven(0.1, 0.0).with_friction(0.3).expect("in range");
    let ode = OdeProblem::new(&pendulum, true, 1e-12, |_, value| value).driven_by(recorded);
    let mut driver = Driver::new(&ode, 0.0, [0.0, 0.0], 40.0);
    driver.finish(|_| ());
    let kinds: Vec<EventKind> = driver.events.iter().map(|event| event.kind).collect();
    assert_eq!(kinds[..2], [EventKind::Stick, EventKind::Release]);
    assert!((driver.events[1].tau - 30.0).abs() < 1e-10, "{:?}", driver.events);
    assert!(driver.state[0] < 0.0, "it stays behind the pivot");
    // Times after the end are not examined: "for ever" cannot be reported.
    let mut short = Driver::new(&ode, 0.0, [0.0, 0.0], 20.0);
    short.finish(|_| ());
    assert!(short.is_stuck() && !short.is_stuck_for_ever());
}

fn positions(values: &[f64]) -> Samples<'_> {
    Samples { quantity: Quantity::Position, values }
}

#[test]
fn invalid_samples_are_refused() {
    let good = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
    let refusal = |times: &[f64], values: &[f64]| {
        Recorded::new(times, Some(positions(values)), None).expect_err("refused").to_string()
    };
    assert!(Recorded::new(&good, Some(positions(&good)), None).is_ok());
    assert!(refusal(&good[..5], &good[..5]).contains("6 or more"));
    assert!(refusal(&[0.0, 1.0, 2.0, 2.0, 4.0, 5.0], &good).contains("after the one before"));
    assert!(refusal(&[0.0, 1.0, 2.0, 3.0, 4.0, f64::NAN], &good).contains("time of a sample"));
    assert!(refusal(&good, &good[..5]).contains("got 6 and 5"));
    assert!(
        refusal(&good, &[0.0, 1.0, f64::INFINITY, 3.0, 4.0, 5.0])
            .ends_with("sample must be a finite number, got inf")
    );
}
