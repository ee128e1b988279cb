//! Lyapunov exponents against reference values, multipliers, and the exact derivatives through
//! turns and sticks.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use nalgebra::Vector2;
use pendmap::attractor::Kind;
use pendmap::integrate::{State, Strobe};
use pendmap::maps::control::{Control, pool};
use pendmap::maps::ensemble::TRAJECTORIES;
use pendmap::maps::lyapunov::{End, Exponent, Request, lyapunov};
use pendmap::maps::tangent_growth::Bundle;
use pendmap::model::Pendulum;
use pendmap::orbit::PoincareMap;

use crate::support::{driven, instruction_sets, spread, undriven};
use crate::truths::{attractors_at, number, table, truths};

fn request(start: State) -> Request {
    Request { start, precision: 1e-3, tol: 1e-6, max_periods: None, threads: 0, seed: 0 }
}

fn of(pendulum: &Pendulum, request: &Request) -> Exponent {
    lyapunov(pendulum, request, &Control::default()).expect("an exponent")
}

#[test]
fn chaos_has_its_reference_exponents() {
    for (name, entry) in table(&truths()["lyapunov"]) {
        let get = |key: &str| number(&entry[key]);
        let pendulum = driven(get("gamma"), get("p"), get("omega"));
        let found = of(&pendulum, &request([1.0, 0.0]));
        assert_eq!((found.end, found.lost), (End::Chaotic, 0), "{name}");
        let ensemble = found.ensemble.expect("an ensemble");
        let (exponent, stderr) = (ensemble.exponent, ensemble.stderr);
        let exact = get("lle_per_tau");
        assert!(stderr < 1e-3 * exponent && stderr > 2e-4 * exponent, "{name}: {stderr}");
        let sure = 3.0 * stderr.hypot(get("se"));
        assert!((exponent - exact).abs() < sure, "{name}: {exponent} +- {stderr}, {exact}");
        let dimension = 1.0 + exponent / (exponent - ensemble.sum.0);
        assert!((dimension - get("D_KY_map")).abs() < 2e-3, "{name}: {dimension}");
    }
}

#[test]
fn the_standard_error_is_the_spread_over_seeds() {
    let pendulum = driven(0.1, 2.0, 2.0);
    let found: Vec<(f64, f64)> = (0..12)
        .map(|seed| {
            let request = Request { precision: 0.07, seed, ..request([1.0, 0.0]) };
            let ensemble = of(&pendulum, &request).ensemble.expect("an ensemble");
            assert_eq!(ensemble.growth.len(), TRAJECTORIES);
            (ensemble.exponent, ensemble.stderr)
        })
        .collect();
    let count = found.len() as f64;
    let mean = found.iter().map(|f| f.0).sum::<f64>() / count;
    let spread = found.iter().map(|f| ((f.0 - mean) / f.1).powi(2)).sum::<f64>();
    // Chi squared with 11 degrees of freedom: outside once in five hundred.
    assert!((1.8..31.3).contains(&spread), "{spread}");
    let exact = number(&truths()["lyapunov"]["w2.0_p2.0"]["lle_per_tau"]);
    let stderr = found[0].1 / count.sqrt();
    assert!((mean - exact).abs() < 3.0 * stderr.hypot(4.8e-4), "{mean} +- {stderr}");
}

#[test]
fn a_closed_orbit_has_that_of_its_multipliers() {
    for p in [0.5, 1.0, 1.34] {
        for known in attractors_at(p) {
            let [theta, velocity] = known.points[0];
            let found = of(&known.pendulum, &request([theta + 1e-3, velocity]));
            assert_eq!(found.end, End::Captured);
            let own = found.attractor.expect("an attractor");
            assert_eq!((own.n, own.w), (Some(known.n), known.w));
            let largest = known.multipliers.iter().map(|m| m[0].hypot(m[1])).fold(0.0, f64::max);
            let exact = largest.ln() / (known.n as f64 * PI);
            assert!((own.exponent - exact).abs() < 1e-9, "p = {p}: {} {exact}", own.exponent);
        }
    }
}

#[test]
fn a_chaotic_transient_has_the_exponent_of_what_captures_it() {
    let pendulum = driven(0.1, 1.8, 2.0);
    let (mut longest, mut grown, mut lasted) = (0, 0.0, 0.0);
    for start in spread(12, PI, 3.0) {
        let found = of(&pendulum, &request(start));
        assert_eq!(found.end, End::Captured, "{start:?}");
        let own = found.attractor.expect("an attractor");
        assert_eq!((own.kind, own.n), (Kind::Rotation, Some(8)));
        assert!((own.exponent + 0.05).abs() < 1e-9, "{}", own.exponent);
        let transient = found.transient.expect("a transient");
        if transient > 100 {
            grown += found.growth.iter().take(transient as usize).sum::<f64>();
            lasted += f64::from(transient);
        }
        longest = longest.max(transient);
    }
    assert!(longest > 300, "{longest}");
    // During the transient deviations grow as in chaos.
    assert!(grown > 0.25 * lasted, "{grown} in {lasted} periods");
}

#[test]
fn without_damping_or_drive_there_is_an_answer_too() {
    let found = of(&driven(0.0, 0.0, 2.0), &request([0.3, 0.0]));
    assert_eq!(found.end, End::Undamped);
    let ensemble = found.ensemble.expect("an ensemble");
    assert!(ensemble.exponent.abs() < 2e-3, "{}", ensemble.exponent);
    let found = of(&undriven(0.1, 0.5), &request([0.0, 6.0]));
    let own = found.attractor.expect("an attractor");
    assert_eq!((found.end, own.kind), (End::Captured, Kind::Rotation));
    assert!(own.exponent.abs() < 1e-12);
}

/// Logarithms of the growth of the tangent `(1, 1)/sqrt 2`, period by period, by the exact
/// derivatives of the map: the reference integrator with the jumps at turns and sticks.
fn exact_growth(map: &PoincareMap, start: State, periods: usize) -> (Vec<f64>, usize) {
    let (mut state, mut tangent) = (start, Vector2::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2));
    let (mut growth, mut sticks) = (Vec::new(), 0);
    for _ in 0..periods {
        let image = map.once(state);
        let next = image.derivative * tangent;
        growth.push(next.norm().ln());
        tangent = next / next.norm();
        state = image.state;
        sticks += usize::from(image.product == Some(0.0));
    }
    (growth, sticks)
}

#[test]
fn tangents_grow_through_turns_and_sticks_as_exact_derivatives_say() {
    // Little friction, much with long sticks, and one that depends on the load as well.
    let models = [
        (driven(0.02, 1.0, 2.0), 0.05, 200),
        (driven(0.1, 1.5, 0.87), 0.2, 400),
        (driven(0.1, 1.7, 0.87), 0.05, 400),
        (driven(0.0, 2.0, 1.2), 0.3, 300),
    ];
    let pool = pool(0).expect("a pool");
    let (mut compared, mut stopped) = (0, 0);
    for (pendulum, theta_r, steps) in models {
        let pendulum = pendulum.with_friction(theta_r).expect("in range");
        let map = PoincareMap::new(&pendulum);
        let starts = spread(120, PI, 3.0);
        let exact: Vec<_> = starts.iter().map(|start| exact_growth(&map, *start, 4)).collect();
        for simd in instruction_sets() {
            let strobe = Strobe::new(&pendulum, steps, simd);
            let mut bundle = Bundle::new(&starts);
            let rows = bundle.grow(&strobe, 4, 1, &pool, &Control::default()).expect("growth");
            let mut errors = Vec::new();
            for ((exact, sticks), row) in exact.iter().zip(rows) {
                stopped += sticks;
                for (a, b) in row.iter().zip(exact) {
                    errors.push((a - b).abs());
                }
            }
            compared += errors.len();
            errors.sort_by(f64::total_cmp);
            // The error of shadow trajectories is their distance times the curvature of the map,
            // and unbounded if only one of the two turns or stops, which is as rare as they are
            // close.
            let at = |share: f64| errors[(share * (errors.len() - 1) as f64) as usize];
            assert!(at(0.9) < 1e-4, "{simd}, theta_r = {theta_r}: {:e}", at(0.9));
            assert!(at(0.98) < 2e-2, "{simd}, theta_r = {theta_r}: {:e}", at(0.98));
        }
    }
    assert!(
        compared > 1000 * instruction_sets().len() && stopped > 100 * instruction_sets().len(),
        "{compared} {stopped}"
    );
}
