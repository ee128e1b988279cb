//! Multipliers of +1 and -1 at known bifurcations.

use pendmap::integrate::State;
use pendmap::integrate::accuracy::distance;
use pendmap::model::Pendulum;
use pendmap::orbit::newton::find;
use pendmap::orbit::{PeriodicOrbit, PoincareMap};
use serde_json::Value;

use crate::support::driven;
use crate::truths::{list, number, table, truths};

/// A bifurcation: pendulum, point, period, and the critical multiplier.
struct Event {
    name: String,
    pendulum: Pendulum,
    point: State,
    n: usize,
    multiplier: f64,
}

fn event(name: &str, entry: &Value, omega: f64, n: usize, multiplier: f64) -> Event {
    Event {
        name: name.to_owned(),
        pendulum: driven(0.1, number(&entry["p"]), omega),
        point: [number(&entry["theta"]), number(&entry["v"])],
        n,
        multiplier,
    }
}

fn events() -> Vec<Event> {
    let at_two = &truths()["bifurcations_gamma0.1_omega2"];
    let mut events: Vec<Event> = [
        ("osc_SB", 2, 1.0),
        ("osc_PD1", 2, -1.0),
        ("osc_PD2", 4, -1.0),
        ("rot_SN", 1, 1.0),
        ("rot_PD1", 1, -1.0),
    ]
    .into_iter()
    .map(|(name, n, multiplier)| event(name, &at_two[name], 2.0, n, multiplier))
    .collect();
    let folds = &truths()["rotation_saddle_node"];
    events.push(event("rotSN_w1.0", &folds["rotSN_w1.0"], 1.0, 1, 1.0));
    events.push(event("rotSN_w3.0", &folds["rotSN_w3.0"], 3.0, 1, 1.0));
    events
}

#[test]
fn multipliers_at_the_known_bifurcations() {
    for event in events() {
        let map = PoincareMap::new(&event.pendulum);
        let image = map.iterate(event.point, event.n);
        let gap = distance(image.state, event.point);
        assert!(gap < 1e-12, "{}: closes to {gap:e}", event.name);
        // With one multiplier m = +-1 the other is the determinant over m.
        let product = (-event.pendulum.gamma * event.n as f64 * event.pendulum.period()).exp();
        let trace = event.multiplier + product / event.multiplier;
        let error = (image.derivative.trace() - trace).abs();
        assert!(error < 1e-10, "{}: trace {} for {trace}", event.name, image.derivative.trace());
    }
}

#[test]
fn traces_are_the_reference_ones() {
    for event in events() {
        let map = PoincareMap::new(&event.pendulum);
        let tables = [&truths()["bifurcations_gamma0.1_omega2"], &truths()["rotation_saddle_node"]];
        let entry = tables.iter().find_map(|t| t.get(&event.name)).expect("its entry");
        // For the symmetric oscillation the reference has the trace of -P, its root.
        let symmetric = event.name == "osc_SB";
        let n = if symmetric { 1 } else { event.n };
        let sign = if symmetric { -1.0 } else { 1.0 };
        let trace = sign * map.iterate(event.point, n).derivative.trace();
        assert!((trace - number(&entry["trace"])).abs() < 1e-10, "{}: {trace}", event.name);
    }
}

#[test]
fn doublings_take_the_stability() {
    for event in events().iter().filter(|e| e.multiplier < 0.0) {
        let at = |p: f64| -> PeriodicOrbit {
            let pendulum = driven(0.1, p, event.pendulum.drive.omega);
            let orbit = find(&PoincareMap::new(&pendulum), event.point, event.n, 0.1);
            orbit.unwrap_or_else(|| panic!("{} at p = {p}", event.name))
        };
        let p = event.pendulum.drive.p;
        assert!(at(p - 1e-5).is_stable(), "{} before", event.name);
        let after = at(p + 1e-5);
        assert!(!after.is_stable() && after.multipliers.0[0].re < -1.0, "{} after", event.name);
        assert_eq!(after.n, event.n, "{}: Newton keeps to the orbit that doubles", event.name);
        // At the bifurcation itself: Newton's method is regular at -1.
        let there = at(p);
        assert!((there.multipliers.0[0].re + 1.0).abs() < 1e-9, "{}", event.name);
        assert!(there.contains(event.point, 1e-9), "{}", event.name);
    }
}

#[test]
fn folds_end_their_orbits() {
    for event in events().iter().filter(|e| e.name.contains("SN")) {
        let try_at = |p: f64| {
            let map = PoincareMap::new(&driven(0.1, p, event.pendulum.drive.omega));
            let around = |by: f64| [event.point[0] + by, event.point[1]];
            [-0.02, -0.005, 0.0, 0.005, 0.02]
                .into_iter()
                .filter_map(|by| find(&map, around(by), 1, 0.1))
                .filter(|orbit| orbit.w == 1)
                .collect::<Vec<_>>()
        };
        let p = event.pendulum.drive.p;
        assert!(try_at(p - 1e-4).is_empty(), "{}: nothing rotates before the fold", event.name);
        let after = try_at(p + 1e-4);
        let stable = after.iter().filter(|orbit| orbit.is_stable()).count();
        assert!(0 < stable && stable < after.len(), "{}: a node and a saddle", event.name);
    }
}

#[test]
fn symmetry_breaking_makes_two_of_one() {
    let event = &events()[0];
    let find_at = |p: f64, start: State| {
        find(&PoincareMap::new(&driven(0.1, p, 2.0)), start, 2, 0.3).expect("the oscillation")
    };
    let p = event.pendulum.drive.p;
    let before = find_at(p - 0.01, event.point);
    let mirror = |s: State| [-s[0], -s[1]];
    assert!(before.is_stable() && before.contains(mirror(before.points[0]), 1e-9));
    let after = find_at(p + 0.01, event.point);
    assert!(!after.is_stable() && after.multipliers.0[0].re > 1.0);
    // Next to it are two stable ones, leaning to either side, mirror images of each other.
    let map = PoincareMap::new(&driven(0.1, p + 0.01, 2.0));
    let beside = [event.point[0] + 0.15, event.point[1]];
    let settled = map.iterate(beside, 1000).state;
    let one = find_at(p + 0.01, settled);
    assert!(one.is_stable() && one.n == 2 && one.w == 0);
    let other = find_at(p + 0.01, mirror(one.points[0]));
    assert!(other.is_stable() && !other.contains(one.points[0], 1e-2));
    assert!(
        other.contains(mirror(one.points[0]), 1e-9) && other.contains(mirror(one.points[1]), 1e-9)
    );
}

#[test]
fn rest_loses_stability_where_it_should() {
    for (name, entry) in table(&truths()["rest_onset"]) {
        let (omega, onset) = (number(&entry["omega"]), number(&entry["p_onset"]));
        let rest = |p: f64| {
            find(&PoincareMap::new(&driven(0.1, p, omega)), [0.0; 2], 1, 0.1).expect("rest")
        };
        assert!(rest(onset - 1e-6).is_stable(), "{name}");
        assert!(!rest(onset + 1e-6).is_stable(), "{name}");
        assert!((rest(onset).multipliers.0[0].re + 1.0).abs() < 1e-9, "{name}");
        if let Some(fold) = entry.get("p_fold") {
            let point = [number(&entry["fold_theta"]), number(&entry["fold_v"])];
            let pendulum = driven(0.1, number(fold), omega);
            let image = PoincareMap::new(&pendulum).iterate(point, 2);
            assert!(distance(image.state, point) < 1e-12, "{name}");
            let product = (-0.2 * pendulum.period()).exp();
            assert!((image.derivative.trace() - 1.0 - product).abs() < 1e-10, "{name}");
        }
    }
}

#[test]
fn boundaries_of_the_linearised_pendulum() {
    for (kind, by_omega) in table(&truths()["mathieu_boundaries"]) {
        let gamma = if kind == "undamped" { 0.0 } else { 0.1 };
        for (omega, boundaries) in table(by_omega) {
            for boundary in list(boundaries) {
                let omega = omega.parse().expect("a number");
                let pendulum = driven(gamma, number(&boundary["p"]), omega);
                let image = PoincareMap::new(&pendulum).once([0.0; 2]);
                let m = number(&boundary["multiplier"]);
                let trace = m + (-gamma * pendulum.period()).exp() / m;
                let error = (image.derivative.trace() - trace).abs();
                assert!(error < 1e-10, "{kind} {omega} {boundary}: {error:e}");
            }
        }
    }
}
