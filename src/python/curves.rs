//! Bindings of the bifurcation set of a plane.

use numpy::{PyArray1, PyArray2};
use pendmap::attractor::Kind as OrbitKind;
use pendmap::continuation::course::{Course, Law};
use pendmap::continuation::critical::Critical;
use pendmap::continuation::cycle::{Closure, Type};
use pendmap::continuation::event::Kind;
use pendmap::continuation::plane::Plane;
use pendmap::error::Error;
use pendmap::maps::curves::{Request, Section, curves as search};
use pendmap::maps::pieces::{LEAST, Layer, SIDE, coordinates, pieces};
use pendmap::model::Parameter;
use pendmap::model::pendulum::Symmetry;
use pyo3::prelude::*;

use super::convert::{Array, array};
use super::long_calls::interruptible;
use super::model::Model;
use super::raise;

/// Parameters along an axis: places from 0 to 1, and the values of each there.
type Axis = (Vec<f64>, Vec<(String, Vec<f64>)>);

/// Curves as columns: of the curves, of their places, of the points of codimension 2.
#[pyclass(frozen, get_all, module = "pendmap._core")]
pub struct BifurcationSet {
    /// Of each curve: what happens there, period, net turns, whether the orbits are their own mirror images, why it ends
    /// on both sides, the point of codimension 2 that either end is at, -1 where there is none.
    kind: Vec<&'static str>,
    n: Array<i32>,
    w: Array<i32>,
    symmetric: Vec<bool>,
    ends: Vec<(&'static str, &'static str)>,
    meets: Vec<(i32, i32)>,
    /// Of each place: its curve, both coordinates, angle and velocity of a point of the orbit, real and imaginary parts
    /// of its multipliers, 1 where new orbits live beyond the loss of stability, 0 where before it, -1 where that has no meaning.
    curve: Array<i32>,
    at: Py<PyArray2<f64>>,
    theta: Array<f64>,
    velocity: Array<f64>,
    multipliers: Py<PyArray2<f64>>,
    supercritical: Array<i32>,
    /// What a jump of a multiplier does there: nothing, a fold, a period doubling, a symmetry breaking.
    jump: Array<i32>,
    /// Of each point of codimension 2: what it is, and its place.
    degenerate_kind: Vec<&'static str>,
    degenerate_place: Array<i32>,
    /// The coordinate held on each section, its value, orbits found there, new curves.
    sections: Vec<(usize, f64, usize, usize)>,
    /// Of each type of orbits: kind, period, net turns, and the number of stable orbits at each point of a lattice, -1 where it is
    /// not known. Of each of its regions: the number of the type, both coordinates of a point inside, the part of the plane, and the
    /// number of stable orbits.
    types: Vec<(&'static str, usize, i64)>,
    /// Numbers of a type and of a curve at which its stable orbits change.
    borders: Vec<(usize, usize)>,
    stable: Vec<Py<PyArray1<i16>>>,
    regions: Vec<(usize, f64, f64, f64, i16)>,
}

/// Curves of folds, period doublings, symmetry breakings and changes of slips and sticks of orbits up to the period `longest`
/// in the plane of two axes; with `regions` also where how many are stable.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // what Python passes, and the interpreter
#[pyo3(signature = (model, axes, longest, regions, threads, progress=None))]
pub fn bifurcation_set(
    py: Python<'_>,
    model: Model,
    axes: (Axis, Axis),
    longest: usize,
    regions: bool,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<BifurcationSet> {
    let base = model.pendulum()?;
    let axis = |(places, parameters): Axis| -> Result<Vec<(Parameter, Law)>, Error> {
        let one = |(name, values): (String, Vec<f64>)| {
            Ok((base.parameter(&name)?, Law::through(&places, &values)?))
        };
        parameters.into_iter().map(one).collect()
    };
    let axes = vec![axis(axes.0).map_err(raise)?, axis(axes.1).map_err(raise)?];
    let course = Course::new(base, axes);
    let request = Request { longest, only: None, threads };
    let (found, layers) = interruptible(py, progress.as_ref(), |control| {
        let mut found = search(&course, &request, control)?;
        let layers = if regions { pieces(&mut found, &request, control)? } else { Vec::new() };
        Ok((found, layers))
    })?;
    BifurcationSet::new(py, &found.plane, &found.sections, &layers)
}

impl BifurcationSet {
    pub(super) fn new(
        py: Python<'_>,
        plane: &Plane,
        sections: &[Section],
        layers: &[Layer],
    ) -> PyResult<Self> {
        let all = &plane.curves;
        let angle = plane.course.base.angle();
        let sign = |known: Option<bool>| known.map_or(-1, i32::from);
        let (mut curve, mut at, mut multipliers, mut supercritical) =
            (vec![], vec![], vec![], vec![]);
        let (mut theta, mut velocity, mut jump) = (vec![], vec![], vec![]);
        let (mut degenerate_kind, mut degenerate_place) = (vec![], vec![]);
        // Number of the first point of codimension 2 of each curve.
        let mut first = Vec::new();
        for (number, one) in all.iter().enumerate() {
            first.push(degenerate_kind.len());
            for (kind, index) in &one.degenerate {
                degenerate_kind.push(kind.word());
                degenerate_place.push((curve.len() + index) as i32);
            }
            let critical = plane.critical(one.of, one.kind);
            for point in &one.points {
                let [angle_there, speed] = critical.points(&point.orbit.place)[0];
                theta.push(angle.wrapped(angle_there));
                velocity.push(speed);
                curve.push(number as i32);
                at.push(Critical::at(&point.orbit.place).to_vec());
                let pair = critical.cycles.multipliers(&point.orbit).0;
                // What is held is a set.
                let size = if one.kind == Kind::RestBoundary { f64::NAN } else { 1.0 };
                let parts = pair.iter().flat_map(|m| [m.re * size, m.im * size]);
                multipliers.push(parts.collect::<Vec<f64>>());
                supercritical.push(sign(critical.is_supercritical(point)));
                jump.push(match critical.jumped(point) {
                    None => 0,
                    Some(Kind::Fold) => 1,
                    Some(Kind::PeriodDoubling) => 2,
                    Some(_) => 3,
                });
            }
        }
        let meets = |of: Option<(usize, usize)>| of.map_or(-1, |(c, k)| (first[c] + k) as i32);
        let counted = |stable: Option<usize>| stable.map_or(-1, |count| count as i16);
        let (mut types, mut borders) = (vec![], vec![]);
        let (mut stable, mut regions) = (vec![], vec![]);
        for Layer { of, piece, pieces, curves } in layers {
            let mirrored = of.w != 0 && plane.symmetry == Some(Symmetry::AtOnce);
            for w in if mirrored { vec![of.w, -of.w] } else { vec![of.w] } {
                borders.extend(curves.iter().map(|curve| (types.len(), *curve)));
                let of_point = piece.iter().map(|number| counted(pieces[*number].stable));
                stable.push(PyArray1::from_iter(py, of_point).unbind());
                for one in pieces.iter().filter(|one| one.points >= LEAST) {
                    let [x, y] = coordinates(one.inside);
                    let part = one.points as f64 / (SIDE * SIDE) as f64;
                    regions.push((types.len(), x, y, part, counted(one.stable)));
                }
                types.push((kind(*of), of.n, w));
            }
        }
        Ok(Self {
            kind: all.iter().map(|one| one.kind.word()).collect(),
            n: array(py, all.iter().map(|one| one.of.n as i32).collect()),
            w: array(py, all.iter().map(|one| one.of.w as i32).collect()),
            symmetric: all.iter().map(|one| one.of.closure != Closure::Whole).collect(),
            ends: all.iter().map(|one| (one.ends[0].words(), one.ends[1].words())).collect(),
            meets: all.iter().map(|one| (meets(one.meets[0]), meets(one.meets[1]))).collect(),
            curve: array(py, curve),
            at: PyArray2::from_vec2(py, &at)?.unbind(),
            theta: array(py, theta),
            velocity: array(py, velocity),
            multipliers: PyArray2::from_vec2(py, &multipliers)?.unbind(),
            supercritical: array(py, supercritical),
            jump: array(py, jump),
            degenerate_kind,
            degenerate_place: array(py, degenerate_place),
            sections: sections.iter().map(|s| (s.held.0, s.held.1, s.orbits, s.new)).collect(),
            types,
            borders,
            stable,
            regions,
        })
    }
}

/// The kind of the orbits of a type.
fn kind(Type { w, closure, centre, .. }: Type) -> &'static str {
    let kind = match (w, closure) {
        (0, Closure::Rest) if centre.cos() > 0.0 => OrbitKind::Rest,
        (0, Closure::Rest) => OrbitKind::InvertedRest,
        (0, _) => OrbitKind::Oscillation,
        _ => OrbitKind::Rotation,
    };
    kind.word()
}
