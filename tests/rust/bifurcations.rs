//! Multipliers of +1 and -1 at known bifurcations.

use pendmap::integrate::State;
use pendmap::integrate::accuracy::distance;
use pendmap::model::Pendulum;
use pendmap::orbit::PoincareMap;
use pendmap::orbit::newton::find;
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
