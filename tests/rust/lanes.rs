//! Many trajectories side by side against one at a time, and instruction sets against one another.

use std::f64::consts::PI;

use pendmap::integrate::accuracy::{distance, error_reached};
use pendmap::integrate::{State, Strobe};
use pendmap::lanes::{Isa, Job, Lane, Path, dispatch};
use pendmap::model::Pendulum;

use crate::support::{advanced, bits, columns, driven, fine_strobe, paths, spread};

/// Angles, velocities and turns, as bits.
fn result(strobe: &Strobe, states: &[State], periods: usize, singly: bool) -> [Vec<u64>; 3] {
    let (mut theta, mut velocity) = columns(states);
    let mut turns: Vec<f64> = (0..states.len()).map(|i| i as f64).collect();
    let (a, b, c) = (&mut theta[..], &mut velocity[..], &mut turns[..]);
    if singly {
        strobe.advance_singly(a, b, c, periods).expect("equal lengths");
    } else {
        strobe.advance(a, b, c, periods).expect("equal lengths");
    }
    [bits(&theta), bits(&velocity), bits(&turns)]
}

fn cases() -> [Pendulum; 3] {
    [
        driven(0.1, 1.0, 2.0),
        driven(0.0, 1.7, 0.87),
        Pendulum::new(0.3, 1.2, 1.4, 0.7, -0.4).expect("in range"),
    ]
}

struct Width;

impl Job for Width {
    type Output = usize;
    #[inline(always)]
    fn run<S: Isa>(self, _: S) -> usize {
        S::Lanes::WIDTH
    }
}

#[test]
fn lanes_equal_single_trajectories_bit_for_bit() {
    for path in paths() {
        let width = dispatch::run(path, Width);
        for pendulum in cases() {
            // One step length on each side of the change between the sines.
            for steps in [12, 60] {
                let strobe = Strobe::new(&pendulum, steps, path);
                for count in [1, width - 1, width, width + 1, 2 * width + width / 2 + 1] {
                    let states = spread(count, 6.0, 4.0);
                    let lanes = result(&strobe, &states, 6, false);
                    let single = result(&strobe, &states, 6, true);
                    assert_eq!(lanes, single, "{path}, {pendulum:?}, {steps} steps, {count}");
                }
            }
        }
    }
}

#[test]
fn a_lane_does_not_see_its_neighbours() {
    // The same trajectory comes out of every place in a bundle, beside failures too.
    for path in paths() {
        let strobe = Strobe::new(&driven(0.1, 1.0, 2.0), 20, path);
        let alone = advanced(&strobe, &[[1.0, 0.5]], 4)[0];
        for place in 0..dispatch::run(path, Width) {
            let mut states = vec![[f64::NAN, 1e300]; place];
            states.push([1.0, 0.5]);
            states.push([f64::INFINITY, 0.0]);
            let found = advanced(&strobe, &states, 4)[place];
            assert_eq!(bits(&found), bits(&alone), "place {place} on {path}");
        }
    }
}

#[test]
fn avx512_and_avx2_give_the_same_bits() {
    let both = [Path::Avx512, Path::Avx2];
    if !both.iter().all(|path| path.available()) {
        eprintln!("skipped: this processor lacks one of them");
        return;
    }
    let states = spread(500, PI, 3.0);
    for pendulum in cases() {
        for steps in [12, 60] {
            let [a, b] =
                both.map(|path| result(&Strobe::new(&pendulum, steps, path), &states, 20, false));
            assert_eq!(a, b, "{pendulum:?}, {steps} steps");
        }
    }
}

#[test]
fn paths_agree_within_rounding() {
    let states = spread(500, PI, 3.0);
    for pendulum in cases() {
        for steps in [12, 60] {
            let reference = advanced(&Strobe::new(&pendulum, steps, Path::Portable), &states, 3);
            for path in paths() {
                let ends = advanced(&Strobe::new(&pendulum, steps, path), &states, 3);
                let worst =
                    ends.iter().zip(&reference).map(|(a, b)| distance(*a, *b)).fold(0.0, f64::max);
                eprintln!("{path} {steps}: {worst:e}");
                // Three periods of the second case stretch by up to a few thousand.
                assert!(worst < 1e-11, "{path}, {pendulum:?}, {steps} steps: {worst:e}");
            }
        }
    }
}

#[test]
fn the_coarse_sine_costs_less_than_the_method() {
    let cases = [
        driven(0.1, 0.5, 2.0),
        driven(0.1, 1.0, 2.0),
        driven(0.1, 1.7, 0.87),
        driven(0.1, 1.5, 1.8),
        driven(0.5, 30.0, 14.0),
        Pendulum::new(0.1, 0.3, 1.0, 0.0, 0.5).expect("in range"),
        Pendulum::new(0.1, 0.0, 1.0, 0.0, 0.5).expect("in range"),
    ];
    let states = spread(400, PI, 3.0);
    for pendulum in cases {
        // The most steps that still use it, where the method's error is smallest.
        let coarse = (4..200)
            .map(|steps| Strobe::new(&pendulum, steps, Path::choose().expect("a path")))
            .take_while(|strobe| !strobe.fine)
            .last()
            .expect("some steps are long enough");
        let fine = fine_strobe(&pendulum, coarse.steps(), coarse.path);
        let mut costs: Vec<f64> = advanced(&coarse, &states, 5)
            .iter()
            .zip(advanced(&fine, &states, 5))
            .map(|(a, b)| distance(*a, b))
            .collect();
        costs.sort_by(f64::total_cmp);
        let cost = costs[costs.len() * 95 / 100];
        let method = error_reached(&fine, &states);
        eprintln!(
            "{pendulum:?}: {} steps, h {:.3}: sine 95 % {cost:.2e} max {:.2e}, method {method:.2e}, ratio {:.3}",
            coarse.steps(),
            pendulum.period() / coarse.steps() as f64,
            costs[costs.len() - 1],
            cost / method
        );
        assert!(cost < method, "{pendulum:?}: sine {cost:e}, method {method:e}");
    }
}
