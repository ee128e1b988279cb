//! Free decays under viscous damping and Coulomb friction: peaks, their times, the rest position.

use std::f64::consts::PI;

use pendmap::integrate::reference::driver::Driver;
use pendmap::integrate::reference::event::{Event, EventKind};
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::model::Pendulum;
use serde_json::Value;

use crate::truths::{list, number, numbers, truths};

/// Turns and stick after a release from rest, with time in 1/w0.
fn decay(gamma: f64, theta_r: f64, theta: f64) -> Vec<Event> {
    let pendulum = Pendulum::new(gamma, 0.0, 1.0, 0.0, 0.0).expect("in range");
    let pendulum = pendulum.with_friction(theta_r).expect("in range");
    let ode = OdeProblem::new(&pendulum, true, 1e-15, |_, value| value);
    let mut driver = Driver::new(&ode, 0.0, [theta, 0.0], 1e4);
    driver.finish(|_| ());
    assert!(driver.is_stuck_for_ever());
    driver.events
}

/// `gamma` and `theta_r` of an entry in SI.
fn model(entry: &Value) -> (f64, f64) {
    (2.0 * number(&entry["zeta"]), number(&entry["Tr"]) / number(&entry["w0"]).powi(2))
}

#[test]
fn a_large_decay_has_the_known_peaks() {
    for entry in list(&truths()["free_decay"]["nonlinear"]) {
        let w0 = number(&entry["w0"]);
        let (gamma, theta_r) = model(entry);
        let events = decay(gamma, theta_r, number(&entry["theta0"]));
        let (times, thetas) = (numbers(&entry["times"]), numbers(&entry["thetas"]));
        // The release is no event; the last peak is a permanent stick.
        assert_eq!(events.len(), times.len());
        for ((event, time), theta) in events.iter().zip(&times[1..]).zip(&thetas[1..]) {
            assert!((event.tau / w0 - time).abs() < 1e-10, "{event:?} at {time}");
            assert!((event.theta - theta).abs() < 1e-11, "{event:?} at {theta}");
        }
        let (stick, turns) = events[..events.len() - 1].split_last().expect("events");
        assert!(turns.iter().all(|turn| turn.kind == EventKind::Turn));
        assert_eq!(stick.kind, EventKind::Stick);
        assert!(stick.theta.sin().abs() <= theta_r);
    }
}

#[test]
fn small_decays_obey_the_exact_law_of_half_cycles() {
    // The law is exact for th in place of sin th. With angles and friction scaled by s, the
    // pendulum differs from it by a term in s^2, which two scales eliminate.
    let scales = [1.0 / 1024.0, 1.0 / 2048.0];
    for entry in list(&truths()["free_decay"]["linear"]) {
        let (gamma, theta_r) = model(entry);
        let theta = number(&entry["theta0"]);
        let [large, small] = scales.map(|s| decay(gamma, s * theta_r, s * theta));
        let peaks = numbers(&entry["peaks_abs"]);
        let count = number(&entry["n_half_cycles"]) as usize;
        assert_eq!(large.len(), count + 1, "half cycles, and that it sticks for ever");
        let half = PI / (1.0 - number(&entry["zeta"]).powi(2)).sqrt();
        for (k, (large, small)) in large.iter().zip(&small).take(count).enumerate() {
            let extrapolated = |large: f64, small: f64| (4.0 * small - large) / 3.0;
            let peak = extrapolated(large.theta / scales[0], small.theta / scales[1]);
            let time = extrapolated(large.tau, small.tau);
            // Even and odd peaks alternate; a last one that does not cross zero is negative.
            let expected = if k % 2 == 0 { -peaks[k + 1] } else { peaks[k + 1] };
            assert!((peak - expected).abs() < 1e-11, "peak {k}: {peak} {expected}");
            assert!((time - (k + 1) as f64 * half).abs() < 1e-9, "peak {k} at {time}");
        }
        let stick = large[count].theta / scales[0];
        let expected = number(&entry["stick_theta_signed"]);
        assert!((stick - expected).abs() < 1e-7, "{stick} {expected}");
    }
}
