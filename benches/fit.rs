//! One evaluation of a fit: a window of 2,500 samples with derivatives in several directions, on each
//! instruction set of this processor; the motion alone for comparison.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use pendmap::fit::linear::linearise;
use pendmap::fit::window::Window;
use pendmap::fit::{Free, Problem, Record, Slot};
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::integrate::reference::sample::sample;
use pendmap::lanes::InstructionSet;
use pendmap::model::{Effect, Kind, Pendulum};

const SAMPLES: usize = 2500;
const INTERVAL: f64 = 0.04;
/// A millionth of a noise of 0.1 degrees.
const TOLERANCE: f64 = 1.75e-9;
const START: [f64; 2] = [2.0, 0.1];
const DRAG: (Kind, &[f64]) = (Kind::QuadraticDrag, &[0.02]);
const HARMONIC: (Kind, &[f64]) = (Kind::BearingHarmonic, &[0.03, 3.0, 0.4]);

/// A case: the simulated motion, and the free parameters in addition to gravity.
struct Case {
    name: &'static str,
    pendulum: Pendulum,
    free: Vec<usize>,
}

fn pendulum(p: f64, effects: &[(Kind, &[f64])]) -> Pendulum {
    let bare = Pendulum::new(0.01, p, 2.1, 0.0, 0.0).expect("in range");
    let rubbing = bare.with_friction(0.01).expect("in range");
    effects.iter().fold(rubbing, |pendulum, (kind, values)| {
        pendulum.with_effect(Effect::new(kind.clone(), values).expect("in range")).expect("once")
    })
}

fn cases() -> Vec<Case> {
    let candidates: [(Kind, &[f64]); 8] = [
        (Kind::CubicDamping, &[0.0]),
        DRAG,
        (Kind::AsymmetricViscous, &[0.0]),
        (Kind::AsymmetricCoulomb, &[0.0]),
        (Kind::ViscousDrift, &[0.0]),
        (Kind::CoulombDrift, &[0.0]),
        (Kind::StribeckFriction, &[0.0, 0.3]),
        HARMONIC,
    ];
    vec![
        Case { name: "free, drag, 5", pendulum: pendulum(0.0, &[DRAG]), free: vec![0, 1] },
        Case {
            name: "forced, drag and harmonic, 8",
            pendulum: pendulum(0.3, &[HARMONIC, DRAG]),
            free: vec![0, 1, 6, 7, 8],
        },
        Case {
            name: "forced, eight effects, 16",
            pendulum: pendulum(0.3, &candidates),
            free: (0..12).chain([14]).collect(),
        },
    ]
}

fn windows(criterion: &mut Criterion) {
    let times: Vec<f64> = (0..SAMPLES).map(|k| k as f64 * INTERVAL).collect();
    for Case { name, pendulum, free } in cases() {
        let mut group = criterion.benchmark_group(name);
        let ode = OdeProblem::new(&pendulum, true, TOLERANCE, |_, value| value).finding_turns();
        let motion = || sample(&ode, 0.0, black_box(START), &times, |_, _| true).states;
        let readings = motion().iter().map(|[theta, _]| *theta).collect();
        group.bench_function("motion alone", |bencher| bencher.iter(motion));

        let parameters = pendulum.parameters();
        let place = |slot, start| Free { places: vec![(0, slot)], start };
        let own = free.iter().map(|k| parameters[*k]);
        let own = own.map(|one| place(Slot::Parameter(one), pendulum.value(one)));
        let free = std::iter::once(place(Slot::Gravity, 1.0)).chain(own).collect();
        let record = Record {
            pendulum,
            recorded: None,
            times: times.clone(),
            readings,
            rod_sensor: None,
            angles: None,
            weights: vec![1.0; SAMPLES],
            counts: None,
            longest: f64::INFINITY,
        };
        let mut problem = Problem::new(vec![record], free, TOLERANCE).expect("a problem");
        let shaped = problem.shaped(0, &problem.start()).expect("in range");
        let columns = problem.columns(0);
        let window = Window { record: 0, from: 0, to: SAMPLES, start: START };
        for simd in InstructionSet::ALL.into_iter().filter(|simd| simd.available()) {
            problem.simd = simd;
            group.bench_function(simd.name(), |bencher| {
                bencher.iter(|| linearise(&problem, &shaped, &columns, black_box(&window)));
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    targets = windows
}
criterion_main!(benches);
