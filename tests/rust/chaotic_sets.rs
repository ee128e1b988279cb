//! Kind, number and share of chaotic attractors, against trajectories integrated in this file by
//! the classical Runge-Kutta method.

use std::f64::consts::{PI, TAU};

use pendmap::attractor::{Attractor, Kind};
use pendmap::integrate::{State, Strobe};
use pendmap::maps::basins::{BasinMap, Labelling};
use pendmap::maps::bifurcation::{Request, bifurcation};
use pendmap::maps::cell::{Cell, Search};
use pendmap::maps::control::Control;
use pendmap::maps::parameter_map::Range;
use pendmap::model::Parameter;

use crate::support::{basins_on_plane, driven, instruction_sets, plane, spread};

/// Steps a period of the integration in this file.
const STEPS: usize = 200;

/// `theta'' + 0.1 theta' + (1 + p cos(omega tau)) sin theta = 0`.
struct Own {
    p: f64,
    omega: f64,
}

impl Own {
    fn slope(&self, time: f64, [theta, velocity]: State) -> State {
        [velocity, -0.1 * velocity - (1.0 + self.p * (self.omega * time).cos()) * theta.sin()]
    }

    /// The states after each step of a period, the angle not wrapped.
    fn period(&self, start: State) -> Vec<State> {
        let h = TAU / self.omega / STEPS as f64;
        let moved = |s: State, k: State, by: f64| [s[0] + by * k[0], s[1] + by * k[1]];
        let mut state = start;
        (0..STEPS)
            .map(|step| {
                let t = step as f64 * h;
                let a = self.slope(t, state);
                let b = self.slope(t + 0.5 * h, moved(state, a, 0.5 * h));
                let c = self.slope(t + 0.5 * h, moved(state, b, 0.5 * h));
                let d = self.slope(t + h, moved(state, c, h));
                let mean = |i: usize| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0;
                state = [state[0] + h * mean(0), state[1] + h * mean(1)];
                state
            })
            .collect()
    }

    fn after(&self, start: State, periods: usize) -> State {
        (0..periods).fold(start, |state, _| self.period(state)[STEPS - 1])
    }

    /// The change of the angle in each of `periods`, and the largest distance from hanging
    /// meanwhile.
    fn ways(&self, start: State, periods: usize) -> (Vec<f64>, f64) {
        let (mut state, mut highest) = (start, 0.0_f64);
        let mut ways = Vec::new();
        for _ in 0..periods {
            let states = self.period(state);
            highest = states.iter().fold(highest, |most, s| most.max(s[0].abs()));
            ways.push(states[STEPS - 1][0] - state[0]);
            state = states[STEPS - 1];
        }
        (ways, highest)
    }
}

/// A few of an attractor's points, far apart in its sample.
fn some(attractor: &Attractor) -> Vec<State> {
    let stride = (attractor.points.len() / 6).max(1);
    attractor.points.iter().step_by(stride).copied().collect()
}

/// Whether the trajectories from its points behave as its kind states.
fn does_what_it_says(own: &Own, attractor: &Attractor) {
    for point in some(attractor) {
        let (ways, highest) = own.ways(point, 60);
        let turns = ways.iter().sum::<f64>() / TAU;
        let name = &attractor.name;
        match attractor.kind {
            Kind::LibrationChaos => assert!(highest < PI, "p = {}: {name}", own.p),
            Kind::RotatingChaos => {
                let sense = attractor.sense as f64;
                assert!(turns * sense > 1.0, "p = {}: {name}, {turns} turns", own.p);
            }
            _ => {}
        }
    }
}

#[test]
fn rotating_chaos_is_two_attractors_with_half_of_the_starts_each() {
    let own = Own { p: 1.808, omega: 2.0 };
    let map: BasinMap = basins_on_plane(&driven(0.1, own.p, own.omega), 24);
    assert_eq!(map.labelling, Labelling::Basins);
    let names: Vec<&str> = map.attractors.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["rotating chaos -", "rotating chaos +"]);
    assert_eq!((map.attractors[0].twin, map.attractors[1].twin), (Some(1), Some(0)));
    assert!(map.share(0) < 1e-12, "{} undecided", map.share(0));
    assert!(map.fractions.iter().all(|share| (0.35..0.6).contains(share)), "{:?}", map.fractions);
    for attractor in &map.attractors {
        for point in some(attractor) {
            let (ways, _) = own.ways(point, 100);
            assert!(ways.iter().all(|way| way * attractor.sense as f64 > 0.0));
        }
    }
    // Starts of the plane end in these proportions after the transients, too.
    let starts = plane(8).sampled_states(24, 3);
    let senses: Vec<f64> = starts.iter().map(|s| own.after(*s, 1500)[1].signum()).collect();
    let forward = senses.iter().filter(|s| **s > 0.0).count();
    assert!((5..=19).contains(&forward), "{forward} of 24");
}

#[test]
fn sets_at_random_points_do_what_their_kind_says() {
    let mut seen = 0;
    for [a, b] in spread(24, 1.0, 1.0) {
        let own = Own { p: 1.4 + 0.5 * a, omega: 1.8 + 0.5 * b };
        let cell = searched(&own);
        let sets: Vec<&Attractor> =
            cell.found.iter().map(|f| &f.attractor).filter(|a| a.kind.is_chaotic()).collect();
        seen += sets.len();
        for set in &sets {
            does_what_it_says(&own, set);
        }
        let tumbles = |a: &&&Attractor| a.kind == Kind::TumblingChaos;
        assert!(sets.iter().filter(tumbles).count() <= 1, "p = {}, omega = {}", own.p, own.omega);
    }
    assert!(seen > 3, "{seen} sets");
}

/// The attractors that a search finds from the starts of cell `number`.
fn searched_from(own: &Own, number: usize) -> Cell {
    let starts = plane(1000).sampled_states(9 * (number + 1), 1);
    let search = Search { starts, each: 9, bound: None, kept: 64 };
    let strobe = Strobe::new(&driven(0.1, own.p, own.omega), 40, instruction_sets()[0]);
    let control = Control::default();
    search.cell(number, &strobe, &[], control.flag()).expect("a cell")
}

fn searched(own: &Own) -> Cell {
    searched_from(own, 0)
}

#[test]
fn chaotic_attractors_do_not_depend_on_the_starts() {
    let tumbling = vec![Kind::TumblingChaos];
    let rotating = vec![Kind::RotatingChaos; 2];
    for (p, omega, kinds) in
        [(1.03, 0.87, &tumbling), (1.7, 0.87, &tumbling), (1.808, 2.0, &rotating)]
    {
        for number in 0..12 {
            let cell = searched_from(&Own { p, omega }, number);
            let found: Vec<Kind> = cell.found.iter().map(|f| f.attractor.kind).collect();
            assert_eq!(&found, kinds, "p = {p}, starts {number}");
        }
    }
}

#[test]
fn libration_chaos_is_followed_to_its_crisis() {
    let values: Vec<f64> = (0..16).map(|k| 1.3413 + 0.0001 * f64::from(k)).collect();
    let request = Request {
        axis: Range::of(Parameter::P, values.clone()),
        starts: plane(1000).sampled_states(549, 1),
        each: 9,
        first: None,
        tol: 1e-6,
        bound: None,
        threads: 0,
    };
    let found = bifurcation(&driven(0.1, 1.0, 2.0), &request, &Control::default()).expect("it");
    for (p, cell) in values.iter().zip(&found.map.cells) {
        let librates = |a: &&Attractor| a.kind == Kind::LibrationChaos;
        let sets: Vec<&Attractor> =
            cell.found.iter().map(|f| &f.attractor).filter(librates).collect();
        // The cascade ends before 1.3422, the crisis is between 1.3426 and 1.3427.
        let expected = (1.342_15..1.342_65).contains(p);
        assert_eq!(sets.len(), 2 * usize::from(expected), "p = {p}");
        for set in sets {
            does_what_it_says(&Own { p: *p, omega: 2.0 }, set);
        }
        if !expected {
            continue;
        }
        assert!(cell.observed > 1000, "p = {p}: {} periods", cell.observed);
    }
}

/// The stable rotations of period 2 within tumbling chaos, by Newton's method in this file.
#[test]
fn a_stable_orbit_of_few_periods_is_no_part_of_chaos() {
    let own = Own { p: 2.5, omega: 1.620_689_655_172_413_7 };
    let cell = searched(&own);
    assert!(!cell.found.iter().any(|f| f.attractor.kind.is_chaotic()));
    let rotations: Vec<&Attractor> = cell.found.iter().map(|f| &f.attractor).collect();
    assert_eq!(
        rotations.iter().map(|a| (a.n, a.w)).collect::<Vec<_>>(),
        [(Some(2), Some(-1)), (Some(2), Some(1)),]
    );
    for rotation in rotations {
        let mut point = rotation.points[0];
        let turned = TAU * rotation.w.unwrap_or(0) as f64;
        let gap = |s: State| {
            let end = own.after(s, 2);
            [end[0] - s[0] - turned, end[1] - s[1]]
        };
        let mut slope = [[0.0; 2]; 2];
        for _ in 0..6 {
            let here = gap(point);
            for k in 0..2 {
                let mut beside = point;
                beside[k] += 1e-6;
                let there = gap(beside);
                slope[k] = [(there[0] - here[0]) / 1e-6, (there[1] - here[1]) / 1e-6];
            }
            let [[a, c], [b, d]] = slope;
            let determinant = a * d - b * c;
            point[0] -= (d * here[0] - b * here[1]) / determinant;
            point[1] -= (a * here[1] - c * here[0]) / determinant;
        }
        let end = gap(point);
        assert!(end[0].hypot(end[1]) < 1e-9, "closes to {end:?}");
        let away = (point[0] - rotation.points[0][0]).hypot(point[1] - rotation.points[0][1]);
        assert!(away < 1e-3, "{away} from the orbit");
        // Trace and determinant of the derivative inside the triangle of stability.
        let [[a, c], [b, d]] = slope;
        let (trace, determinant) = (a + d + 2.0, (a + 1.0) * (d + 1.0) - b * c);
        assert!(determinant < 1.0 && trace.abs() < 1.0 + determinant, "{trace}, {determinant}");
    }
}
