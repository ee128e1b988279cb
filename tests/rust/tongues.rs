//! Critical amplitudes of rest, against known ones.

use pendmap::continuation::critical::Critical as Place;
use pendmap::continuation::event::Kind;
use pendmap::error::Error;
use pendmap::maps::control::Control;
use pendmap::maps::tongues::{Row, Tongues, tongues};
use pendmap::model::Pendulum;

use crate::hill;
use crate::support::driven;
use crate::truths::{list, number, table, truths};

fn all(pendulum: &Pendulum, omegas: &[f64], p_max: f64) -> Tongues {
    tongues(pendulum, omegas, p_max, 1, &Control::default()).expect("curves")
}

/// Hanging and inverted rest at one frequency.
fn at(pendulum: &Pendulum, omega: f64, p_max: f64) -> [Row; 2] {
    all(pendulum, &[omega], p_max).rows.remove(0)
}

#[test]
fn they_are_all_zeros_of_hills_determinant() {
    for (gamma, omega, p_max) in
        [(0.1, 0.5, 6.0), (0.1, 0.83, 6.0), (0.3, 1.37, 9.0), (0.02, 2.0, 6.0), (0.7, 4.6, 40.0)]
    {
        let rows = at(&driven(gamma, 1.0, omega), omega, p_max);
        for (row, side) in rows.iter().zip([1.0, -1.0]) {
            let known = hill::critical(gamma, omega, side, p_max);
            let found: Vec<(f64, f64)> = row.critical.iter().map(|c| (c.p, c.multiplier)).collect();
            assert_eq!(found.len(), known.len(), "{gamma} {omega} {side}: {found:?} for {known:?}");
            for (mine, exact) in found.iter().zip(known) {
                assert!(
                    (mine.0 - exact.0).abs() < 1e-10 && mine.1 * exact.1 > 0.0,
                    "{mine:?} {exact:?}"
                );
            }
        }
    }
}

#[test]
fn the_known_boundaries_and_no_others() {
    for (key, gamma) in [("undamped", 0.0), ("damped_gamma0.1", 0.1)] {
        for (omega, rows) in table(&truths()["mathieu_boundaries"][key]) {
            let omega: f64 = omega.parse().expect("a frequency");
            let found = &at(&driven(gamma, 1.0, omega), omega, 6.0)[0].critical;
            let rows = list(rows);
            assert_eq!(found.len(), rows.len(), "omega = {omega}: {found:?}");
            for (mine, row) in found.iter().zip(rows) {
                assert!((mine.p - number(&row["p"])).abs() < 1e-10, "{mine:?} for {row}");
                assert!((mine.multiplier - number(&row["multiplier"])).abs() < 1e-12);
                match row["type"].as_str() {
                    Some("destab") => assert_eq!(mine.stable, [true, false]),
                    Some(_) => assert_eq!(mine.stable, [false, true]),
                    None => {}
                }
            }
        }
    }
}

#[test]
fn the_fold_below_a_subcritical_onset() {
    let entry = &truths()["rest_onset"]["res_w1.8"];
    let plane = all(&driven(0.1, 1.0, 2.0), &[1.7, 1.8, 2.1], 1.0).plane.expect("curves");
    let fold = plane.curves.iter().find(|curve| curve.kind == Kind::Fold).expect("a fold");
    let found = plane.points(fold, 1, (1.8 - 1.7) / 0.4);
    assert_eq!(found.len(), 1);
    let place = &found[0].orbit.place;
    assert!((Place::at(place)[0] - number(&entry["p_fold"])).abs() < 1e-10);
    let point = plane.critical(fold.of, fold.kind).points(place)[0];
    let known = [number(&entry["fold_theta"]), number(&entry["fold_v"])];
    let gap = |s: f64| (s * point[0] - known[0]).hypot(s * point[1] - known[1]);
    assert!(gap(1.0).min(gap(-1.0)) < 1e-6, "{point:?}");
}

#[test]
fn inverted_rest_is_stable_between_the_known_amplitudes() {
    // From the linear equation by scipy.
    for (omega, low, high) in
        [(6.0, 8.588664070320945, 18.02184869565419), (10.0, 14.204514822924187, 47.08697018214781)]
    {
        let curve = &at(&driven(0.1, 1.0, omega), omega, 60.0)[1];
        assert!(!curve.stable_at_first);
        let [first, second] = curve.critical[..2] else { panic!("two borders: {curve:?}") };
        assert!((first.p - low).abs() < 1e-9 && first.stable == [false, true], "{first:?}");
        assert!((second.p - high).abs() < 1e-9 && second.stable == [true, false], "{second:?}");
        assert!(first.multiplier > 0.0 && second.multiplier < 0.0);
    }
}

#[test]
fn invalid_requests_are_refused() {
    let control = Control::default();
    let ask = |pendulum: &Pendulum, p_max: f64| tongues(pendulum, &[2.0], p_max, 0, &control);
    let plain = driven(0.1, 1.0, 2.0);
    assert!(matches!(ask(&plain, 0.0), Err(Error::Range { name: "p_max", .. })));
    let rubbing = plain.clone().with_friction(0.1).expect("in range");
    assert!(matches!(ask(&rubbing, 1.0), Err(Error::NoRest { .. })));
    let pulled = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.2).expect("in range");
    assert!(ask(&pulled, 1.0).is_ok());
    control.cancel();
    assert!(matches!(ask(&plain, 1.0), Err(Error::Interrupted)));
}
