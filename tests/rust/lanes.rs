//! Trajectories in lanes against single ones, and instruction sets against one another.

use std::f64::consts::PI;

use pendmap::integrate::accuracy::{choose, distance, error_reached};
use pendmap::integrate::{State, States, Strobe};
use pendmap::lanes::{InstructionSet, Isa, Job, Lane, dispatch};
use pendmap::model::Pendulum;

use crate::support::{advanced, bits, driven, fine_strobe, instruction_sets, simd, spread};

/// Angles, velocities and turns, as bits.
pub fn result(strobe: &Strobe, states: &[State], periods: usize, singly: bool) -> [Vec<u64>; 3] {
    let mut all = States::from(states);
    // Twice: turns are added.
    for _ in 0..2 {
        if singly {
            strobe.advance_singly(&mut all, periods);
        } else {
            strobe.advance(&mut all, periods);
        }
    }
    [all.theta(), all.velocity(), all.turns()].map(bits)
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
    for simd in instruction_sets() {
        let width = dispatch::run(simd, Width);
        for pendulum in cases() {
            // One step length on each side of the switch between the sines.
            for steps in [12, 60] {
                let strobe = Strobe::new(&pendulum, steps, simd);
                for count in [1, width - 1, width, width + 1, 2 * width + width / 2 + 1] {
                    let states = spread(count, 6.0, 4.0);
                    let lanes = result(&strobe, &states, 6, false);
                    let single = result(&strobe, &states, 6, true);
                    assert_eq!(lanes, single, "{simd}, {pendulum:?}, {steps} steps, {count}");
                }
            }
        }
    }
}

#[test]
fn a_lane_does_not_see_its_neighbours() {
    // A trajectory does not depend on its place in a bundle, even with failures in other lanes.
    for simd in instruction_sets() {
        let strobe = Strobe::new(&driven(0.1, 1.0, 2.0), 20, simd);
        let alone = advanced(&strobe, &[[1.0, 0.5]], 4)[0];
        for place in 0..dispatch::run(simd, Width) {
            let mut states = vec![[f64::NAN, 1e300]; place];
            states.push([1.0, 0.5]);
            states.push([f64::INFINITY, 0.0]);
            let found = advanced(&strobe, &states, 4)[place];
            assert_eq!(bits(&found), bits(&alone), "place {place} on {simd}");
        }
    }
}

#[test]
fn avx512_and_avx2_give_the_same_bits() {
    let both = [InstructionSet::Avx512, InstructionSet::Avx2];
    if !both.iter().all(|simd| simd.available()) {
        eprintln!("skipped: this processor lacks one of them");
        return;
    }
    let states = spread(500, PI, 3.0);
    for pendulum in cases() {
        for steps in [12, 60] {
            let [a, b] =
                both.map(|simd| result(&Strobe::new(&pendulum, steps, simd), &states, 20, false));
            assert_eq!(a, b, "{pendulum:?}, {steps} steps");
        }
    }
}

#[test]
fn instruction_sets_agree_within_rounding() {
    let states = spread(500, PI, 3.0);
    for pendulum in cases() {
        for steps in [24, 60] {
            let strobe = Strobe::new(&pendulum, steps, InstructionSet::Portable);
            let reference = advanced(&strobe, &states, 3);
            // The effect of a shift by a few units in the last place bounds that of rounding.
            let shifted: Vec<State> = states.iter().map(|s| [s[0] + 1e-10, s[1] + 1e-10]).collect();
            let shifted = advanced(&strobe, &shifted, 3);
            for simd in instruction_sets() {
                let ends = advanced(&Strobe::new(&pendulum, steps, simd), &states, 3);
                for ((a, b), c) in ends.iter().zip(&reference).zip(&shifted) {
                    let stretch = 1.0 + distance(*b, *c) / 1e-10;
                    let error = distance(*a, *b) / stretch;
                    assert!(error < 5e-13, "{simd}, {pendulum:?}, {steps} steps: {error:e}");
                }
            }
        }
    }
}

/// The 95th percentile of the distances between two maps after five periods.
fn typical_distance(a: &Strobe, b: &Strobe, states: &[State]) -> f64 {
    let (a, b) = (advanced(a, states, 5), advanced(b, states, 5));
    let mut distances: Vec<f64> = a.iter().zip(b).map(|(a, b)| distance(*a, b)).collect();
    distances.sort_by(f64::total_cmp);
    distances[distances.len() * 95 / 100]
}

#[test]
fn the_error_reached_is_the_error_and_the_coarse_sine_its_smaller_part() {
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
        for tol in [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] {
            let (strobe, reached) = choose(&pendulum, &states, tol, simd()).expect("steps");
            let fine = fine_strobe(&pendulum, strobe.steps(), strobe.simd);
            let exact = fine_strobe(&pendulum, 8 * strobe.steps(), strobe.simd);
            let error = typical_distance(&strobe, &exact, &states);
            let case = format!("{pendulum:?}, tol {tol:e}, {} steps", strobe.steps());
            assert!(reached <= tol, "{case}: reached {reached:e}");
            assert!(error < 1.2 * reached, "{case}: reached {reached:e}, but it is {error:e}");
            assert!(reached < 1.2 * error, "{case}: reached {reached:e}, but it is {error:e}");
            if !strobe.fine && tol > 0.9e-6 {
                let (sine, method) =
                    (typical_distance(&strobe, &fine, &states), error_reached(&fine, &states));
                assert!(sine < method, "{case}: sine {sine:e}, method {method:e}");
            }
        }
    }
}

#[test]
fn the_steps_chosen_are_hardly_more_than_needed() {
    let states = spread(400, PI, 3.0);
    for pendulum in [driven(0.1, 1.0, 2.0), driven(0.1, 0.5, 2.0)] {
        for tol in [1e-4, 1e-6, 1e-9] {
            let (strobe, _) = choose(&pendulum, &states, tol, simd()).expect("steps");
            let fewer = Strobe::new(&pendulum, strobe.steps() * 9 / 10, strobe.simd);
            assert!(error_reached(&fewer, &states) > tol, "{pendulum:?}, {tol:e}");
        }
    }
}
