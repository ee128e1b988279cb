//! Critical amplitudes of rest, against known ones.

use pendmap::error::Error;
use pendmap::maps::control::Control;
use pendmap::maps::tongues::{Balance, Curve, tongues};
use pendmap::model::Pendulum;

use crate::support::driven;
use crate::truths::{list, number, table, truths};

fn at(pendulum: &Pendulum, omegas: &[f64], p_max: f64) -> Vec<Curve> {
    tongues(pendulum, Balance::Hanging, omegas, p_max, true, 0, &Control::default())
        .expect("curves")
}

#[test]
fn the_known_boundaries_and_no_others() {
    for (key, gamma) in [("undamped", 0.0), ("damped_gamma0.1", 0.1)] {
        for (omega, rows) in table(&truths()["mathieu_boundaries"][key]) {
            let omega: f64 = omega.parse().expect("a frequency");
            let found = &at(&driven(gamma, 1.0, omega), &[omega], 6.0)[0].critical;
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
    let curve = &at(&driven(0.1, 1.0, 1.8), &[1.8], 1.0)[0];
    let fold = curve.fold.expect("a fold");
    assert!((fold.p - number(&entry["p_fold"])).abs() < 1e-10, "{fold:?}");
    let known = [number(&entry["fold_theta"]), number(&entry["fold_v"])];
    let gap = |s: f64| (s * fold.point[0] - known[0]).hypot(s * fold.point[1] - known[1]);
    assert!(gap(1.0).min(gap(-1.0)) < 1e-6, "{fold:?}");
    assert!(at(&driven(0.1, 1.0, 2.0), &[2.0, 2.2], 1.0).iter().all(|c| c.fold.is_none()));
}

#[test]
fn inverted_rest_is_stable_between_the_known_amplitudes() {
    // From the linear equation by scipy.
    for (omega, low, high) in
        [(6.0, 8.588664070320945, 18.02184869565419), (10.0, 14.204514822924187, 47.08697018214781)]
    {
        let control = Control::default();
        let pendulum = driven(0.1, 1.0, omega);
        let found = tongues(&pendulum, Balance::Inverted, &[omega], 60.0, true, 0, &control);
        let curve = &found.expect("curves")[0];
        assert!(!curve.stable_at_first && curve.fold.is_none());
        let [first, second] = curve.critical[..2] else { panic!("two borders: {curve:?}") };
        assert!((first.p - low).abs() < 1e-9 && first.stable == [false, true], "{first:?}");
        assert!((second.p - high).abs() < 1e-9 && second.stable == [true, false], "{second:?}");
        assert!(first.multiplier > 0.0 && second.multiplier < 0.0);
    }
}

#[test]
fn invalid_requests_are_refused() {
    let control = Control::default();
    let ask = |pendulum: &Pendulum, p_max: f64| {
        tongues(pendulum, Balance::Hanging, &[2.0], p_max, true, 0, &control)
    };
    let plain = driven(0.1, 1.0, 2.0);
    assert!(matches!(ask(&plain, 0.0), Err(Error::Range { name: "p_max", .. })));
    let rubbing = plain.clone().with_friction(0.1).expect("in range");
    assert!(matches!(ask(&rubbing, 1.0), Err(Error::NoRest { .. })));
    let pulled = Pendulum::new(0.1, 1.0, 2.0, 0.0, 0.2).expect("in range");
    assert!(ask(&pulled, 1.0).is_ok());
    control.cancel();
    assert!(matches!(ask(&plain, 1.0), Err(Error::Interrupted)));
}
