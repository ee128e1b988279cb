//! The sine of both degrees on each instruction set, and the C library's: an element is one value.

use std::hint::black_box;
use std::marker::PhantomData;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use pendmap::lanes::sine::{Coarse, Degree, Fine};
use pendmap::lanes::{InstructionSet, Isa, Job, Lane, Real, dispatch};

/// Values in one call: whole bundles that fit the L1 cache.
const COUNT: usize = 1536;

/// The sine of every number, in place; for `cosine` the cosine.
struct Sines<'a, D> {
    numbers: &'a mut [f64],
    cosine: bool,
    degree: PhantomData<D>,
}

impl<D: Degree> Job for Sines<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) {
        for chunk in self.numbers.chunks_exact_mut(S::Lanes::WIDTH) {
            let x = S::Lanes::load(isa, chunk);
            let y = if self.cosine { x.cosine::<D>() } else { x.sine::<D>() };
            y.store(chunk);
        }
    }
}

/// Half turns between -8 and 8.
fn numbers() -> Vec<f64> {
    (0..COUNT).map(|i| 16.0 * (i as f64 / COUNT as f64) - 8.0).collect()
}

fn measure<D: Degree>(criterion: &mut Criterion, name: &str, cosine: bool) {
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(COUNT as u64));
    for simd in InstructionSet::ALL.into_iter().filter(|simd| simd.available()) {
        group.bench_function(BenchmarkId::from_parameter(simd), |bencher| {
            let (source, mut numbers) = (numbers(), numbers());
            bencher.iter(|| {
                numbers.copy_from_slice(black_box(&source));
                let numbers = &mut numbers[..];
                dispatch::run(simd, Sines::<D> { numbers, cosine, degree: PhantomData });
            });
        });
    }
    group.finish();
}

fn sine(criterion: &mut Criterion) {
    measure::<Fine>(criterion, "fine sine", false);
    measure::<Coarse>(criterion, "coarse sine", false);
    measure::<Fine>(criterion, "fine cosine", true);
}

fn library(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("library");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.bench_function("sin", |bencher| {
        let (source, mut numbers) = (numbers(), numbers());
        bencher.iter(|| {
            for (x, y) in black_box(&source).iter().zip(&mut numbers) {
                *y = (std::f64::consts::PI * x).sin();
            }
            black_box(&mut numbers);
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(30)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    targets = sine, library
}
criterion_main!(benches);
