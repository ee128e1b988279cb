//! The measured order of convergence: eight, with and without damping and torque.

use std::f64::consts::PI;

use pendmap::integrate::Schedule;
use pendmap::integrate::accuracy::distance;
use pendmap::integrate::kernel::tableau::{A, B, BP, C, ORDER, STAGES};
use pendmap::integrate::reference::dense::DenseStep;
use pendmap::integrate::reference::driver::Driver;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::model::Pendulum;

use crate::support::{advanced, along, driven, fine_strobe, simd, spread};

/// Root mean square error over starts after one period, for each number of steps.
fn errors(pendulum: &Pendulum, steps: &[usize]) -> Vec<f64> {
    let starts = spread(64, PI, 3.0);
    let exact = advanced(&fine_strobe(pendulum, 600, simd()), &starts, 1);
    steps
        .iter()
        .map(|n| {
            let ends = advanced(&fine_strobe(pendulum, *n, simd()), &starts, 1);
            let squares = ends.iter().zip(&exact).map(|(a, b)| distance(*a, *b).powi(2));
            (squares.sum::<f64>() / starts.len() as f64).sqrt()
        })
        .collect()
}

#[test]
fn the_step_has_order_eight() {
    let cases = [
        ("damping, drive and torque", (0.3, 1.1, 2.0, 0.4, 0.5)),
        ("no damping", (0.0, 1.1, 2.0, 0.0, 0.0)),
        ("no damping, torque", (0.0, 0.7, 1.7, 0.0, 0.3)),
        ("heavy damping", (1.5, 0.9, 2.0, 0.0, 0.0)),
    ];
    for (name, (gamma, p, omega, phase, torque)) in cases {
        let pendulum = Pendulum::new(gamma, p, omega, phase, torque).expect("in range");
        let scale = pendulum.period() / PI;
        let steps = [16.0, 20.0, 25.0].map(|n| (n * scale).round() as usize);
        let errors = errors(&pendulum, &steps);
        let order = (errors[0] / errors[2]).ln() / (steps[2] as f64 / steps[0] as f64).ln();
        assert!(
            (order - f64::from(ORDER)).abs() < 0.25,
            "{name}: order {order}, errors {errors:?}"
        );
    }
}

#[test]
fn the_tableau_meets_the_simple_order_conditions() {
    // sum b c^k = 1/((k+1)(k+2)), sum b' c^k = 1/(k+1), sum_j a_ij = c_i^2/2.
    for k in 0..ORDER {
        let moment = |weights: &[f64; STAGES]| {
            weights.iter().zip(&C).map(|(w, c)| w * c.powi(k)).sum::<f64>()
        };
        let k = f64::from(k);
        if k < f64::from(ORDER) - 1.0 {
            assert!((moment(&B) - 1.0 / ((k + 1.0) * (k + 2.0))).abs() < 1e-15, "b, {k}");
        }
        assert!((moment(&BP) - 1.0 / (k + 1.0)).abs() < 1e-15, "b', {k}");
    }
    for (row, c) in A.iter().zip(&C) {
        assert!((row.iter().sum::<f64>() - 0.5 * c * c).abs() < 2e-14);
    }
}

#[test]
fn schedules_join() {
    // A period in two parts with different step lengths equals the whole period.
    let pendulum = Pendulum::new(0.2, 1.2, 1.7, 0.3, 0.1).expect("in range");
    let period = pendulum.period();
    let cut = 0.37 * period;
    let expected = along(&Schedule::period(&pendulum, 400), [1.0, 0.5]);
    let first = Schedule::new(&pendulum, 0.0, cut, 170);
    let second = Schedule::new(&pendulum, cut, period - cut, 290);
    let end = along(&second, along(&first, [1.0, 0.5]));
    assert!(distance(end, expected) < 3e-14, "{end:?} for {expected:?}");
    assert!((second.duration() - (period - cut)).abs() < 1e-15);
}

/// Errors at the end of equal steps of the reference integrator, and the greatest error of the
/// interpolants, while the sense of friction is constant.
fn equal_steps(count: usize) -> [f64; 2] {
    let pendulum = driven(0.3, 1.1, 2.0).with_friction(0.2).expect("in range");
    let ode = OdeProblem::new(&pendulum, true, 1e-15, |_, value| value);
    let (start, until) = ([0.4, 4.0], 2.0);
    let exact = |tau: f64| {
        let mut driver = Driver::new(&ode, 0.0, start, tau);
        driver.finish(|_| ());
        assert!(driver.events.is_empty());
        driver.state
    };
    let length = until / count as f64;
    let (mut state, mut between) = (start, 0_f64);
    for k in 0..count {
        let tau = k as f64 * length;
        let first = ode.acceleration(tau, state, [1.0; 2], ode.begin(tau, state));
        let mut dense = DenseStep::new(ode.field(), tau, state, first, [1.0; 2], length);
        let middle = tau + 0.37 * length;
        between = between.max(distance(dense.curve(ode.field()).at(middle), exact(middle)));
        state = dense.end;
    }
    [distance(state, exact(until)), between]
}

#[test]
fn the_reference_integrator_has_order_eight_and_its_curves_seven() {
    let counts = [4, 6, 9];
    let errors = counts.map(equal_steps);
    let order = |of: usize| (errors[0][of] / errors[2][of]).ln() / (9.0_f64 / 4.0).ln();
    assert!(order(0) > 7.5, "ends: order {}, {errors:?}", order(0));
    assert!(order(1) > 6.7, "curves: order {}, {errors:?}", order(1));
}

#[test]
fn the_error_follows_the_tolerance_through_stick_and_slip() {
    let pendulum = driven(0.1, 0.8, 1.2).with_friction(0.15).expect("in range");
    let end = |tolerance: f64| {
        let ode = OdeProblem::new(&pendulum, true, tolerance, |_, value| value);
        let mut driver = Driver::new(&ode, 0.0, [2.79, 0.49], 20.0);
        driver.finish(|_| ());
        driver.state
    };
    let exact = end(1e-15);
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] {
        let error = distance(end(tolerance), exact);
        assert!(error < 30.0 * tolerance, "{tolerance:e}: {error:e}");
    }
}
