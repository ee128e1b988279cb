//! Properties of every pendulum and every start, tested on random ones.

use std::f64::consts::PI;

use pendmap::integrate::accuracy::{distance, wrapped};
use pendmap::integrate::{Schedule, State, Strobe};
use pendmap::maps::starts::{Axis, Starts};
use pendmap::model::{HarmonicDrive, Pendulum};
use pendmap::orbit::PoincareMap;
use pendmap::orbit::newton::find;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::support::{advanced, along, bits, instruction_sets};

/// Pendulums in the usual range of maps; rarely at a corner of it.
fn pendulums() -> impl Strategy<Value = Pendulum> {
    let gamma = prop_oneof![1 => Just(0.0), 6 => 0.0..1.5];
    let p = prop_oneof![1 => Just(0.0), 6 => -2.0..2.0];
    (gamma, p, 0.5..4.0, -PI..PI).prop_map(|(gamma, p, omega, phase)| {
        Pendulum::new(gamma, p, omega, phase, 0.0).expect("in range")
    })
}

fn states() -> impl Strategy<Value = State> {
    (-PI..PI, -4.0..4.0).prop_map(|(theta, velocity)| [theta, velocity])
}

fn mirrored(state: State) -> State {
    [-state[0], -state[1]]
}

/// This pendulum with a torque.
fn with_torque(pendulum: &Pendulum, torque: f64) -> Pendulum {
    Pendulum { torque, ..pendulum.clone() }
}

proptest! {
    // A fixed seed: a failure can be reproduced.
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_map_is_odd_bit_for_bit(
        pendulum in pendulums(),
        torque in -1.0..1.0_f64,
        starts in prop::collection::vec(states(), 1..70),
        steps in 6_usize..60,
    ) {
        let images: Vec<State> = starts.iter().map(|s| mirrored(*s)).collect();
        for simd in instruction_sets() {
            let ends = advanced(&Strobe::new(&with_torque(&pendulum, torque), steps, simd), &starts, 3);
            let strobe = Strobe::new(&with_torque(&pendulum, -torque), steps, simd);
            for (a, b) in ends.iter().zip(advanced(&strobe, &images, 3)) {
                prop_assert_eq!(bits(&mirrored(*a)), bits(&b));
            }
        }
    }

    #[test]
    fn damping_alone_shrinks_area(pendulum in pendulums(), torque in -1.0..1.0_f64, state in states()) {
        let pendulum = with_torque(&pendulum, torque);
        let image = PoincareMap::new(&pendulum).once(state);
        let exact = (-pendulum.gamma * pendulum.period()).exp();
        let lost = 1e-14 * (1.0 + image.derivative.norm().powi(2));
        prop_assert!((image.derivative.determinant() - exact).abs() < lost);
    }

    #[test]
    fn time_runs_backwards_without_damping(pendulum in pendulums(), state in states()) {
        // At phase 0 the drive is even in time: reversing the velocity retraces the motion.
        let drive = HarmonicDrive { phase: 0.0, ..pendulum.drive };
        let pendulum = Pendulum { gamma: 0.0, drive, ..pendulum };
        let map = PoincareMap::new(&pendulum);
        let image = map.once(state);
        let back = map.once([image.state[0], -image.state[1]]).state;
        // Rounding errors are stretched on the way, and may have shrunk again in the total
        // derivative.
        let stretched = 1e-11 * (1.0 + image.derivative.norm().powi(2));
        prop_assert!(distance(back, [state[0], -state[1]]) < stretched);
    }

    #[test]
    fn a_whole_turn_changes_nothing(pendulum in pendulums(), state in states(), turns in -3_i32..4) {
        let map = PoincareMap::new(&pendulum);
        let (here, there) = (
            map.once(state),
            map.once([state[0] + std::f64::consts::TAU * f64::from(turns), state[1]]),
        );
        // An angle of 19 rad is rounded at every step, to 3.6e-15.
        let stretched = 1e-12 * (1.0 + here.derivative.norm());
        prop_assert!(distance(here.state, there.state) < stretched);
        // Next to +-pi rounding may choose the other side.
        if here.state[0].abs() < PI - 1e-3 {
            prop_assert_eq!(there.turns - here.turns, i64::from(turns));
        }
    }

    #[test]
    fn equal_steps_make_no_difference_to_where_they_are_cut(
        pendulum in pendulums(),
        state in states(),
        part in 0.1..0.9_f64,
    ) {
        let period = pendulum.period();
        let run = |tau: f64, duration: f64, state: State| {
            let steps = (duration / 0.02).ceil().max(1.0) as usize;
            let schedule = Schedule::new(&pendulum, tau, duration, steps);
            along(&schedule, state)
        };
        let cut = part * period;
        let parts = run(cut, period - cut, run(0.0, cut, state));
        let image = PoincareMap::new(&pendulum).once(state);
        prop_assert!(distance(parts, image.state) < 1e-12 * (1.0 + image.derivative.norm()));
    }

    #[test]
    fn closed_orbits_close_and_their_multipliers_have_the_right_product(
        pendulum in pendulums(),
        state in states(),
        n in 1_usize..4,
    ) {
        let map = PoincareMap::new(&pendulum);
        if let Some(orbit) = find(&map, state, n, 0.5) {
            prop_assert!(n % orbit.n == 0 && orbit.points.len() == orbit.n);
            prop_assert!(orbit.residual < 1e-11);
            let [a, b] = orbit.multipliers.0;
            let exact = (-pendulum.gamma * orbit.n as f64 * pendulum.period()).exp();
            prop_assert!(((a * b).re / exact - 1.0).abs() < 1e-12);
            prop_assert!(a.norm() >= b.norm());
            // Its mirror image is an orbit too.
            let image = [-orbit.points[0][0], -orbit.points[0][1]];
            prop_assert!(distance(map.iterate(image, orbit.n).state, image) < 1e-10);
        }
    }

    #[test]
    fn cells_fill_an_axis(low in -100.0..100.0_f64, width in 1e-3..100.0_f64, count in 1_usize..3000) {
        let axis = Axis::new("theta", low, low + width, count).expect("an axis");
        let cell = width / count as f64;
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + low.abs() + width);
        prop_assert!(close(axis.centre(0), low + 0.5 * cell));
        prop_assert!(close(axis.centre(count - 1), low + width - 0.5 * cell));
        let middle = count / 2;
        prop_assert!(close(axis.centre(middle + 1) - axis.centre(middle), cell));
    }

    #[test]
    fn samples_are_starts_of_the_map(columns in 1_usize..80, rows in 1_usize..80, seed in 0_u64..1000) {
        let theta = Axis::new("theta", -PI, PI, columns).expect("an axis");
        let velocity = Axis::new("velocity", -3.0, 3.0, rows).expect("an axis");
        let starts = Starts::Grid { theta, velocity };
        prop_assert_eq!(starts.len(), columns * rows);
        let picks = starts.sample(400, seed);
        prop_assert_eq!(picks.len(), starts.len().min(400));
        prop_assert!(picks.iter().all(|i| *i < starts.len()));
        prop_assert_eq!(&picks, &starts.sample(400, seed));
        for (i, state) in picks.iter().zip(starts.sampled_states(400, seed)) {
            prop_assert_eq!(bits(&state), bits(&starts.get(*i)));
            let expected = [theta.centre(i % columns), velocity.centre(i / columns)];
            prop_assert_eq!(bits(&state), bits(&expected));
        }
    }

    #[test]
    fn distances_are_taken_round_the_circle(a in states(), b in states(), turns in -5_i32..6) {
        let moved = [b[0] + std::f64::consts::TAU * f64::from(turns), b[1]];
        prop_assert!((distance(a, b) - distance(a, moved)).abs() < 1e-13);
        prop_assert!((distance(a, b) - distance(b, a)).abs() < 1e-15);
        prop_assert!(wrapped(a[0] - moved[0]).abs() <= PI + 1e-14);
        prop_assert!(distance(a, b) <= (a[0] - b[0]).hypot(a[1] - b[1]) + 1e-14);
    }
}
