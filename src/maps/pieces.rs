//! Where orbits are stable in a plane: the pieces that curves divide it into.
//!
//! The orbits of one type change their stability only at curves of that type, and are born only there or at the doublings
//! and symmetry breakings that shed the type. So for each type the points of a lattice are joined to their neighbours
//! except where such a curve passes between, and the number of stable orbits is the same on all points that are joined.
//! It is counted by searches of all orbits: the smallest pieces first, at the point farthest from their edges, where the
//! search tells of the pieces of all other types, too. Where two searches differ, a curve is missing, and the number
//! is not known.

use super::control::Control;
use super::curves::{Curves, Request};
use super::every_orbit::every_orbit;
use crate::continuation::branch::{Bounds, interpolated};
use crate::continuation::critical::{Critical, Point};
use crate::continuation::cycle::{Closure, Type};
use crate::continuation::event::Kind;
use crate::continuation::family::Family;
use crate::continuation::plane::{Curve, Plane};
use crate::error::Error;
use crate::model::pendulum::Symmetry;
use crate::orbit::PeriodicOrbit;

/// Points of the lattice along a side.
pub const SIDE: usize = 256;
/// Parts of a lattice's unit that a piece of a curve has at most.
const FINE: f64 = 0.25;
/// Points of a piece at least for which orbits are searched.
pub const LEAST: usize = 16;
/// Rounds of adding curves at most.
const ROUNDS: usize = 6;

/// The pieces of one type.
#[derive(Clone, Debug)]
pub struct Layer {
    /// The type of the orbits.
    pub of: Type,
    /// The piece of each point of the lattice, rows of equal second coordinate.
    pub piece: Vec<usize>,
    /// The pieces.
    pub pieces: Vec<Piece>,
    /// The curves between them, by their indices.
    pub curves: Vec<usize>,
}

/// Joined points of the lattice.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// A point far from the edges.
    pub inside: usize,
    /// The number of points.
    pub points: usize,
    /// The number of stable orbits; none where it is not known.
    pub stable: Option<usize>,
}

/// The coordinates of a point of the lattice, each from 0 to 1.
#[must_use]
pub fn coordinates(point: usize) -> [f64; 2] {
    [point % SIDE, point / SIDE].map(|k| (k as f64 + 0.5) / SIDE as f64)
}

/// A point of the lattice, and the stable orbits there: each with its type and their number, 2 for twins.
type Search = (usize, Vec<(Type, usize, PeriodicOrbit)>);

/// The pieces of all types of the curves of a plane and of all orbits found there, with their numbers of stable orbits;
/// of mirror images that turn those that turn forward. Where numbers differ in a piece, the curves beside an orbit of the
/// larger number are added to the others.
///
/// # Errors
/// Errors of the search of orbits, as of [`super::orbits::orbits`].
pub fn pieces(
    curves: &mut Curves,
    request: &Request,
    control: &Control,
) -> Result<Vec<Layer>, Error> {
    let mut searches: Vec<Search> = Vec::new();
    if !curves.plane.pendulum([0.5; 2]).is_dissipative() {
        // Nothing attracts.
        return Ok(Vec::new());
    }
    for _ in 0..ROUNDS {
        let layers = layers(&curves.plane, &mut searches, request, control)?;
        let before = curves.plane.curves.len();
        for (layer, number) in layers.iter().flat_map(Layer::unknown) {
            let here = searches.iter().filter(|(point, _)| layer.piece[*point] == number);
            let Some((point, orbits)) = here.max_by_key(|search| layer.count(search)) else {
                continue;
            };
            let [at, held] = coordinates(*point);
            let mut family = section(&curves.plane, held)?;
            for (_, _, orbit) in orbits.iter().filter(|(of, ..)| of.is_like(&layer.of)) {
                family.add(orbit, at, control.flag())?;
            }
            curves.add(&family, (0, held), control)?;
        }
        if curves.plane.curves.len() == before {
            return Ok(layers);
        }
    }
    layers(&curves.plane, &mut searches, request, control)
}

/// No branches yet along the first coordinate.
fn section(plane: &Plane, held: f64) -> Result<Family, Error> {
    let bounds = Bounds { low: 0.0, high: 1.0 };
    Family::new(plane.course.along(0, held), bounds, plane.longest)
}

/// The pieces between the curves that are known; adds what is searched.
fn layers(
    plane: &Plane,
    searches: &mut Vec<Search>,
    request: &Request,
    control: &Control,
) -> Result<Vec<Layer>, Error> {
    let mut layers: Vec<Layer> = Vec::new();
    let add = |layers: &mut Vec<Layer>, of: Type| {
        if of.n <= plane.longest && !layers.iter().any(|layer| layer.of.is_like(&of)) {
            layers.push(Layer::new(plane, of));
        }
    };
    for of in plane.curves.iter().flat_map(|curve| types(plane, curve)) {
        add(&mut layers, of);
    }
    let large = |(number, layer): (usize, &Layer)| {
        let large = layer.pieces.iter().filter(|piece| piece.points >= LEAST);
        large.map(|piece| (piece.points, piece.inside, number)).collect::<Vec<_>>()
    };
    let mut wanted: Vec<(usize, usize, usize)> =
        layers.iter().enumerate().flat_map(large).collect();
    wanted.sort_unstable();
    control.begin(wanted.len());
    for (_, inside, layer) in wanted {
        let piece = &layers[layer].piece;
        if !searches.iter().any(|(point, _)| piece[*point] == piece[inside]) {
            searches.push((inside, stable(plane, coordinates(inside), request, control)?));
        }
        control.add(1);
    }
    for (of, ..) in searches.iter().flat_map(|(_, orbits)| orbits) {
        add(&mut layers, *of);
    }
    for layer in &mut layers {
        for number in 0..layer.pieces.len() {
            let here = searches.iter().filter(|(point, _)| layer.piece[*point] == number);
            let mut counts = here.map(|search| layer.count(search));
            let first = counts.next();
            layer.pieces[number].stable = first.filter(|first| counts.all(|one| one == *first));
        }
    }
    Ok(layers)
}

/// The stable orbits at two coordinates.
fn stable(
    plane: &Plane,
    [at, held]: [f64; 2],
    request: &Request,
    control: &Control,
) -> Result<Vec<(Type, usize, PeriodicOrbit)>, Error> {
    let family = section(plane, held)?;
    let mirrored = plane.symmetry == Some(Symmetry::AtOnce);
    let pendulum = family.pendulum(at);
    let all = every_orbit(&pendulum, plane.longest, request.threads, control)?;
    let typed = |orbit: PeriodicOrbit| {
        let (mut of, _) = family.type_of(&orbit, at)?;
        if mirrored {
            of.w = of.w.abs();
        }
        let twins = mirrored && of.closure == Closure::Whole && of.w == 0;
        Some((of, 1 + usize::from(twins), orbit))
    };
    Ok(all
        .into_iter()
        .filter(|orbit| orbit.multipliers.largest() < 1.0)
        .filter_map(typed)
        .collect())
}

impl Layer {
    /// The number of stable orbits of its type that a search has found.
    fn count(&self, (_, orbits): &Search) -> usize {
        orbits.iter().filter(|(of, ..)| of.is_like(&self.of)).map(|(_, number, _)| number).sum()
    }

    /// The pieces, themselves and their numbers, that are large enough to be searched and whose number is not known.
    fn unknown(&self) -> impl Iterator<Item = (&Self, usize)> {
        let open = |k: &usize| self.pieces[*k].points >= LEAST && self.pieces[*k].stable.is_none();
        (0..self.pieces.len()).filter(open).map(move |k| (self, k))
    }

    fn new(plane: &Plane, of: Type) -> Self {
        // Whether a point is joined to the next one to the right, and to the one above.
        let mut joined = [vec![true; SIDE * SIDE], vec![true; SIDE * SIDE]];
        let curves: Vec<usize> = (0..plane.curves.len())
            .filter(|k| types(plane, &plane.curves[*k]).any(|one| one.is_like(&of)))
            .collect();
        for curve in &curves {
            for both in plane.curves[*curve].points.windows(2) {
                divide(&mut joined, &both[0], &both[1]);
            }
        }
        let neighbours = |point: usize| {
            let [i, j] = [point % SIDE, point / SIDE];
            [
                (i + 1 < SIDE).then(|| (point + 1, joined[0][point])),
                (i > 0).then(|| (point - 1, joined[0][point - 1])),
                (j + 1 < SIDE).then(|| (point + SIDE, joined[1][point])),
                (j > 0).then(|| (point - SIDE, joined[1][point - SIDE])),
            ]
        };
        let all = 0..SIDE * SIDE;
        let mut piece = vec![usize::MAX; SIDE * SIDE];
        let mut pieces = Vec::new();
        for first in all.clone() {
            if piece[first] != usize::MAX {
                continue;
            }
            piece[first] = pieces.len();
            let mut open = vec![first];
            let mut points = 0;
            while let Some(point) = open.pop() {
                points += 1;
                for (next, free) in neighbours(point).into_iter().flatten() {
                    if free && piece[next] == usize::MAX {
                        piece[next] = pieces.len();
                        open.push(next);
                    }
                }
            }
            pieces.push(Piece { inside: first, points, stable: None });
        }
        // Layer by layer from the edges in: the last points of a piece are the farthest.
        let edge = |point: &usize| neighbours(*point).iter().any(|one| one.is_none_or(|n| !n.1));
        let mut front: Vec<usize> = all.filter(edge).collect();
        let mut seen = vec![false; SIDE * SIDE];
        for point in &front {
            seen[*point] = true;
        }
        while !front.is_empty() {
            let mut next = Vec::new();
            for point in front {
                pieces[piece[point]].inside = point;
                for (beside, _) in neighbours(point).into_iter().flatten() {
                    if !std::mem::replace(&mut seen[beside], true) {
                        next.push(beside);
                    }
                }
            }
            front = next;
        }
        Self { of, piece, pieces, curves }
    }
}

/// The types whose number of stable orbits may change at a curve: that of its orbits and that which it sheds. Where
/// friction ceases to hold the pendulum, rest becomes an orbit of the drive's period.
fn types(plane: &Plane, curve: &Curve) -> impl Iterator<Item = Type> {
    let shed = plane.critical(curve.of, curve.kind).cycles.shed_type(curve.kind);
    let symmetric = plane.symmetry == Some(Symmetry::HalfPeriod);
    let closure = if symmetric { Closure::Half } else { Closure::Whole };
    let begun = (curve.kind == Kind::RestBoundary).then_some(Type { closure, ..curve.of });
    [Some(curve.of), shed, begun].into_iter().flatten()
}

/// Parts the neighbours between which a curve passes from one of its points to the next.
fn divide(joined: &mut [Vec<bool>; 2], a: &Point, b: &Point) {
    let [from, to] = [a, b].map(|point| Critical::at(&point.orbit.place));
    let unit = SIDE as f64;
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let count = (length * unit / FINE).ceil().max(1.0);
    let mut before = from;
    for k in 1..=count as usize {
        let here = Critical::at(&interpolated(&a.orbit, &b.orbit, k as f64 / count));
        for axis in [0, 1] {
            // Lines of the lattice on which the other coordinate is that of points.
            let [low, high] = [before, here].map(|one| one[1 - axis] * unit - 0.5);
            let first = low.min(high).ceil().max(0.0) as usize;
            for line in first..SIDE {
                if line as f64 > low.max(high) {
                    break;
                }
                // Not a number where the curve runs along the line.
                let part = ((line as f64 - low) / (high - low)).max(0.0);
                let along = (before[axis] + part * (here[axis] - before[axis])) * unit - 0.5;
                if along >= 0.0 && along < unit - 1.0 {
                    let place = [along as usize, line];
                    joined[axis][place[axis] + SIDE * place[1 - axis]] = false;
                }
            }
        }
        before = here;
    }
}
