//! The reference integrator on one thread: a trajectory, and the stroboscopic map with its
//! derivative, with and without friction.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use pendmap::integrate::reference::driver::Driver;
use pendmap::integrate::reference::flow::Flow;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::model::Pendulum;

/// Name, gamma, friction, p and omega.
const CASES: [(&str, f64, f64, f64, f64); 4] = [
    ("p 1 omega 2", 0.1, 0.0, 1.0, 2.0),
    ("p 1.7 omega 0.87", 0.1, 0.0, 1.7, 0.87),
    ("p 1 omega 2 theta_r 0.05", 0.02, 0.05, 1.0, 2.0),
    ("p 1.5 omega 0.87 theta_r 0.2", 0.1, 0.2, 1.5, 0.87),
];

fn pendulums() -> impl Iterator<Item = (&'static str, Pendulum)> {
    CASES.into_iter().map(|(name, gamma, theta_r, p, omega)| {
        let smooth = Pendulum::new(gamma, p, omega, 0.0, 0.0).expect("in range");
        (name, smooth.with_friction(theta_r).expect("in range"))
    })
}

fn trajectories(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("100 units of time at 1e-12 a step");
    for (name, pendulum) in pendulums() {
        let ode = OdeProblem::new(&pendulum, true, 1e-12, |_, value| value);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut driver = Driver::new(&ode, 0.0, black_box([2.8, 0.5]), 100.0);
                driver.finish(|_| ());
                driver.state
            });
        });
    }
    group.finish();
}

fn maps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("one period with its derivative");
    for (name, pendulum) in pendulums() {
        let flow = Flow::new(&pendulum);
        group.bench_function(name, |bencher| {
            bencher.iter(|| flow.carry(black_box([2.8, 0.5]), 0.0, pendulum.period()));
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    targets = trajectories, maps
}
criterion_main!(benches);
