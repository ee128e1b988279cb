//! Chaotic attractors, and transients that must not be mistaken for them.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use pendmap::attractor::capture::{Fate, Traps, outcomes};
use pendmap::attractor::chaos::{observed, sets};
use pendmap::attractor::{Effort, Kind};
use pendmap::integrate::trajectory::{Request, simulate};
use pendmap::integrate::{State, Strobe};
use pendmap::maps::basins::{BasinMap, Labelling};
use pendmap::maps::label::NEVER;
use pendmap::model::Pendulum;

use crate::support::{basins_on_plane, chaos_among_others, driven, instruction_sets, plane};
use crate::truths::{model, number, table, truths};

/// The three points of figure 2 and one more with a reference exponent: p, omega and the map.
fn planes() -> &'static [(f64, f64, BasinMap); 4] {
    static PLANES: OnceLock<[(f64, f64, BasinMap); 4]> = OnceLock::new();
    PLANES.get_or_init(|| {
        [(1.03, 0.87), (1.7, 0.87), (1.5, 1.8), (2.0, 2.0)]
            .map(|(p, omega)| (p, omega, basins_on_plane(&driven(0.1, p, omega), 40)))
    })
}

/// A torque greater than the friction, and no loss that grows with the velocity.
fn runaway() -> Pendulum {
    Pendulum::new(0.0, 0.5, 2.0, 0.0, 1.3).and_then(|p| p.with_friction(0.1)).expect("in range")
}

#[test]
fn a_rotation_that_gains_speed_for_ever_is_no_chaos() {
    let map = basins_on_plane(&runaway(), 8);
    assert!(map.attractors.is_empty(), "{:?}", map.attractors[0].name);
    assert!((map.share(0) - 1.0).abs() < 1e-12);
}

#[test]
fn trajectories_that_leave_their_region_form_no_set() {
    // No other criterion would have left it out.
    let states: Vec<State> = (0..6).map(|k| [0.4 * f64::from(k), 20.0]).collect();
    for simd in instruction_sets() {
        let strobe = Strobe::new(&runaway(), 60, simd);
        let (effort, cancel) = (Effort::THOROUGH, AtomicBool::new(false));
        let traps = Traps::default();
        let runs = observed(&strobe, &traps, &states, 200, &effort, &cancel).expect("runs");
        let found = sets(&strobe, &traps, &[], runs, 200, &effort, &cancel).expect("sets");
        assert!(found.is_empty(), "{simd}");
    }
}

/// The chaotic attractor of a plane with no other attractor.
fn only_chaos(map: &BasinMap) -> &pendmap::attractor::Attractor {
    assert_eq!(map.labelling, Labelling::OnlyChaos);
    let [chaos] = map.attractors.as_slice() else { panic!("{} attractors", map.attractors.len()) };
    assert_eq!((chaos.kind, chaos.name.as_str()), (Kind::TumblingChaos, "tumbling chaos"));
    assert_eq!((chaos.n, chaos.w, chaos.period), (None, 0, None));
    assert_eq!((chaos.twin, chaos.multipliers.len()), (Some(0), 0));
    assert!(chaos.points.len() > 500 && chaos.points.len() <= 2000);
    assert!(chaos.exponent > 10.0 * chaos.exponent_stderr && chaos.exponent_stderr > 0.0);
    chaos
}

#[test]
fn tumbling_chaos_takes_everything_at_the_three_points_of_figure_2() {
    for (_, _, map) in planes() {
        let chaos = only_chaos(map);
        // Its points are on it: none is captured elsewhere, and both senses occur.
        assert!(
            chaos.points.iter().any(|s| s[1] > 0.5) && chaos.points.iter().any(|s| s[1] < -0.5)
        );
        assert!((map.fractions[0] - 1.0).abs() < 1e-12);
        // Labels are meaningless, so the other layers are computed.
        let layers = map.layers.as_ref().expect("layers");
        assert!((3..=60).contains(&map.layer_periods));
        assert!(layers.turns.iter().any(|t| *t > 0) && layers.turns.iter().any(|t| *t < 0));
        assert!(layers.exponent.iter().all(|e| e.is_finite()));
    }
}

#[test]
fn exponents_are_the_reference_ones() {
    for (name, entry) in table(&truths()["lyapunov"]) {
        let drive = model(entry).drive;
        let own = |(p, omega, _): &&(f64, f64, BasinMap)| {
            (p - drive.p).hypot(omega - drive.omega) < 1e-12
        };
        let (_, _, map) = planes().iter().find(own).expect("its plane");
        let chaos = only_chaos(map);
        let (exact, stderr) = (number(&entry["lle_per_tau"]), number(&entry["se"]));
        let allowed = 3.0 * stderr.hypot(chaos.exponent_stderr);
        let error = (chaos.exponent - exact).abs();
        assert!(error < allowed, "{name}: {} for {exact}, {allowed} allowed", chaos.exponent);
        // A meaningful standard error: at most two per cent.
        assert!(chaos.exponent_stderr < 0.02 * exact, "{name}: {}", chaos.exponent_stderr);
    }
}

#[test]
fn exponent_of_one_trajectory() {
    let exponent = |p: f64, omega: f64, until: f64, start: State| {
        let request = Request { start, until, tol: 1e-7, samples: 20, lyapunov: true };
        let run = simulate(&driven(0.1, p, omega), &request, &AtomicBool::new(false));
        run.expect("a trajectory").exponent.expect("asked for")
    };
    let entry = &truths()["lyapunov"]["w0.87_p1.7"];
    let (mean, stderr) = exponent(1.7, 0.87, 20_000.0, [1.0, 0.0]);
    let exact = number(&entry["lle_per_tau"]);
    assert!((mean - exact).abs() < 3.0 * stderr.hypot(number(&entry["se"])), "{mean} +- {stderr}");
    assert!(stderr < 0.05 * exact, "{stderr}");
    // At a focus of the map both multipliers have the modulus exp(-gamma n T / 2).
    let (mean, stderr) = exponent(1.0, 2.0, 4000.0, [0.5, 0.0]);
    assert!((mean + 0.05).abs() < 3.0 * stderr + 1e-3, "{mean} +- {stderr}");
}

#[test]
fn long_transients_are_not_called_chaotic() {
    for p in [1.2, 1.8] {
        let map = basins_on_plane(&driven(0.1, p, 2.0), 60);
        assert_eq!(map.labelling, Labelling::Basins, "p = {p}");
        for attractor in &map.attractors {
            assert!(!attractor.kind.is_chaotic(), "p = {p}: {}", attractor.name);
            assert!(attractor.exponent < 0.0);
        }
        assert!(map.share(0) < 0.01, "p = {p}: {} undecided", map.share(0));
        // Some take hundreds of periods.
        assert!(map.labels.settle.iter().any(|s| *s > 200), "p = {p}");
    }
}

#[test]
fn chaos_beside_other_attractors() {
    let starts = plane(24);
    let (strobe, catalogue, labels) = chaos_among_others();
    assert!(catalogue.has_chaos() && catalogue.only_chaos().is_none());
    let names: Vec<&str> = catalogue.attractors.iter().map(|a| a.name.as_str()).collect();
    assert!(names.contains(&"rest") && names.contains(&"tumbling chaos"), "{names:?}");
    let chaos = names.iter().position(|name| *name == "tumbling chaos").expect("it");
    let own = |i: &usize| labels.label[*i] == chaos as i16 + 1;
    let cells: Vec<usize> = (0..starts.len()).filter(own).collect();
    let share = cells.len() as f64 / starts.len() as f64;
    assert!(share > 0.02 && share < 0.1, "{share}");
    assert!(cells.iter().all(|i| labels.settle[*i] == NEVER));
    // No other attractor captures a start with this label within a very long time.
    let states: Vec<State> = cells.iter().map(|i| starts.get(*i)).collect();
    for outcome in outcomes(strobe, &catalogue.traps, 3000, &states, &AtomicBool::new(false))
        .expect("outcomes")
    {
        assert_eq!(outcome.fate, Fate::Open);
    }
}

#[test]
fn mirror_twins_of_chaos_are_known_as_twins() {
    // Below the crisis that merges them, two mirror images librate chaotically.
    let map = basins_on_plane(&driven(0.1, 1.0, 0.87), 30);
    let names: Vec<&str> = map.attractors.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["libration chaos (-)", "libration chaos (+)"]);
    assert_eq!(map.attractors[0].twin, Some(1));
    assert_eq!(map.attractors[1].twin, Some(0));
    assert!(map.share(0) < 0.01, "{} undecided", map.share(0));
}
