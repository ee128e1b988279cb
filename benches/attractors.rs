//! The search for attractors from 400 starts, one thread, at a smooth, a slow and a chaotic point.

use std::f64::consts::PI;
use std::hint::black_box;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use pendmap::attractor::{Catalogue, Effort};
use pendmap::integrate::accuracy::choose;
use pendmap::lanes::InstructionSet;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::model::Pendulum;

/// Name, p, omega and the number of attractors (gamma = 0.1).
const POINTS: [(&str, f64, f64, usize); 3] = [
    ("p 0.6 omega 2, smooth", 0.6, 2.0, 3),
    ("p 1.34 omega 2, close to doubling", 1.34, 2.0, 4),
    ("p 1.7 omega 0.87, chaos", 1.7, 0.87, 1),
];

fn search(criterion: &mut Criterion) {
    let axis = |name, half: f64| Axis::new(name, -half, half, 1000).expect("an axis");
    let plane = Starts::Grid { theta: axis("theta", PI), velocity: axis("velocity", 3.0) };
    let starts = plane.sampled_states(400, 0);
    let simd = InstructionSet::choose().expect("PENDMAP_SIMD names a simd of this processor");
    let mut group = criterion.benchmark_group(format!("search on {simd}"));
    for (name, p, omega, count) in POINTS {
        let pendulum = Pendulum::new(0.1, p, omega, 0.0, 0.0).expect("in range");
        let (strobe, _) = choose(&pendulum, &starts, 1e-6, simd).expect("steps");
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let never = AtomicBool::new(false);
                let mut catalogue =
                    Catalogue::new(&strobe, Effort::THOROUGH, &never).expect("rests");
                catalogue.search(&strobe, black_box(&starts), 1000, &never).expect("attractors");
                assert_eq!(catalogue.attractors.len(), count, "attractors at {name}");
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(3));
    targets = search
}
criterion_main!(benches);
