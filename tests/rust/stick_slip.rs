//! Friction with stick and slip, in single trajectories.

use std::f64::consts::{PI, TAU};

use pendmap::integrate::reference::driver::Driver;
use pendmap::integrate::reference::flow::Flow;
use pendmap::integrate::reference::problem::OdeProblem;
use serde_json::Value;

use crate::truths::{list, model, number, truths};

/// The known trajectories with friction.
fn known() -> impl Iterator<Item = (&'static Value, pendmap::model::Pendulum, [f64; 2])> {
    list(&truths()["stick_slip"]).iter().map(|entry| {
        let pendulum = model(entry).with_friction(number(&entry["theta_r"])).expect("in range");
        (entry, pendulum, [number(&entry["theta0"]), number(&entry["v0"])])
    })
}

#[test]
fn turns_sticks_and_releases_are_where_they_are() {
    for (entry, pendulum, start) in known() {
        let until = number(&entry["periods"]) * pendulum.period();
        let ode = OdeProblem::new(&pendulum, true, 1e-13, |_, value| value);
        let mut driver = Driver::new(&ode, 0.0, start, until);
        driver.finish(|_| ());
        let expected = list(&entry["events"]);
        assert_eq!(driver.events.len(), expected.len(), "{entry}");
        for (event, expected) in driver.events.iter().zip(expected) {
            assert_eq!(event.kind.words(), expected["what"].as_str().expect("a word"), "{event:?}");
            assert!((event.tau - number(&expected["tau"])).abs() < 1e-10, "{event:?} {expected}");
            assert!((event.theta - number(&expected["theta"])).abs() < 1e-10, "{event:?}");
        }
        let end = [number(&entry["theta"]), number(&entry["v"])];
        let error = (driver.state[0] - end[0]).hypot(driver.state[1] - end[1]);
        assert!(error < 1e-11, "{start:?}: {error:e}");
    }
}

#[test]
fn the_map_carries_the_same_states_period_by_period() {
    for (entry, pendulum, mut state) in known() {
        let flow = Flow::new(&pendulum);
        let mut arrival = flow.carry(state, 0.0, 0.0);
        for _ in 0..number(&entry["periods"]) as usize {
            arrival = flow.carry(state, 0.0, pendulum.period());
            state = arrival.state;
        }
        let end = [number(&entry["theta"]), number(&entry["v"])];
        let error = (state[0] - end[0]).hypot(state[1] - end[1]);
        assert!(error < 1e-11, "{state:?}: {error:e}");
        assert_eq!(arrival.stuck, end[1] == 0.0, "{entry}");
    }
}

#[test]
fn the_determinant_is_the_product_of_the_ratios() {
    for (_, pendulum, start) in known() {
        let flow = Flow::new(&pendulum);
        let mut state = start;
        for _ in 0..6 {
            let arrival = flow.carry(state, 0.0, pendulum.period());
            let [[a, b], [c, d]] = arrival.derivative;
            let size = a.hypot(b).hypot(c).hypot(d);
            let error = (a * d - b * c - arrival.product.expect("nothing but friction")).abs();
            assert!(error < 1e-12 * (1.0 + size * size), "{state:?}: {error:e}");
            state = arrival.state;
        }
    }
}

#[test]
fn known_forced_orbits_close() {
    let orbits = &truths()["coulomb_forced"];
    let residual = |entry: &Value, fraction: f64, image: [f64; 2], turns: f64| {
        let pendulum = model(entry).with_friction(number(&entry["theta_r"])).expect("in range");
        let period = pendulum.period();
        let arrival = Flow::new(&pendulum).carry(point(entry), 0.0, fraction * period);
        let gap = arrival.state[0] - turns * TAU - image[0];
        (gap.hypot(arrival.state[1] - image[1]), arrival)
    };
    for entry in list(&orbits["rotation"]) {
        let (gap, arrival) = residual(entry, 1.0, point(entry), 1.0);
        assert!(gap < 1e-12, "{entry}: {gap:e}");
        let even = (-number(&entry["gamma"]) * PI).exp();
        assert_eq!(arrival.product.map(|product| (product - even).abs() < 1e-15), Some(true));
    }
    for entry in list(&orbits["oscillation"]) {
        let half = [number(&entry["half"][0]), number(&entry["half"][1])];
        for (fraction, image) in [(1.0, half), (2.0, point(entry))] {
            let (gap, _) = residual(entry, fraction, image, 0.0);
            assert!(gap < 1e-12, "{entry}: {gap:e}");
        }
    }
}

fn point(entry: &Value) -> [f64; 2] {
    [number(&entry["theta"]), number(&entry["v"])]
}
