//! Logarithmic steps: fits along a curved valley, and parameters with linear steps.

use std::sync::atomic::AtomicBool;

use pendmap::fit::levenberg_marquardt::{Limit, Outcome, Point, descend};
use pendmap::fit::step_scale::StepScale;
use pendmap::fit::window::Window;
use pendmap::fit::{Problem, Slot};
use pendmap::model::{Kind, Parameter};

use crate::fit_records::{TOLERANCE, free, record, with};
use crate::support::undriven;

const RELEASES: [f64; 3] = [2.6, 1.7, 1.1];
/// Coulomb friction, then strength, position and width of the rough spot.
const PLACES: [Parameter; 4] = [Parameter::ThetaR, of_spot(0), of_spot(1), of_spot(2)];

const fn of_spot(place: usize) -> Parameter {
    Parameter::OfEffect { effect: 0, place }
}

/// Free decays over a rough spot; friction and the free parameters of the spot start elsewhere.
fn rough(spot: [f64; 3], places: &[Parameter], start: &[f64]) -> Problem {
    let own = with(
        undriven(0.01, 0.0).with_friction(0.0025).expect("in range"),
        &[(Kind::RoughSpot, &spot)],
    );
    let records = RELEASES.map(|theta| record(own.clone(), None, [theta, 0.0], 150.0)).to_vec();
    let slots: Vec<Slot> = places.iter().map(|place| Slot::Parameter(*place)).collect();
    Problem::new(records, free(&slots, 3, start), TOLERANCE).expect("a problem")
}

/// The fit from the starting values, with the true initial states.
fn searched(problem: &Problem, steps: usize) -> (Point, Outcome) {
    let windows = RELEASES.iter().enumerate().map(|(record, theta)| Window {
        record,
        from: 0,
        to: problem.records[record].times.len(),
        start: [*theta, 0.0],
    });
    let mut point = Point::new(problem, problem.start(), windows.collect()).expect("a motion");
    let limit = Limit { gain: 1e-12, part: 0.0, steps, target: f64::INFINITY };
    let outcome = descend(problem, &mut point, &[], limit, &AtomicBool::new(false));
    (point, outcome.expect("not cancelled"))
}

#[test]
fn a_rough_spot_is_found_from_another_width() {
    let spot = [0.0012, 0.49, 0.34];
    let near = [(0.0024, 0.58, 0.14), (0.0009, 0.42, 0.48), (0.002, 0.49, 0.2)];
    let far = [(0.0012, 0.44, 0.12), (0.002, 0.62, 0.12), (0.0008, 0.58, 0.54)];
    for (force, place, width) in near.into_iter().chain(far) {
        let problem = rough(spot, &PLACES, &[0.0026, force, place, width]);
        let (point, outcome) = searched(&problem, 25);
        assert!(outcome.converged, "{width}: {:?}", point.values);
        for (value, truth) in point.values.iter().zip([0.0025, spot[0], spot[1], spot[2]]) {
            assert!((value - truth).abs() < 1e-6, "{width}: {:?}", point.values);
        }
    }
}

#[test]
fn a_size_may_change_its_sign() {
    let free = [PLACES[0], PLACES[1], PLACES[3]];
    let problem = rough([-0.0004, 0.49, 0.34], &free, &[0.0025, 1e-5, 0.3]);
    let (point, _) = searched(&problem, 40);
    assert!((point.values[1] + 0.0004).abs() < 1e-6, "{:?}", point.values);
}

#[test]
fn widths_and_their_sizes_take_logarithmic_steps() {
    let problem = rough([0.001, 0.4, 0.3], &PLACES, &[0.0025, 0.001, 0.4, 0.3]);
    assert_eq!(
        problem.scales,
        [StepScale::Linear, StepScale::Size, StepScale::Linear, StepScale::Width]
    );
    let problem = rough([0.001, 0.4, 0.3], &PLACES[..3], &[0.0025, 0.001, 0.4]);
    assert_eq!(problem.scales, [StepScale::Linear; 3]);
}

#[test]
fn both_scales_of_steps_agree_to_first_order() {
    for scale in [StepScale::Linear, StepScale::Size, StepScale::Width] {
        assert!((scale.gone(2.0, 1e-6) - 2.000_001).abs() < 1e-12);
        assert!((scale.gone(2.0, 1e-6) - scale.gone(2.0, 0.0) - 1e-6).abs() < 1e-12);
    }
    // A width remains positive, within a factor of e^2; a size may cross 0.
    assert!(StepScale::Width.gone(0.1, -5.0) > 0.0);
    assert!((StepScale::Width.part(0.1, 2.0) - 0.1).abs() < 1e-15);
    assert!((StepScale::Size.gone(0.1, -5.0) + 4.9).abs() < 1e-15);
    assert!((StepScale::Size.gone(0.0, 0.3) - 0.3).abs() < 1e-15);
}
