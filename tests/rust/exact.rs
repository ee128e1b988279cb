//! Motions with known solutions: in closed form, by a conserved energy, or to 30 digits.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::AtomicBool;

use pendmap::integrate::trajectory::{Request, Trajectory, simulate};
use pendmap::integrate::{Schedule, State};
use pendmap::model::Pendulum;

use crate::support::{along, driven, undriven};
use crate::truths::{list, model, number, numbers, table, truths};

fn run(pendulum: &Pendulum, start: State, until: f64, tol: f64) -> Trajectory {
    let request = Request { start, until, tol, samples: 40, lyapunov: false };
    simulate(pendulum, &request, &AtomicBool::new(false)).expect("a trajectory")
}

fn end(trajectory: &Trajectory) -> State {
    [trajectory.theta[trajectory.theta.len() - 1], *trajectory.velocity.last().expect("a sample")]
}

#[test]
fn small_swings_decay_as_the_linear_oscillator() {
    // At 1e-7 rad the sine equals the angle to within 2e-15 relative.
    let amplitude = 1e-7;
    for gamma in [0.0, 0.1, 1.0, 2.5] {
        let pendulum = undriven(gamma, 0.0);
        for until in [1.0, 7.3, 20.0] {
            let schedule = Schedule::new(&pendulum, 0.0, until, (40.0 * until) as usize);
            let end = along(&schedule, [amplitude, 0.0]);
            // q = exp(-a t) (cosh rt + a/r sinh rt), r^2 = a^2 - 1, with cos and sin for r^2 < 0.
            let a = 0.5 * gamma;
            let square = a * a - 1.0;
            let r = square.abs().sqrt();
            let (c, s) = if square < 0.0 {
                ((r * until).cos(), (r * until).sin() / r)
            } else {
                ((r * until).cosh(), (r * until).sinh() / r)
            };
            let decay = amplitude * (-a * until).exp();
            let (theta, velocity) = (decay * (c + a * s), -decay * s);
            let error = (end[0] - theta).hypot(end[1] - velocity);
            assert!(error < 1e-12 * amplitude, "gamma {gamma}, t {until}: {error:e}");
        }
    }
}

#[test]
fn separatrix() {
    // Without damping, th = 2 atan(sinh t), th' = 2 / cosh t is the solution from 0 with velocity 2
    // to the top.
    let pendulum = undriven(0.0, 0.0);
    for until in [0.5, 2.0, 5.0, 8.0_f64] {
        let [theta, velocity] = end(&run(&pendulum, [0.0, 2.0], until, 1e-13));
        let expected = [2.0 * until.sinh().atan(), 2.0 / until.cosh()];
        let error = (theta - expected[0]).hypot(velocity - expected[1]);
        // Errors grow as exp t near the top.
        assert!(error < 2e-15 * until.exp() + 1e-14, "t {until}: {error:e}");
    }
}

#[test]
fn period_of_free_swings() {
    for (amplitude, truth) in table(&truths()["free_decay"]["period_vs_amplitude"]) {
        let start = [amplitude.parse().expect("an angle"), 0.0];
        let pendulum = undriven(0.0, 0.0);
        let (period, quarter) = (number(&truth["T_tau"]), number(&truth["quarter"]));
        let [theta, velocity] = end(&run(&pendulum, start, quarter, 1e-13));
        // It passes through zero there: the remaining time is theta over the speed.
        let measured = 4.0 * (quarter - theta / velocity);
        assert!((measured / period - 1.0).abs() < 1e-13, "{amplitude}: {measured} for {period}");
        let back = end(&run(&pendulum, start, period, 1e-13));
        assert!((back[0] - start[0]).hypot(back[1]) < 1e-12, "{amplitude}: back at {back:?}");
    }
}

#[test]
fn energy_stays_without_damping_and_drive() {
    for (torque, start) in [(0.0, [2.5, 0.0]), (0.0, [0.3, 2.2]), (0.3, [-0.4, 0.9])] {
        let pendulum = undriven(0.0, torque);
        let energy = |a: f64, v: f64| 0.5 * v * v - a.cos() - torque * a;
        let tol = 1e-12;
        let run = run(&pendulum, start, 100.0 * TAU, tol);
        let first = energy(start[0], start[1]);
        let worst = run
            .theta
            .iter()
            .zip(&run.velocity)
            .map(|(a, v)| (energy(*a, *v) - first).abs())
            .fold(0.0, f64::max);
        // The tolerance is for five periods: a hundred allow twenty times as much, and as the
        // velocity is at most 3, an error of the state gives one of the energy three times as
        // large.
        assert!(worst < 60.0 * tol, "torque {torque}, {start:?}: {worst:e}");
    }
}

#[test]
fn reference_trajectories() {
    for entry in list(&truths()["trajectories"]) {
        let pendulum = model(entry);
        let start = [number(&entry["theta0"]), number(&entry["v0"])];
        let (theta, velocity) = (numbers(&entry["theta"]), numbers(&entry["v"]));
        // The last two are chaotic: an error of 1e-14 at t = 10 is 1e-6 at t = 100.
        let growth = if pendulum.drive.p > 1.0 { 0.2 } else { 0.0 };
        for (i, until) in numbers(&entry["times"]).into_iter().enumerate() {
            let run = run(&pendulum, start, until, 1e-11);
            let [a, v] = end(&run);
            let error = (a - theta[i]).hypot(v - velocity[i]);
            let case = format!("{pendulum:?}, t {until}");
            assert!(error < 4e-13 * (growth * until).exp(), "{case}: {error:e}");
            assert!(error < run.end_error + 3e-13, "{case}: {error:e}, said {:e}", run.end_error);
            assert!((run.time[run.time.len() - 1] - until).abs() < 1e-12);
        }
    }
}

#[test]
fn asking_for_more_does_not_give_less() {
    // A tolerance below rounding costs neither accuracy nor a thousand times the steps.
    for entry in &list(&truths()["trajectories"])[2..] {
        let pendulum = model(entry);
        let start = [number(&entry["theta0"]), number(&entry["v0"])];
        let (theta, velocity) = (numbers(&entry["theta"]), numbers(&entry["v"]));
        let until = numbers(&entry["times"])[1];
        let [(usual, few), (strict, many)] = [1e-11, 1e-13].map(|tol| {
            let run = run(&pendulum, start, until, tol);
            let [a, v] = end(&run);
            ((a - theta[1]).hypot(v - velocity[1]), run.steps)
        });
        assert!(strict < 10.0 * usual, "{pendulum:?}: {strict:e} at 1e-13, {usual:e} at 1e-11");
        assert!(many <= 8 * few, "{pendulum:?}: {many} steps for {few}");
    }
}

#[test]
fn simulate_reports_its_error() {
    // The reported error bounds the difference from a run a thousand times as precise.
    let pendulum = driven(0.1, 1.0, 2.0);
    for tol in [1e-4, 1e-7, 1e-10] {
        let until = 5.0 * pendulum.period();
        let rough = run(&pendulum, [1.0, 0.5], until, tol);
        let exact = run(&pendulum, [1.0, 0.5], until, 1e-13);
        let ([a, v], [b, w]) = (end(&rough), end(&exact));
        assert!(rough.reached_error <= tol);
        assert!((a - b).hypot(v - w) <= rough.reached_error + 1e-13, "tol {tol:e}");
    }
}

#[test]
fn a_phase_is_a_later_beginning() {
    let (p, omega, phase) = (0.8, 1.3, 0.9);
    let shifted = Pendulum::new(0.1, p, omega, phase, 0.2).expect("in range");
    let plain = Pendulum::new(0.1, p, omega, 0.0, 0.2).expect("in range");
    let ends = [(shifted, 0.0), (plain, phase / omega)].map(|(pendulum, tau)| {
        let schedule = Schedule::new(&pendulum, tau, 6.0, 400);
        along(&schedule, [0.7, -0.4])
    });
    assert!((ends[0][0] - ends[1][0]).hypot(ends[0][1] - ends[1][1]) < 1e-14);
    // Half a turn of phase is the opposite sign of p.
    let opposite = Pendulum::new(0.1, -p, omega, 0.0, 0.0).expect("in range");
    let turned = Pendulum::new(0.1, p, omega, PI, 0.0).expect("in range");
    let ends = [opposite, turned].map(|pendulum| end(&run(&pendulum, [1.0, 0.0], 6.0, 1e-12)));
    assert!((ends[0][0] - ends[1][0]).hypot(ends[0][1] - ends[1][1]) < 1e-12);
}
