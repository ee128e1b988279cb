//! The corner of the load-dependent friction, at which the rod's load passes zero.

use std::f64::consts::PI;

use pendmap::integrate::accuracy::{choose, distance};
use pendmap::integrate::reference::driver::{Driver, Piece};
use pendmap::integrate::reference::event::EventKind;
use pendmap::integrate::reference::flow::Flow;
use pendmap::integrate::reference::problem::OdeProblem;
use pendmap::integrate::{State, Strobe};
use pendmap::model::{Effect, Kind, Pendulum};

use crate::support::{advanced, driven, simd, spread};

/// A pendulum with this friction in addition to Coulomb's.
fn loaded(base: Pendulum, theta_r: f64, k: f64) -> Pendulum {
    let effect = Effect::new(Kind::LoadDependentFriction, &[k]).expect("in range");
    base.with_friction(theta_r).and_then(|p| p.with_effect(effect)).expect("in range")
}

/// Rods whose load changes sign often, and one that also rotates.
fn models() -> [Pendulum; 3] {
    [
        loaded(driven(0.1, 0.6, 2.0), 0.05, 0.15),
        loaded(driven(0.1, 1.5, 1.3), 0.0, 0.2),
        loaded(driven(0.05, 1.0, 2.0), 0.3, 0.25),
    ]
}

/// Without drive and damping, and with equal Coulomb friction, `w = v^2` obeys between turns and
/// corners `dw/dth + c w = -2 sin th - c cos th` with `c` the friction times 2, the sense and the
/// side: `w = A cos th + B sin th + C exp(-c th)`.
struct Exact {
    c: f64,
    from: [f64; 2],
}

impl Exact {
    fn square(&self, theta: f64) -> f64 {
        let c = self.c;
        let (a, b) = ((2.0 - c * c) / (1.0 + c * c), -3.0 * c / (1.0 + c * c));
        let own = |theta: f64| a * theta.cos() + b * theta.sin();
        own(theta) + (self.from[1] - own(self.from[0])) * (-c * (theta - self.from[0])).exp()
    }
}

/// The first angle, in the sense of motion, at which `value` is negative.
fn first_below(from: f64, sense: f64, value: impl Fn(f64) -> f64) -> f64 {
    let mut low = 1e-9;
    while value(from + sense * (low + 1e-4)) >= 0.0 && low < 7.0 {
        low += 1e-4;
    }
    let mut high = low + 1e-4;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if value(from + sense * middle) < 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    from + sense * high
}

/// The angles of the first turns from `theta = 0`, with `k` the strength of both frictions, and the
/// number of corners before the last.
fn exact_turns(k: f64, velocity: f64, count: usize) -> (Vec<f64>, usize) {
    let (mut state, mut sense, mut side) = ([0.0, velocity * velocity], 1.0, 1.0);
    let (mut turns, mut corners) = (Vec::new(), 0);
    while turns.len() < count {
        let piece = Exact { c: 2.0 * k * sense * side, from: state };
        let turn = first_below(state[0], sense, |theta| piece.square(theta));
        let corner = first_below(state[0], sense, |theta| {
            let ahead = (theta - turn) * sense < 0.0;
            if ahead { side * (theta.cos() + piece.square(theta)) } else { -1.0 }
        });
        if (turn - corner) * sense > 1e-12 {
            state = [corner, piece.square(corner)];
            side = -side;
            corners += 1;
        } else {
            turns.push(turn);
            state = [turn, 0.0];
            sense = -sense;
        }
    }
    (turns, corners)
}

#[test]
fn turns_beyond_corners_are_where_the_exact_solution_has_them() {
    for (k, velocity) in [(0.02, 1.9), (0.05, 1.8), (0.1, 2.0)] {
        let (turns, corners) = exact_turns(k, velocity, 3);
        assert!(corners >= 2, "{corners}");
        let pendulum = loaded(Pendulum::new(0.0, 0.0, 1.0, 0.0, 0.0).expect("ok"), k, k);
        let ode = OdeProblem::new(&pendulum, true, 1e-14, |_, value| value);
        let mut driver = Driver::new(&ode, 0.0, [0.0, velocity], 30.0);
        driver.finish(|_| ());
        let found: Vec<f64> =
            driver.events.iter().filter(|e| e.kind == EventKind::Turn).map(|e| e.theta).collect();
        for (found, turn) in found.iter().zip(&turns) {
            assert!((found - turn).abs() < 1e-12, "{k}: {found} for {turn}");
        }
        assert!(found.len() >= 3, "{:?}", driver.events);
    }
}

#[test]
fn the_error_follows_the_tolerance_through_corners() {
    let rubbing = driven(0.1, 0.8, 1.2).with_friction(0.15).expect("in range");
    for pendulum in models().into_iter().chain([rubbing]) {
        for start in [[2.79, 0.49], [0.5, 1.5], [-1.2, 2.2]] {
            let end = |tolerance: f64| {
                let ode = OdeProblem::new(&pendulum, true, tolerance, |_, value| value);
                let mut driver = Driver::new(&ode, 0.0, start, 9.0);
                driver.finish(|_| ());
                driver.state
            };
            let exact = end(1e-15);
            for tolerance in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] {
                let error = distance(end(tolerance), exact);
                assert!(
                    error < 100.0 * tolerance,
                    "{pendulum:?} {start:?} {tolerance:e}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn derivatives_stay_right_through_corners() {
    for pendulum in models() {
        let flow = Flow::new(&pendulum);
        for start in [[2.79, 0.49], [0.5, 1.5], [-1.2, 2.2], [1.8, -1.3]] {
            let ahead = 1.3 * pendulum.period();
            let arrival = flow.carry(start, 0.0, ahead);
            for column in 0..2 {
                let moved = |by: f64| {
                    let mut start = start;
                    start[column] += by;
                    flow.carry(start, 0.0, ahead).state
                };
                let by = 1e-6;
                let [forth, back] = [moved(by), moved(-by)];
                for row in 0..2 {
                    let expected = (forth[row] - back[row]) / (2.0 * by);
                    let found = arrival.derivative[row][column];
                    let error = (found - expected).abs();
                    assert!(error < 1e-6 * (1.0 + expected.abs()), "{start:?}: {found} {expected}");
                }
            }
        }
    }
}

/// The sorted distances of lanes from the reference after a number of periods.
fn errors(pendulum: &Pendulum, starts: &[State], steps: usize, periods: usize) -> Vec<f64> {
    let flow = Flow::new(pendulum);
    let ends = advanced(&Strobe::new(pendulum, steps, simd()), starts, periods);
    let duration = periods as f64 * pendulum.period();
    let mut errors: Vec<f64> = starts
        .iter()
        .zip(&ends)
        .map(|(start, end)| distance(*end, flow.carry(*start, 0.0, duration).state))
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn lanes_meet_corners_as_the_reference_does() {
    for pendulum in models() {
        let starts = spread(400, PI, 3.0);
        let errors = errors(&pendulum, &starts, 150, 3);
        let [median, most] = [errors[200], errors[399]];
        println!("{median:e} {:e} {most:e}", errors[395]);
        assert!(median < 1e-11 && most < 1e-8, "{pendulum:?}: {median:e} {most:e}");
    }
}

#[test]
fn lanes_keep_order_eight_through_corners() {
    for pendulum in models() {
        let starts = spread(400, PI, 3.0);
        let steps = [16.0, 24.0, 36.0].map(|n| (n * pendulum.period() / PI) as usize);
        let median = steps.map(|n| errors(&pendulum, &starts, n, 1)[200]);
        let high = steps.map(|n| errors(&pendulum, &starts, n, 1)[380]);
        println!("{median:?} {high:?}");
        let order = |of: &[f64; 3]| (of[0] / of[2]).ln() / (steps[2] as f64 / steps[0] as f64).ln();
        assert!(order(&median) > 7.5, "{pendulum:?}: {median:?}");
        assert!(order(&high) > 6.5, "{pendulum:?}: {high:?}");
    }
}

#[test]
fn steps_for_a_tolerance_are_those_of_other_effects() {
    let starts = spread(400, PI, 3.0);
    let drag = Effect::new(Kind::QuadraticDrag, &[0.15]).expect("in range");
    for pendulum in models() {
        let steps = |p: &Pendulum| choose(p, &starts, 1e-6, simd()).expect("steps").0.steps();
        let mut other = pendulum.clone();
        other.effects = vec![drag.clone()];
        let [found, other] = [&pendulum, &other].map(steps);
        println!("{found} {other}");
        assert!(found <= 2 * other, "{pendulum:?}: {found} steps, {other} with drag");
    }
}

#[test]
fn a_load_that_only_just_touches_zero_is_not_missed() {
    // Between a start with two further corners in a period and one without them is one whose load
    // touches zero: on both sides, at decreasing distances, lanes must agree with the reference.
    let pendulum = loaded(driven(0.1, 0.6, 2.0), 0.02, 0.2);
    let flow = Flow::new(&pendulum);
    let strobe = Strobe::new(&pendulum, 60, simd());
    let equation = pendulum.equation();
    let corners = |start: State| {
        let ode = OdeProblem::new(&pendulum, false, 1e-12, |_, value| value);
        let mut driver = Driver::new(&ode, 0.0, start, pendulum.period());
        let mut sides = Vec::new();
        while let Some(piece) = driver.advance() {
            if matches!(piece, Piece::Step) {
                sides.push(driver.dense.signs[1]);
            }
        }
        sides.windows(2).filter(|w| w[0] * w[1] < 0.0).count()
    };
    assert!(equation.has_corner());
    let mut touches = 0;
    for theta in [-2.8, -2.2, -1.5, 1.3, 2.0, 2.4] {
        let at = |k: usize| [theta, -2.9 + 0.1 * k as f64];
        for k in 0..58 {
            let (mut low, mut high) = (at(k)[1], at(k + 1)[1]);
            let few = corners([theta, low]);
            if corners([theta, high]).abs_diff(few) != 2 {
                continue;
            }
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if corners([theta, middle]) == few {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            touches += 1;
            for offset in [1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11] {
                for velocity in [low - offset, high + offset] {
                    let start = [theta, velocity];
                    let truth = flow.carry(start, 0.0, pendulum.period()).state;
                    let error = distance(advanced(&strobe, &[start], 1)[0], truth);
                    assert!(error < 1e-9, "{start:?}: {error:e}");
                }
            }
        }
    }
    assert!(touches > 3, "{touches}");
}

/// The equation stores the side of one corner: a second effect with a corner needs another.
#[test]
fn one_effect_of_the_library_has_a_corner() {
    let cornered = Kind::ALL.iter().filter(|kind| {
        let effect = Effect { kind: (**kind).clone(), parameters: [1.0; 3] };
        let pendulum = Pendulum { effects: vec![effect], ..driven(0.1, 1.0, 2.0) };
        pendulum.equation().has_corner()
    });
    assert_eq!(cornered.count(), 1);
}
