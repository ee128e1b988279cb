//! Maps over parameters and bifurcation diagrams: against reference attractors and bifurcations.

use std::collections::BTreeMap;

use pendmap::attractor::Kind;
use pendmap::integrate::State;
use pendmap::maps::bifurcation::{self, Diagram, bifurcation};
use pendmap::maps::cell::Cell;
use pendmap::maps::control::Control;
use pendmap::maps::parameter_map::{ParameterMap, Range, Request, parameter_map};
use pendmap::maps::survey::{Block, Survey};
use pendmap::model::{Parameter, Pendulum};

use crate::support::{driven, plane};
use crate::truths::{attractors_at, fractions_at, number, table, truths};

fn evenly(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| low + (high - low) * k as f64 / (count.max(2) - 1) as f64).collect()
}

fn starts(count: usize) -> Vec<State> {
    plane(1000).sampled_states(count, 1)
}

fn asked(p: Vec<f64>, omega: Vec<f64>, count: usize, threads: usize) -> Request {
    let axes = [Range::of(Parameter::P, p), Range::of(Parameter::Omega, omega)];
    let starts = starts(61 * count);
    Request { axes, starts, each: count, tol: 1e-6, bound: None, kept: 1, threads }
}

fn mapped(
    base: &Pendulum,
    p: Vec<f64>,
    omega: Vec<f64>,
    count: usize,
    threads: usize,
) -> ParameterMap {
    let request = asked(p, omega, count, threads);
    parameter_map(base, &request, &Control::default()).expect("a map")
}

fn diagram(base: &Pendulum, p: Vec<f64>) -> Diagram {
    let axis = Range::of(Parameter::P, p);
    let (starts, each, first) = (starts(549), 9, None);
    let request =
        bifurcation::Request { axis, starts, each, first, tol: 1e-6, bound: None, threads: 0 };
    bifurcation(base, &request, &Control::default()).expect("a diagram")
}

/// Period and winding of all periodic attractors.
fn closed(cell: &Cell) -> Vec<(usize, i64)> {
    let key = |a: &pendmap::attractor::Attractor| Some((a.n?, a.w?));
    let mut found: Vec<_> = cell.found.iter().filter_map(|f| key(&f.attractor)).collect();
    found.sort_unstable();
    found
}

#[test]
fn each_cell_has_the_reference_attractors() {
    for p in [0.5, 0.6, 1.0] {
        let map = mapped(&driven(0.1, 1.0, 2.0), vec![p], vec![2.0], 100, 1);
        let known = attractors_at(p);
        let mut wanted: Vec<_> = known.iter().map(|k| (k.n, k.w)).collect();
        wanted.sort_unstable();
        let found = closed(&map.cells[0]);
        for key in wanted {
            assert!(found.contains(&key), "p = {p}: {key:?} is not among {found:?}");
        }
        for known in known {
            let nearest =
                map.cells[0].found.iter().flat_map(|f| &f.attractor.points).map(|point| {
                    (point[0] - known.points[0][0]).abs().max((point[1] - known.points[0][1]).abs())
                });
            assert!(nearest.fold(f64::INFINITY, f64::min) < 1e-5);
        }
    }
}

#[test]
fn shares_of_many_starts_are_those_of_the_basins() {
    let count = 2000;
    let map = mapped(&driven(0.1, 0.5, 2.0), vec![0.5], vec![2.0], count, 1);
    for ((n, w, _), share) in fractions_at(0.5) {
        let of =
            |f: &pendmap::maps::cell::Found| (f.attractor.n, f.attractor.w) == (Some(n), Some(w));
        let found: f64 = map.cells[0].found.iter().filter(|f| of(f)).map(|f| f.share).sum();
        let error = (share * (1.0 - share) / count as f64).sqrt();
        assert!((found - share).abs() < 4.0 * error, "{n}:{w} {found} {share}");
    }
}

#[test]
fn threads_and_repetition_change_nothing() {
    let once = |threads| {
        mapped(&driven(0.1, 1.0, 2.0), evenly(0.2, 2.0, 9), evenly(1.5, 2.2, 7), 5, threads)
    };
    let told = |map: &ParameterMap| format!("{:?}", map.cells);
    let one = told(&once(1));
    assert_eq!(one, told(&once(2)));
    assert_eq!(one, told(&once(1)));
}

#[test]
fn blocks_computed_apart_and_stored_give_the_same_map() {
    let (base, control) = (driven(0.1, 1.0, 2.0), Control::default());
    let request = asked(evenly(0.2, 1.2, 19), evenly(1.7, 2.2, 17), 2, 0);
    let whole = parameter_map(&base, &request, &control).expect("a map");
    let first = Survey::new(&base, &request).expect("a survey");
    // Each call has a survey of its own, and the last block comes first.
    let another = || Survey::restored(&base, &request, &first.state()).expect("a survey");
    let order = || (0..first.blocks()).rev();
    let searched = |k| (k, another().search(k, &control).expect("a block").to_bytes());
    let mut blocks: BTreeMap<usize, Vec<u8>> = order().map(searched).collect();
    assert_eq!(blocks.len(), 4);
    for pass in 1..=first.passes() {
        let exchanged = |k: usize| {
            let survey = another();
            let around = survey.around(k).into_iter();
            let read =
                |other: usize| (other, survey.block(other, &blocks[&other]).expect("a block"));
            let known: BTreeMap<usize, Block> = around.map(read).collect();
            let new = survey.exchange(pass, k, |other| &known[&other], &control);
            Some((k, new.expect("no interruption")?.to_bytes()))
        };
        let new: Vec<_> = order().filter_map(exchanged).collect();
        blocks.extend(new);
        let read = |(k, bytes): (&usize, &Vec<u8>)| first.block(*k, bytes).expect("a block");
        if !blocks.iter().map(read).any(|block| block.gained(pass)) {
            break;
        }
    }
    let read = |(k, bytes): (&usize, &Vec<u8>)| first.block(*k, bytes).expect("a block");
    let apart = first.result(&blocks.iter().map(read).collect::<Vec<_>>()).expect("a map");
    assert_eq!(format!("{:?}", apart.cells), format!("{:?}", whole.cells));
    assert_eq!(apart.searched_again, whole.searched_again);
    assert!(whole.searched_again > 0);
}

#[test]
fn stored_results_of_another_plane_are_refused() {
    let (base, control) = (driven(0.1, 1.0, 2.0), Control::default());
    let survey = |columns| {
        Survey::new(&base, &asked(evenly(0.2, 0.4, columns), vec![2.0], 1, 0)).expect("a survey")
    };
    let (own, other) = (survey(2), survey(3));
    let bytes = other.search(0, &control).expect("a block").to_bytes();
    assert!(other.block(0, &bytes).is_ok());
    assert!(own.block(0, &bytes).is_err());
    assert!(other.block(0, &bytes[..9]).is_err());
    assert!(own.result(&[]).is_err());
    let request = asked(evenly(0.2, 0.4, 2), vec![2.0], 1, 0);
    assert!(Survey::restored(&base, &request, &other.state()).is_err());
}

#[test]
fn coexisting_branches_are_followed_to_their_ends() {
    // At omega = 1.8 the oscillation is born subcritically: it coexists with rest from its fold to
    // the onset of resonance, where few starts find it.
    let [(_, entry), ..] = table(&truths()["rest_onset"]).collect::<Vec<_>>()[..] else {
        panic!("a table")
    };
    let (fold, onset) = (number(&entry["p_fold"]), number(&entry["p_onset"]));
    let values = evenly(0.15, 0.5, 36);
    let map = mapped(&driven(0.1, 1.0, 1.8), values.clone(), vec![1.8], 3, 0);
    for (p, cell) in values.into_iter().zip(&map.cells) {
        let found = closed(cell);
        if (p - fold).abs() > 0.005 {
            assert_eq!(found.contains(&(2, 0)), p > fold, "p = {p}: {found:?}");
        }
        if (p - onset).abs() > 0.005 {
            assert_eq!(found.contains(&(1, 0)), p < onset, "p = {p}: {found:?}");
        }
    }
}

#[test]
fn transients_however_long_are_no_chaos() {
    // On the saddle the exponent is at least 0.15; chaos at the end of a cascade has less.
    let transient = |cell: &Cell| {
        cell.found.iter().any(|f| f.attractor.kind.is_chaotic() && f.attractor.exponent > 0.1)
    };

    let map = mapped(&driven(0.1, 1.0, 2.0), evenly(1.15, 1.79, 33), vec![2.0], 9, 0);
    for (p, cell) in evenly(1.15, 1.79, 33).into_iter().zip(&map.cells) {
        assert!(!transient(cell), "p = {p}");
        assert!(!closed(cell).is_empty(), "p = {p}");
    }
}

#[test]
fn bifurcations_of_the_diagram_are_at_their_places() {
    let entry = |name: &str| number(&truths()["bifurcations_gamma0.1_omega2"][name]["p"]);
    let step = 1e-3;
    let values = |around: f64| evenly(around - 10.5 * step, around + 10.5 * step, 22);
    let count = |diagram: &Diagram, key: (usize, i64)| -> Vec<usize> {
        let own = |cell: &Cell| closed(cell).into_iter().filter(|k| *k == key).count();
        diagram.map.cells.iter().map(own).collect()
    };
    let base = driven(0.1, 1.0, 2.0);
    // No start finds the rotation near its fold: it is continued there from a parameter at which it
    // is found.
    let ahead = evenly(entry("rot_SN") - 10.5 * step, entry("rot_SN") + 189.5 * step, 201);
    let fold = count(&diagram(&base, ahead), (1, 1));
    assert_eq!(fold, [vec![0; 11], vec![1; 190]].concat());
    let twins = count(&diagram(&base, values(entry("osc_SB"))), (2, 0));
    assert_eq!(twins, [vec![1; 11], vec![2; 11]].concat());
    let doubled = diagram(&base, values(entry("rot_PD1")));
    assert_eq!(count(&doubled, (1, 1)), [vec![1; 11], vec![0; 11]].concat());
    assert_eq!(count(&doubled, (2, 2)), [vec![0; 11], vec![1; 11]].concat());
}

#[test]
fn sweeps_show_the_hysteresis_of_a_subcritical_onset() {
    let [(_, entry), ..] = table(&truths()["rest_onset"]).collect::<Vec<_>>()[..] else {
        panic!("a table")
    };
    let (fold, onset) = (number(&entry["p_fold"]), number(&entry["p_onset"]));
    let values = evenly(0.1, 0.6, 101);
    let found = diagram(&driven(0.1, 1.0, 1.8), values.clone());
    let all: Vec<_> = found.map.cells.iter().flat_map(|cell| &cell.found).collect();
    for (k, p) in values.into_iter().enumerate() {
        if (p - fold).abs() < 0.01 || (p - onset).abs() < 0.01 {
            continue;
        }
        let on = |at: Option<usize>| at.map(|i| all[i].attractor.kind == Kind::Rest);
        assert_eq!(on(found.up[k].on), Some(p < onset), "up, p = {p}");
        assert_eq!(on(found.down[k].on), Some(p < fold), "down, p = {p}");
    }
}
