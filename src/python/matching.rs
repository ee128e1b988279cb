//! Bindings of the matching of attractors.

use pendmap::integrate::State;
use pendmap::maps::matching::{self, Node, Pair};
use pendmap::model::Angle;
use pyo3::prelude::*;

fn angle(circle: bool) -> Angle {
    if circle { Angle::Circle } else { Angle::Line }
}

/// The mean distance from points of one set to the other's.
#[pyfunction]
#[pyo3(signature = (one, other, circle=true))]
pub fn distance(one: Vec<State>, other: Vec<State>, circle: bool) -> f64 {
    matching::distance(angle(circle), &one, &other)
}

/// Pairs of attractors of two models: what is continued, then the nearest within the reach of both numbers.
#[pyfunction]
#[pyo3(signature = (old, new, reach, continued=Vec::new(), circle=true))]
pub fn matched(
    old: Vec<Vec<State>>,
    new: Vec<Vec<State>>,
    reach: Vec<Vec<f64>>,
    continued: Vec<(usize, usize)>,
    circle: bool,
) -> Vec<Pair> {
    matching::matched(angle(circle), [&old, &new], |k, m| reach[k][m], &continued)
}

/// The branch of each attractor of each model, numbered from 0 in their order.
#[pyfunction]
pub fn numbered(sizes: Vec<usize>, links: Vec<(Node, Node)>) -> Vec<Vec<usize>> {
    matching::numbered(&sizes, links)
}
