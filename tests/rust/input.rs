//! Invalid input and its messages: each names the quantity, the allowed values and the given value.

use std::sync::atomic::AtomicBool;

use pendmap::error::Error;
use pendmap::integrate::States;
use pendmap::integrate::accuracy::choose;
use pendmap::integrate::trajectory::{Request, simulate};
use pendmap::lanes::InstructionSet;
use pendmap::maps::basins::{Options, basins};
use pendmap::maps::control::Control;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::memory;
use pendmap::model::{HarmonicDrive, Pendulum};

use crate::support::{driven, plane, simd, spread};

/// The message of a refusal; a success is the failure of the test.
fn refusal<T>(result: Result<T, Error>) -> String {
    result.err().expect("refused").to_string()
}

#[test]
fn pendulums() {
    let make =
        |gamma, p, omega, phase, torque| refusal(Pendulum::new(gamma, p, omega, phase, torque));
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    assert_eq!(make(-0.1, 1.0, 2.0, 0.0, 0.0), "gamma must be 0 or more, got -0.1");
    assert_eq!(make(nan, 1.0, 2.0, 0.0, 0.0), "gamma must be 0 or more, got NaN");
    assert_eq!(make(inf, 1.0, 2.0, 0.0, 0.0), "gamma must be 0 or more, got inf");
    assert_eq!(make(0.1, nan, 2.0, 0.0, 0.0), "p must be a finite number, got NaN");
    assert_eq!(make(0.1, -inf, 2.0, 0.0, 0.0), "p must be a finite number, got -inf");
    assert_eq!(make(0.1, 1.0, 0.0, 0.0, 0.0), "omega must be a number above 0, got 0");
    assert_eq!(make(0.1, 1.0, -2.0, 0.0, 0.0), "omega must be a number above 0, got -2");
    assert_eq!(make(0.1, 1.0, nan, 0.0, 0.0), "omega must be a number above 0, got NaN");
    assert_eq!(make(0.1, 1.0, 2.0, inf, 0.0), "phase must be a finite number, got inf");
    assert_eq!(make(0.1, 1.0, 2.0, 0.0, nan), "torque must be a finite number, got NaN");
    assert!(
        HarmonicDrive::new(1.0, 2.0, 0.0).is_ok()
            && Pendulum::new(0.0, -1.0, 2.0, 9.0, -3.0).is_ok()
    );
}

#[test]
fn axes() {
    let make = |low, high, count| refusal(Axis::new("velocity", low, high, count));
    let order = "velocity must be two finite bounds, the lower one first";
    assert_eq!(make(1.0, -1.0, 10), format!("{order}, got -1"));
    assert_eq!(make(2.0, 2.0, 10), format!("{order}, got 2"));
    assert_eq!(make(f64::NAN, 1.0, 10), format!("{order}, got NaN"));
    assert_eq!(make(0.0, f64::INFINITY, 10), format!("{order}, got inf"));
    assert_eq!(make(-1.0, 1.0, 0), "velocity must be 1 to 100000 cells, got 0");
    assert_eq!(make(-1.0, 1.0, 100_001), "velocity must be 1 to 100000 cells, got 100001");
}

#[test]
fn trajectories() {
    let good = Request { start: [1.0, 0.0], until: 1.0, tol: 1e-6, samples: 10, lyapunov: false };
    let go = |request: Request| {
        refusal(simulate(&driven(0.1, 1.0, 2.0), &request, &AtomicBool::new(false)))
    };
    let nan = f64::NAN;
    assert_eq!(go(Request { start: [nan, 0.0], ..good }), "theta must be a finite number, got NaN");
    assert_eq!(
        go(Request { start: [0.0, f64::INFINITY], ..good }),
        "velocity must be a finite number, got inf"
    );
    assert_eq!(go(Request { until: -1.0, ..good }), "until must be a time above 0, got -1");
    assert_eq!(go(Request { until: nan, ..good }), "until must be a time above 0, got NaN");
    assert_eq!(
        go(Request { tol: 0.1, ..good }),
        "tol must be a number from 1e-13 to 1e-2, got 0.1"
    );
    assert_eq!(
        go(Request { tol: nan, ..good }),
        "tol must be a number from 1e-13 to 1e-2, got NaN"
    );
    assert_eq!(go(Request { samples: 0, ..good }), "samples must be 1 or more, got 0");
    assert!(simulate(&driven(0.1, 1.0, 2.0), &good, &AtomicBool::new(false)).is_ok());
    let stopped = simulate(&driven(0.1, 1.0, 2.0), &good, &AtomicBool::new(true));
    assert_eq!(stopped.err(), Some(Error::Interrupted));
}

#[test]
fn arrays_of_different_lengths() {
    let go = |a: usize, b: usize| States::new(vec![0.0; a], vec![0.0; b]).map(|all| all.len());
    assert_eq!(go(3, 3), Ok(3));
    assert_eq!(go(0, 0), Ok(0));
    let error = go(3, 2).expect_err("refused");
    assert_eq!(error, Error::Lengths { given: (3, 2), names: ("theta", "velocity") });
    assert_eq!(error.to_string(), "theta and velocity must be as many values, got 3 and 2");
}

#[test]
fn tolerances() {
    let starts = spread(100, 3.0, 3.0);
    let range = |tol: f64| refusal(choose(&driven(0.1, 1.0, 2.0), &starts, tol, simd()));
    assert_eq!(range(0.5), "tol must be a number from 1e-13 to 1e-2, got 0.5");
    assert_eq!(range(0.0), "tol must be a number from 1e-13 to 1e-2, got 0");
    assert_eq!(range(-1e-6), "tol must be a number from 1e-13 to 1e-2, got -1e-6");
    assert_eq!(range(1e300), "tol must be a number from 1e-13 to 1e-2, got 1e300");
    assert_eq!(range(f64::NAN), "tol must be a number from 1e-13 to 1e-2, got NaN");
    // Chaos amplifies rounding errors beyond 1e-13 within five periods.
    let error = choose(&driven(0.0, 3.0, 0.4), &starts, 1e-13, simd()).expect_err("refused");
    let Error::Tolerance { tol, reached } = error else { panic!("{error}") };
    assert!(tol < 2e-13 && reached > tol && reached < 1e-6, "{reached:e}");
    let error = Error::Tolerance { tol: 1e-13, reached: 2.34e-11 }.to_string();
    let expected =
        "tol must be 2.3e-11 or more here, the smallest error that steps can reach, got 1e-13";
    assert_eq!(error, expected);
}

#[test]
fn instruction_sets() {
    for simd in InstructionSet::ALL {
        assert_eq!(simd.name().parse::<InstructionSet>(), Ok(simd));
        assert_eq!(simd.to_string(), simd.name());
    }
    let error = "avx1024".parse::<InstructionSet>().expect_err("refused");
    assert_eq!(error, Error::Simd { name: "avx1024".to_owned() });
    let expected = "PENDMAP_SIMD must be avx512, avx2, sse, neon or portable, as far as this processor \
                    has them, got 'avx1024'";
    assert_eq!(error.to_string(), expected);
    assert!("AVX2".parse::<InstructionSet>().is_err() && "".parse::<InstructionSet>().is_err());
    assert!(InstructionSet::Portable.available());
}

#[test]
fn maps() {
    let pendulum = driven(0.1, 1.0, 2.0);
    let go = |starts: &Starts, options: Options| {
        refusal(basins(&pendulum, starts, &options, &Control::default()))
    };
    let options = Options::default();
    assert_eq!(go(&Starts::List(Vec::new()), options), "starts must be 1 or more, got 0");
    let tol = Options { tol: 1.0, ..options };
    assert_eq!(go(&plane(10), tol), "tol must be a number from 1e-13 to 1e-2, got 1");
    assert_eq!(Error::Interrupted.to_string(), "interrupted");
    let error = Error::Threads("no more".to_owned());
    assert_eq!(error.to_string(), "threads: no more");
    // They implement the standard library's error trait.
    let boxed: Box<dyn std::error::Error> = Box::new(error);
    assert!(boxed.source().is_none());
}

#[test]
fn more_memory_than_there_is() {
    let why = refusal(memory::reckon("cells", usize::MAX / 16, 8));
    assert!(why.starts_with("1152921504606846975 cells need about 9223372036.855 GB, "), "{why}");
    assert!(why.ends_with(" free: they must be fewer"), "{why}");
    let mut list = vec![0_u64];
    let why = refusal(memory::room("periods", &mut list, usize::MAX / 16));
    assert!(why.ends_with(" free: they must be fewer"), "{why}");
    memory::reckon("cells", 1000, 8).expect("enough");
    memory::room("periods", &mut list, 1000).expect("enough");
    assert!(list.capacity() > 1000);
}
