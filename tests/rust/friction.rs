//! Coulomb friction in lanes: turns, sticks and releases, against reference values.

use std::f64::consts::TAU;

use pendmap::integrate::Strobe;
use pendmap::integrate::accuracy::distance;
use pendmap::model::Pendulum;

use crate::support::{driven, path, paths, spread};
use crate::truths::{list, number, truths};

fn rubbing(gamma: f64, p: f64, omega: f64, theta_r: f64) -> Pendulum {
    driven(gamma, p, omega).with_friction(theta_r).expect("in range")
}

#[test]
fn sticks_and_slips_under_drive_end_where_they_should() {
    for path in paths() {
        for truth in list(&truths()["stick_slip"]) {
            let get = |key: &str| number(&truth[key]);
            let pendulum = rubbing(get("gamma"), get("p"), get("omega"), get("theta_r"));
            let strobe = Strobe::new(&pendulum, 200, path);
            let (mut theta, mut velocity, mut turns) = ([get("theta0")], [get("v0")], [0.0]);
            let periods = get("periods") as usize;
            strobe.advance(&mut theta, &mut velocity, &mut turns, periods).expect("lengths");
            let found = [theta[0] + TAU * turns[0], velocity[0]];
            let error = distance(found, [get("theta"), get("v")]);
            assert!(error < 1e-8, "{path}: {error:e} at {truth}");
        }
    }
}

#[test]
fn timing() {
    for (gamma, p, omega, theta_r) in [(0.02, 1.0, 2.0, 0.05), (0.1, 1.5, 0.87, 0.2)] {
        for th in [0.0, theta_r] {
            let pendulum = rubbing(gamma, p, omega, th);
            let steps = if omega > 1.0 { 33 } else { 70 };
            let strobe = Strobe::new(&pendulum, steps, path());
            let states = spread(15360, 3.14, 3.0);
            let mut theta: Vec<f64> = states.iter().map(|s| s[0]).collect();
            let mut velocity: Vec<f64> = states.iter().map(|s| s[1]).collect();
            let mut turns = vec![0.0; states.len()];
            let begin = std::time::Instant::now();
            strobe.advance(&mut theta, &mut velocity, &mut turns, 20).expect("lengths");
            let ns = begin.elapsed().as_nanos() as f64 / 15360.0 / 20.0;
            let stuck = velocity.iter().filter(|v| **v == 0.0).count();
            let bad = velocity.iter().filter(|v| !v.is_finite()).count();
            eprintln!("{gamma} {p} {omega} {th}: {ns:.1} ns, stuck {stuck} bad {bad}");
        }
    }
}
