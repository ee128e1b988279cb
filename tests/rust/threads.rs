//! Threads, progress and cancellation: equality of results, and immediate response.

use std::collections::HashSet;
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use pendmap::error::Error;
use pendmap::integrate::Strobe;
use pendmap::maps::advance::advance;
use pendmap::maps::basins::{Options, basins};
use pendmap::maps::control::{Control, Spread, pool};
use pendmap::maps::finite_time::finite_time;
use pendmap::model::Pendulum;

use crate::support::{
    assert_same, bits, cell_names, chaos_among_others, driven, plane, relabelled, searched, simd,
    spread, unchecked,
};

#[test]
fn threads_do_not_show_in_a_map() {
    for (what, pendulum) in [
        ("periodic", driven(0.1, 1.0, 2.0)),
        ("conservative", driven(0.0, 0.5, 2.0)),
        ("quasiperiodic", Pendulum::new(0.1, 0.1, 2.0, 0.0, 0.5).expect("in range")),
    ] {
        let [a, b] = [1, 2].map(|threads| {
            let options = Options { threads, ..unchecked() };
            basins(&pendulum, &plane(40), &options, &Control::default()).expect("a map")
        });
        assert_same(&a.labels, &b.labels, what);
        assert_eq!(bits(&a.fractions), bits(&b.fractions), "{what}");
        assert_eq!(cell_names(&a), cell_names(&b), "{what}");
    }
}

#[test]
fn threads_do_not_show_in_labels() {
    let (starts, slow) = (plane(24), driven(0.1, 1.8, 2.0));
    let (strobe, catalogue) = searched(&slow, &starts, simd());
    let [a, b] = [1, 2].map(|threads| relabelled(&strobe, &catalogue, &starts, None, threads));
    assert_same(&a, &b, "slow");
    let (strobe, catalogue, labels) = chaos_among_others();
    assert_same(labels, &relabelled(strobe, catalogue, &starts, None, 2), "chaos among others");
}

#[test]
fn threads_do_not_show_in_layers() {
    let strobe = Strobe::new(&driven(0.1, 1.7, 0.87), 40, simd());
    let [a, b] = [1, 2].map(|threads| {
        let pool = pool(threads).expect("a pool");
        let layers = finite_time(&strobe, &plane(100), 5, &pool, &Control::default());
        let layers = layers.expect("layers");
        (layers.turns, layers.exponent.iter().map(|e| e.to_bits()).collect::<Vec<_>>())
    });
    assert_eq!(a, b);
}

#[test]
fn threads_do_not_show_in_plain_integration() {
    let strobe = Strobe::new(&driven(0.1, 1.0, 2.0), 12, simd());
    let states = spread(3000, 3.1, 3.0);
    let [a, b] = [1, 2].map(|threads| {
        let ends = advance(&strobe, &states, 100, threads, &Control::default());
        let (ends, turns) = ends.expect("ends");
        (bits(ends.theta()), bits(ends.velocity()), turns)
    });
    assert_eq!(a, b);
}

/// The threads of a pool.
fn workers(pool: &rayon::ThreadPool) -> HashSet<ThreadId> {
    pool.broadcast(|_| thread::current().id()).into_iter().collect()
}

#[test]
fn a_call_has_as_many_workers_as_requested() {
    for threads in [1, 2, 7, 7, 2, 1] {
        let pool = pool(threads).expect("a pool");
        assert_eq!(workers(&pool).len(), threads);
        assert_eq!(pool.install(rayon::current_num_threads), threads);
    }
    assert!(pool(257).is_err());
}

#[test]
fn workers_are_kept_for_the_next_call() {
    // Of a number that no other test requests, as tests run at the same time.
    let first = workers(&pool(11).expect("a pool"));
    let second = workers(&pool(11).expect("a pool"));
    assert_eq!(first, second);
    // After a panic too.
    let panicked = thread::spawn(|| pool(11).expect("a pool").install(|| panic!("of a test")));
    assert!(panicked.join().is_err());
    assert_eq!(workers(&pool(11).expect("a pool")).len(), 11);
}

#[test]
fn calls_at_the_same_time_have_their_own_workers() {
    let [one, other] = [(); 2].map(|()| pool(13).expect("a pool"));
    assert!(workers(&one).is_disjoint(&workers(&other)));
}

#[test]
fn a_cancelled_map_stops() {
    for p in [1.0, 1.8] {
        let control = Control::default();
        control.cancel();
        let map = basins(&driven(0.1, p, 2.0), &plane(40), &unchecked(), &control);
        assert_eq!(map.err(), Some(Error::Interrupted));
    }
    let control = Control::default();
    control.cancel();
    let strobe = Strobe::new(&driven(0.0, 1.0, 2.0), 12, simd());
    let layers = finite_time(&strobe, &plane(40), 10, &pool(1).expect("a pool"), &control);
    assert_eq!(layers.err(), Some(Error::Interrupted));
    let ends = advance(&strobe, &[[0.0, 1.0]; 10], 10, 1, &control);
    assert_eq!(ends.err(), Some(Error::Interrupted));
}

#[test]
fn cancelling_works_while_a_map_is_made() {
    // Stages of seconds each: the search, the observed starts, labels, layers.
    for (p, omega, size, milliseconds) in [
        (1.8, 2.0, 2000, 100),
        (1.8, 2.0, 2000, 400),
        (1.7, 0.87, 4000, 100),
        (1.7, 0.87, 4000, 400),
        (1.0, 2.0, 4000, 300),
    ] {
        let control = Control::default();
        let (result, late) = thread::scope(|scope| {
            let work = scope.spawn(|| {
                let made = basins(&driven(0.1, p, omega), &plane(size), &unchecked(), &control);
                (made.map(|_| ()), Instant::now())
            });
            thread::sleep(Duration::from_millis(milliseconds));
            let asked = Instant::now();
            control.cancel();
            let (result, ended) = work.join().expect("no panic");
            (result, ended.saturating_duration_since(asked))
        });
        assert_eq!(result, Err(Error::Interrupted), "p = {p}");
        assert!(late < Duration::from_secs(1), "p = {p}: {late:?} after Ctrl-C");
    }
}

#[test]
fn progress_ends_at_the_number_of_cells() {
    for p in [0.6, 1.5] {
        let control = Control::default();
        let omega = if p > 1.0 { 1.8 } else { 2.0 };
        basins(&driven(0.1, p, omega), &plane(30), &unchecked(), &control).expect("a map");
        assert_eq!(control.progress(), (900, 900));
    }
}

#[test]
fn work_is_spread_and_done_once() {
    for count in [1, 2, 3, 10, 64, 169, 1000, 31_250] {
        let order = Spread::of(count);
        let parts: Vec<usize> = (0..count).map(|k| order.part(k)).collect();
        let mut sorted = parts.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..count));
        // The first tenth meets each fifth of the whole equally often within a quarter.
        let first = &parts[..count / 10];
        for fifth in 0..5 {
            let met = first.iter().filter(|part| **part * 5 / count == fifth).count();
            assert!(
                met.abs_diff(first.len() / 5) <= (first.len() / 20).max(2),
                "{met} of {} at {count}",
                first.len()
            );
        }
    }
}
