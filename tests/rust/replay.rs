//! Ensembles of a record's pendulum: each member is an independent trajectory, on any number of
//! threads.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use pendmap::error::Error;
use pendmap::fit::replay::replay;
use pendmap::maps::control::pool;
use pendmap::model::Kind;

use crate::fit_records::{record, with};
use crate::support::{driven, spread};

#[test]
fn members_read_what_one_trajectory_would() {
    let offset: (Kind, &[f64]) = (Kind::EncoderOffset, &[0.03]);
    let drift: (Kind, &[f64]) = (Kind::EncoderDrift, &[0.002]);
    let plain = driven(0.05, 1.2, 2.0).with_friction(0.02).expect("in range");
    let mut forced = with(plain, &[offset, drift]);
    forced.lab_time = 50.0;
    let starts = spread(9, PI, 3.0);
    let template = record(forced.clone(), None, starts[0], 30.0);
    let count = AtomicUsize::new(0);
    let done = || {
        count.fetch_add(1, Ordering::Relaxed);
    };
    let never = AtomicBool::new(false);
    let on = |threads: usize| {
        let ran = || replay(&template, &starts, &template.times, 1e-12, &never, &done);
        pool(threads).expect("workers").install(ran).expect("an ensemble")
    };
    let all = on(2);
    assert_eq!(count.load(Ordering::Relaxed), starts.len());
    for (start, reading) in starts.iter().zip(&all) {
        let alone = record(forced.clone(), None, *start, 30.0).readings;
        for (a, b) in reading.iter().zip(&alone) {
            assert!((a - b).abs() < 1e-6, "{start:?}: {a} {b}");
        }
    }
    assert_eq!(on(1), all);
}

#[test]
fn replay_begins_at_its_first_time_and_refuses_falling_times() {
    // Half a period later the drive has the opposite sign: only the phase determines it.
    let one = record(driven(0.1, 1.0, 2.0), None, [1.0, 0.0], 9.0);
    let never = AtomicBool::new(false);
    let ran = |times: &[f64]| replay(&one, &[[1.0, 0.0]], times, 1e-12, &never, &|| ());
    let [now, later] = [0.0, 0.5 * PI].map(|begin| {
        let times: Vec<f64> = (0..20).map(|k| begin + 0.3 * f64::from(k)).collect();
        ran(&times).expect("a member").remove(0)
    });
    assert!((now[0] - 1.0).abs() + (later[0] - 1.0).abs() < 1e-12);
    assert!((now[19] - later[19]).abs() > 0.1);
    let again = ran(&[2.0 * PI / 2.0, 2.0 * PI / 2.0 + 5.7]).expect("a member").remove(0);
    assert!((again[1] - now[19]).abs() < 1e-8);
    assert!(matches!(ran(&[1.0, 0.5]), Err(Error::Range { name: "time", .. })));
    assert!(ran(&[]).expect("nothing").remove(0).is_empty());
    let stopped = AtomicBool::new(true);
    let found = replay(&one, &[[1.0, 0.0]], &[0.0, 5.0], 1e-12, &stopped, &|| ());
    assert!(matches!(found, Err(Error::Interrupted)));
}
