//! The measured order of convergence: eight, with and without damping and torque.

use std::f64::consts::PI;

use pendmap::integrate::accuracy::distance;
use pendmap::integrate::kernel::tableau::ORDER;
use pendmap::integrate::reference::dense::DenseStep;
use pendmap::integrate::reference::driver::Driver;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::model::Pendulum;

use crate::support::{advanced, driven, fine_strobe, simd, spread};

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
