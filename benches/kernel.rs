//! The stroboscopic map on each instruction set, one thread: an element is one trajectory over one
//! forcing period, so that the figure is trajectory-periods a second.

use std::f64::consts::FRAC_1_SQRT_2;
use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use pendmap::integrate::accuracy::choose;
use pendmap::integrate::{State, States, Strobe, TangentStates};
use pendmap::lanes::InstructionSet;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::model::Pendulum;

/// Trajectories: whole bundles on every instruction set.
const COUNT: usize = 1536;
/// Periods in one call.
const PERIODS: usize = 16;

/// The points of the design's measurements: gamma, p, omega.
const POINTS: [(&str, f64, f64, f64); 2] =
    [("p 1 omega 2", 0.1, 1.0, 2.0), ("p 1.7 omega 0.87", 0.1, 1.7, 0.87)];

fn plane() -> Starts {
    let axis = |name, half: f64| Axis::new(name, -half, half, 100).expect("an axis");
    Starts::Grid { theta: axis("theta", std::f64::consts::PI), velocity: axis("velocity", 3.0) }
}

fn strobe(pendulum: &Pendulum, tol: f64, simd: InstructionSet) -> Strobe {
    choose(pendulum, &plane().sampled_states(200, 0), tol, simd).expect("steps").0
}

fn sampled() -> Vec<State> {
    plane().sampled_states(COUNT, 1)
}

fn sets() -> impl Iterator<Item = InstructionSet> {
    InstructionSet::ALL.into_iter().filter(|simd| simd.available())
}

fn map(criterion: &mut Criterion) {
    for (name, gamma, p, omega) in POINTS {
        let pendulum = Pendulum::new(gamma, p, omega, 0.0, 0.0).expect("in range");
        let mut group = criterion.benchmark_group(format!("map, {name}"));
        group.throughput(Throughput::Elements((COUNT * PERIODS) as u64));
        for tol in [1e-6, 1e-9] {
            for simd in sets() {
                let strobe = strobe(&pendulum, tol, simd);
                let id =
                    BenchmarkId::new(simd.name(), format!("{tol:e}, {} steps", strobe.steps()));
                group.bench_function(id, |bencher| {
                    let mut states = States::from(sampled().as_slice());
                    bencher.iter(|| strobe.advance(black_box(&mut states), PERIODS));
                });
            }
        }
        group.finish();
    }
}

fn stretch(criterion: &mut Criterion) {
    let pendulum = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.0).expect("in range");
    let mut group = criterion.benchmark_group("map with tangent, p 1 omega 2");
    group.throughput(Throughput::Elements((COUNT * PERIODS) as u64));
    for simd in sets() {
        let strobe = strobe(&pendulum, 1e-6, simd);
        group.bench_function(simd.name(), |bencher| {
            let mut all = TangentStates::along(&sampled(), [FRAC_1_SQRT_2; 2]);
            bencher.iter(|| strobe.stretch(black_box(&mut all), PERIODS));
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2));
    targets = map, stretch
}
criterion_main!(benches);
