//! Derivatives: variational equations against finite differences, areas, stretching.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use pendmap::integrate::accuracy::wrapped;
use pendmap::integrate::{State, States, Strobe, TangentStates};
use pendmap::model::Pendulum;
use pendmap::orbit::PoincareMap;

use crate::support::{bits, driven, instruction_sets, spread};

fn cases() -> [Pendulum; 4] {
    [
        driven(0.1, 1.0, 2.0),
        driven(0.0, 0.6, 1.0),
        driven(0.4, 1.7, 0.87),
        Pendulum::new(0.2, 0.8, 1.5, 0.5, 0.6).expect("in range"),
    ]
}

/// The central difference of `n` periods of the map in one direction.
fn difference(map: &PoincareMap, state: State, direction: State, n: usize, h: f64) -> State {
    let at =
        |s: f64| map.iterate([state[0] + s * direction[0], state[1] + s * direction[1]], n).state;
    let (plus, minus) = (at(h), at(-h));
    [wrapped(plus[0] - minus[0]) / (2.0 * h), (plus[1] - minus[1]) / (2.0 * h)]
}

#[test]
fn the_variational_equations_give_the_derivative() {
    for pendulum in cases() {
        let map = PoincareMap::new(&pendulum);
        for state in spread(40, PI, 2.5) {
            for n in [1, 2] {
                let image = map.iterate(state, n);
                let scale = image.derivative.norm();
                for (column, direction) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                    // Richardson extrapolation from two steps leaves errors of the fourth order.
                    let h = 1e-4 / scale.max(1.0);
                    let [coarse, fine] =
                        [h, 0.5 * h].map(|h| difference(&map, state, direction, n, h));
                    for row in 0..2 {
                        let expected = (4.0 * fine[row] - coarse[row]) / 3.0;
                        let found = image.derivative[(row, column)];
                        let error = (found - expected).abs() / scale;
                        assert!(error < 2e-7, "{pendulum:?} {state:?} n {n}: {found} {expected}");
                    }
                }
            }
        }
    }
}

#[test]
fn turns_and_angle_make_the_unwrapped_angle() {
    // A fast rotation without damping and drive: theta grows by about the velocity times the time.
    let map = PoincareMap::new(&driven(0.0, 0.0, 1.0));
    let image = map.once([0.5, 20.0]);
    let angle = image.state[0] + std::f64::consts::TAU * image.turns as f64;
    assert!((angle - (0.5 + 20.0 * 2.0 * PI)).abs() < 0.5, "{angle}");
    assert!(image.turns == 20, "{}", image.turns);
}

#[test]
fn stretch_is_the_growth_of_a_tangent() {
    let states = spread(75, PI, 2.5);
    let part = FRAC_1_SQRT_2;
    for pendulum in cases() {
        let map = PoincareMap::new(&pendulum);
        let expected: Vec<(State, f64, State, i64)> = states
            .iter()
            .map(|state| {
                let image = map.iterate(*state, 4);
                let tangent = image.derivative * nalgebra::Vector2::new(part, part);
                let unit = tangent / tangent.norm();
                (image.state, tangent.norm().ln(), [unit[0], unit[1]], image.turns)
            })
            .collect();
        for simd in instruction_sets() {
            let strobe = Strobe::new(&pendulum, 200, simd);
            let mut all = TangentStates::along(&states, [part; 2]);
            // In two calls: growth is added, tangents continue.
            for periods in [1, 3] {
                strobe.stretch(&mut all, periods);
            }
            let (ends, growth) = (all.states(), all.growth());
            for (i, (state, log, unit, whole)) in expected.iter().enumerate() {
                let ([theta, velocity], tangent) = (ends.get(i), all.tangent(i));
                let error = (wrapped(theta - state[0])).hypot(velocity - state[1]);
                let tilt = (tangent[0] - unit[0]).hypot(tangent[1] - unit[1]);
                assert!(error < 1e-9, "state {i} on {simd}: {error:e}");
                assert!((growth[i] - log).abs() < 1e-9, "growth {i}: {} {log}", growth[i]);
                assert!(tilt < 1e-8, "direction {i} on {simd}: {tilt:e}");
                assert!((ends.turns()[i] - *whole as f64).abs() < 1e-12, "turns {i} on {simd}");
            }
        }
    }
}

#[test]
fn a_tangent_beside_a_state_does_not_change_it() {
    for simd in instruction_sets() {
        let strobe = Strobe { fine: true, ..Strobe::new(&driven(0.1, 1.2, 2.0), 24, simd) };
        let states = spread(70, PI, 2.5);
        let mut plain = States::from(states.as_slice());
        strobe.advance(&mut plain, 1);
        let mut beside = TangentStates::along(&states, [1.0, 0.0]);
        strobe.stretch(&mut beside, 1);
        assert_eq!(bits(plain.theta()), bits(beside.states().theta()), "{simd}");
        assert_eq!(bits(plain.velocity()), bits(beside.states().velocity()), "{simd}");
    }
}
