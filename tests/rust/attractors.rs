//! Attractors and basins on the reference grids: points, kinds, names, twins, fractions.

use std::collections::HashSet;
use std::sync::OnceLock;

use pendmap::attractor::catalogue::arrange;
use pendmap::attractor::{Attractor, Kind};
use pendmap::integrate::State;
use pendmap::integrate::accuracy::distance;
use pendmap::maps::basins::{BasinMap, Labelling};
use pendmap::maps::label::NEVER;
use pendmap::model::{Angle, Pendulum};

use crate::support::{basins_on_plane, driven};
use crate::truths::{attractors_at, fractions_at};

/// The reference maps, each computed once: p, and the tolerance on fractions.
fn maps() -> &'static [(f64, f64, BasinMap); 3] {
    static MAPS: OnceLock<[(f64, f64, BasinMap); 3]> = OnceLock::new();
    MAPS.get_or_init(|| {
        [(0.5, 0.005), (1.0, 0.02), (1.34, 0.02)]
            .map(|(p, allowed)| (p, allowed, basins_on_plane(&driven(0.1, p, 2.0), 100)))
    })
}

fn contains(attractor: &Attractor, point: State, within: f64) -> bool {
    attractor.points.iter().any(|p| distance(*p, point) < within)
}

#[test]
fn every_known_attractor_and_no_other_is_found() {
    for (p, _, map) in maps() {
        let known = attractors_at(*p);
        assert_eq!(map.attractors.len(), known.len(), "p = {p}");
        assert_eq!(map.labelling, Labelling::Basins);
        for known in known {
            let found = map
                .attractors
                .iter()
                .find(|a| known.points.iter().all(|point| contains(a, *point, 1e-9)))
                .unwrap_or_else(|| panic!("{:?} at p = {p}", known.points));
            assert_eq!((found.n, found.w), (Some(known.n), Some(known.w)));
            assert_eq!(found.kind.word(), known.kind);
            assert_eq!(found.points.len(), known.n);
            let period = known.n as f64 * known.pendulum.period();
            assert!((found.period.expect("a period") - period).abs() < 1e-12);
            let largest = known.multipliers[0][0].hypot(known.multipliers[0][1]);
            assert!((found.exponent - largest.ln() / period).abs() < 1e-9, "p = {p}");
            assert!(found.exponent_stderr == 0.0);
        }
    }
}

#[test]
fn fractions_are_the_reference_ones() {
    for (p, allowed, map) in maps() {
        for ((n, w, theta), expected) in fractions_at(*p) {
            let index = map
                .attractors
                .iter()
                .position(|a| {
                    (a.n, a.w) == (Some(n), Some(w))
                        && a.points.iter().any(|point| (point[0] - theta).abs() < 1e-4)
                })
                .unwrap_or_else(|| panic!("({n}, {w}) at {theta}, p = {p}"));
            let found = map.fractions[index];
            assert!((found - expected).abs() < *allowed, "{n}:{w} at {p}: {found} for {expected}");
        }
        let all = map.fractions.iter().sum::<f64>() + map.share(0) + map.share(-1);
        assert!((all - 1.0).abs() < 1e-12 && map.share(0) + map.share(-1) < 1e-3, "p = {p}");
    }
}

#[test]
fn names_stay() {
    let names = |i: usize| -> Vec<&str> {
        let (_, _, map) = &maps()[i];
        map.attractors.iter().map(|a| a.name.as_str()).collect()
    };
    assert_eq!(names(0), ["oscillation 2:0", "rotation 1:-1", "rotation 1:+1"]);
    assert_eq!(names(1), names(0));
    let asymmetric =
        ["oscillation 4:0 (-)", "oscillation 4:0 (+)", "rotation 1:-1", "rotation 1:+1"];
    assert_eq!(names(2), asymmetric);
}

#[test]
fn twins_are_mirror_images_with_equal_shares() {
    for (p, allowed, map) in maps() {
        for (i, attractor) in map.attractors.iter().enumerate() {
            let twin = attractor.twin.expect("the plane is symmetric");
            assert_eq!(map.attractors[twin].twin, Some(i));
            assert_eq!(twin == i, attractor.name == "oscillation 2:0", "{}", attractor.name);
            for point in &attractor.points {
                assert!(contains(&map.attractors[twin], [-point[0], -point[1]], 1e-9));
            }
            // The grid is its own mirror image; cells changed by rounding are at a fractal
            // boundary.
            assert!((map.fractions[i] - map.fractions[twin]).abs() < *allowed, "p = {p}");
        }
    }
}

#[test]
fn settling_takes_longer_where_multipliers_are_larger() {
    let mean = |i: usize| {
        let settle = &maps()[i].2.labels.settle;
        assert!(settle.iter().all(|s| *s > 0 || *s == NEVER));
        settle.iter().map(|s| f64::from(*s)).sum::<f64>() / settle.len() as f64
    };
    assert!(mean(0) < mean(1) && mean(1) < mean(2));
    // The target for speed: under 45 periods a start at p = 1.
    assert!(maps()[1].2.mean_periods() < 45.0, "{}", maps()[1].2.mean_periods());
}

#[test]
fn rest_attracts_below_its_onset() {
    let map = basins_on_plane(&driven(0.1, 0.15, 2.0), 40);
    let [rest] = map.attractors.as_slice() else { panic!("{:?}", map.attractors) };
    assert_eq!((rest.kind, rest.name.as_str(), rest.twin), (Kind::Rest, "rest", Some(0)));
    assert_eq!(rest.points, [[0.0, 0.0]]);
    assert!((map.fractions[0] - 1.0).abs() < 1e-12);
}

#[test]
fn no_two_attractors_of_a_catalogue_share_a_name() {
    let mut random = 1_u64;
    let mut below = |bound: usize| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (random >> 33) as usize % bound
    };
    for _ in 0..200 {
        let attractors: Vec<Attractor> = (0..12)
            .map(|_| {
                // First angles are often the same to four digits, and sometimes to all.
                let theta = 0.1 * below(3) as f64 + [0.0, 1e-6, 1e-9][below(3)];
                let mut one = Attractor::resting(Angle::Circle, theta);
                let kinds = [Kind::Oscillation, Kind::TumblingChaos, Kind::LibrationChaos];
                one.kind = kinds[below(3)];
                (one.n, one.w) = match one.kind {
                    Kind::Oscillation => (Some(1 + below(2)), Some(0)),
                    _ => (None, None),
                };
                one
            })
            .collect();
        for torque in [0.0, 0.1] {
            let pendulum = Pendulum::new(0.1, 1.0, 2.0, 0.0, torque).expect("a pendulum");
            let (named, _) = arrange(&pendulum, attractors.clone());
            let names: HashSet<&str> = named.iter().map(|a| a.name.as_str()).collect();
            assert_eq!(names.len(), named.len(), "{names:?}");
        }
    }
}
