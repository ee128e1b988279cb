//! Which attractors of neighbouring models are one, and their numbers along parameters.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use super::parameter_map::ParameterMap;
use crate::integrate::State;
use crate::model::Angle;

/// Distance assigned to an attractor without points, rad.
const APART: f64 = PI;
/// Distance below which orbits of neighbours may be one branch.
const NEAR: f64 = 0.3;

/// An attractor of a model: the numbers of both.
pub type Node = (usize, usize);

/// Two attractors of neighbours that are one: whether no orbit leads from one to the other, their distance, their numbers.
pub type Pair = (bool, f64, usize, usize);

/// The mean distance from points of one set to the other's.
#[must_use]
pub fn distance(angle: Angle, one: &[State], other: &[State]) -> f64 {
    if one.is_empty() || other.is_empty() {
        return APART;
    }
    let nearest =
        |a: &State| other.iter().map(|b| angle.distance(*a, *b)).fold(f64::INFINITY, f64::min);
    one.iter().map(nearest).sum::<f64>() / one.len() as f64
}

/// The pairs of attractors of two models, given by their points: first what Newton's method continues, then the nearest
/// of the others, those apart by less than `reach` of their numbers; 0 where they are not alike.
#[must_use]
pub fn matched(
    angle: Angle,
    [old, new]: [&[Vec<State>]; 2],
    reach: impl Fn(usize, usize) -> f64,
    continued: &[(usize, usize)],
) -> Vec<Pair> {
    let apart = |k: usize, m: usize| {
        distance(angle, &old[k], &new[m]).max(distance(angle, &new[m], &old[k]))
    };
    let mut pairs: Vec<Pair> = continued.iter().map(|&(k, m)| (false, apart(k, m), k, m)).collect();
    let free = |pairs: &[Pair], k: usize, m: usize| pairs.iter().all(|p| p.2 != k && p.3 != m);
    let both = (0..old.len()).flat_map(|k| (0..new.len()).map(move |m| (k, m)));
    let alike = both.filter(|&(k, m)| free(&pairs, k, m) && reach(k, m) > 0.0);
    let mut others: Vec<Pair> = alike.map(|(k, m)| (true, apart(k, m), k, m)).collect();
    others.sort_by(|a, b| a.1.total_cmp(&b.1).then((a.2, a.3).cmp(&(b.2, b.3))));
    for pair in others {
        if pair.1 < reach(pair.2, pair.3) && free(&pairs, pair.2, pair.3) {
            pairs.push(pair);
        }
    }
    pairs
}

/// The branch of each attractor of each model, numbered from 0 in their order. A link joins the branches of two
/// attractors, unless some model has attractors of both.
#[must_use]
pub fn numbered(sizes: &[usize], links: impl IntoIterator<Item = (Node, Node)>) -> Vec<Vec<usize>> {
    let nodes =
        sizes.iter().enumerate().flat_map(|(place, size)| (0..*size).map(move |k| (place, k)));
    let mut groups: Vec<BTreeMap<usize, usize>> =
        nodes.clone().map(|(place, k)| BTreeMap::from([(place, k)])).collect();
    let mut group: BTreeMap<Node, usize> = nodes.enumerate().map(|(i, node)| (node, i)).collect();
    for (one, other) in links {
        let [a, b] = [group[&one], group[&other]];
        let [small, large] = if groups[a].len() <= groups[b].len() { [a, b] } else { [b, a] };
        if small == large || groups[small].keys().any(|place| groups[large].contains_key(place)) {
            continue;
        }
        let moved = std::mem::take(&mut groups[small]);
        for (&place, &k) in &moved {
            group.insert((place, k), large);
        }
        groups[large].extend(moved);
    }
    let mut number: BTreeMap<usize, usize> = BTreeMap::new();
    let mut of = |node: Node| {
        let next = number.len();
        *number.entry(group[&node]).or_insert(next)
    };
    let place = |(place, size): (usize, &usize)| (0..*size).map(|k| of((place, k))).collect();
    sizes.iter().enumerate().map(place).collect()
}

/// The branch of each attractor along a row: near orbits, and chaos of one kind, with equal turns.
#[must_use]
pub fn linked(map: &ParameterMap) -> Vec<usize> {
    let points = |cell: usize| -> Vec<Vec<State>> {
        map.cells[cell].found.iter().map(|one| one.attractor.points.clone()).collect()
    };
    let key = |cell: usize, k: usize| {
        let one = &map.cells[cell].found[k].attractor;
        (one.kind, one.n, one.w)
    };
    let mut links = Vec::new();
    for next in 1..map.cells.len() {
        let reach = |k: usize, m: usize| match (key(next - 1, k) == key(next, m), key(next, m).1) {
            (false, _) => 0.0,
            (true, Some(_)) => NEAR,
            (true, None) => f64::INFINITY,
        };
        let (old, new) = (points(next - 1), points(next));
        let pairs = matched(Angle::Circle, [&old, &new], reach, &[]);
        links.extend(pairs.into_iter().map(|(_, _, k, m)| ((next - 1, k), (next, m))));
    }
    let sizes: Vec<usize> = map.cells.iter().map(|cell| cell.found.len()).collect();
    numbered(&sizes, links).concat()
}
