//! The attractors along one parameter: all coexisting ones, and those followed under slow increase
//! and decrease.

use super::cell::Cell;
use super::control::{Control, pool};
use super::parameter_map::{ParameterMap, Plane, Range, Request as MapRequest, parameter_map};
use crate::attractor::Attractor;
use crate::attractor::trap::Band;
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::model::Pendulum;
use crate::orbit::rotation::running_states;

/// Number of points stored of a non-periodic attractor.
const KEPT: usize = 200;
/// Periods between two tests of a followed motion.
const ROUND: usize = 32;
/// Number of tests before it is classified as on no known orbit.
const ROUNDS: usize = 12;
/// Distance to a known orbit, also a period later, below which a trajectory has arrived.
const ARRIVED: f64 = 1e-3;
/// Displacement at every value: no motion remains on an unstable orbit.
const NUDGE: f64 = 1e-6;

/// A request and its numerical choices.
#[derive(Clone, Debug)]
pub struct Request {
    /// The parameters and their values.
    pub axis: Range,
    /// Where the trajectories of the search start.
    pub starts: Vec<State>,
    /// Number of starts of each value, in turn.
    pub each: usize,
    /// Where what is followed starts, at either end; by default on the attractor that most starts end on.
    pub first: Option<State>,
    /// See [`MapRequest`].
    pub tol: f64,
    /// See [`MapRequest`].
    pub bound: Option<u32>,
    /// Workers; 0 for one a processor.
    pub threads: usize,
}

/// The followed motion at one value.
#[derive(Clone, Debug, Default)]
pub struct Followed {
    /// Index of its attractor in the list over all values.
    pub on: Option<usize>,
    /// Its points, if it is on no attractor.
    pub loose: Vec<State>,
}

/// A bifurcation diagram.
#[derive(Clone, Debug)]
pub struct Diagram {
    /// The attractors at each value.
    pub map: ParameterMap,
    /// The motion under a slow increase, value by value.
    pub up: Vec<Followed>,
    /// The motion under a slow decrease, in the order of the values.
    pub down: Vec<Followed>,
}

/// All attractors along one parameter, and the motions followed in both directions.
///
/// # Errors
/// Those of [`parameter_map`].
pub fn bifurcation(
    base: &Pendulum,
    request: &Request,
    control: &Control,
) -> Result<Diagram, Error> {
    let asked = request.of_map();
    let map = parameter_map(base, &asked, control)?;
    let plane = Plane { base, axes: &asked.axes };
    pool(request.threads)?.install(|| followed(map, &plane, request.first, control))
}

impl Request {
    /// The request of the map: a plane of one row.
    #[must_use]
    pub fn of_map(&self) -> MapRequest {
        MapRequest {
            axes: [self.axis.clone(), Range::default()],
            starts: self.starts.clone(),
            each: self.each,
            tol: self.tol,
            bound: self.bound,
            kept: KEPT,
            threads: self.threads,
        }
    }
}

/// The diagram of a map of one row, followed on the threads of the current pool; see [`Request`].
///
/// # Errors
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn followed(
    map: ParameterMap,
    plane: &Plane,
    first: Option<State>,
    control: &Control,
) -> Result<Diagram, Error> {
    let offset = offsets(&map.cells);
    let sweep = |order: Vec<usize>| follow(&map, plane, &offset, order, first, control);
    let count = map.cells.len();
    let (up, down) =
        rayon::join(|| sweep((0..count).collect()), || sweep((0..count).rev().collect()));
    Ok(Diagram { up: up?, down: down?, map })
}

/// The index of each cell's first attractor in the list of all.
fn offsets(cells: &[Cell]) -> Vec<usize> {
    let mut next = 0;
    let place = |cell: &Cell| {
        next += cell.found.len();
        next - cell.found.len()
    };
    cells.iter().map(place).collect()
}

fn follow(
    map: &ParameterMap,
    plane: &Plane,
    offset: &[usize],
    order: Vec<usize>,
    first: Option<State>,
    control: &Control,
) -> Result<Vec<Followed>, Error> {
    let mut followed = vec![Followed::default(); map.cells.len()];
    let leading = order.first().and_then(|cell| leading(&map.cells[*cell]));
    let mut state = first.or(leading).unwrap_or([NUDGE, NUDGE]);
    for cell in order {
        control.check()?;
        let strobe = map.resolution.strobe(&plane.pendulum(cell), plane.place(cell));
        let found = &map.cells[cell];
        state = [state[0] + NUDGE, state[1] + NUDGE];
        let (on, loose) = settle(&strobe, found, &mut state);
        followed[cell] = Followed { on: on.map(|k| offset[cell] + k), loose };
    }
    Ok(followed)
}

/// A point of the attractor that most starts end on; the first of equals.
fn leading(cell: &Cell) -> Option<State> {
    let most = cell.found.iter().map(|f| f.share).fold(0.0, f64::max);
    let found = cell.found.iter().find(|f| f.share >= most)?;
    found.attractor.points.first().copied()
}

/// Integrates `state` until it has converged to an attractor of the cell and returns its index, or
/// else the points.
fn settle(strobe: &Strobe, cell: &Cell, state: &mut State) -> (Option<usize>, Vec<State>) {
    // Without drive a running state is not synchronous with the section: its band traps it.
    let runs = cell.found.iter().any(|f| f.attractor.is_running());
    let states = if runs { running_states(&strobe.pendulum) } else { Vec::new() };
    let running: Vec<(i64, Band)> = states
        .iter()
        .filter_map(|one| Some((one.sense, Band::around(strobe, &one.curve, 0)?)))
        .collect();
    for _ in 0..ROUNDS {
        step(strobe, state, ROUND);
        let mut next = *state;
        step(strobe, &mut next, 1);
        let arrived = |a: &Attractor| {
            if a.is_held() {
                let same = (state[0].cos() < 0.0) == (a.points[0][0].cos() < 0.0);
                return same && state[1] == 0.0 && strobe.equation.holds_for_ever(state[0]);
            }
            if a.is_running() {
                let held = |(sense, band): &(i64, Band)| *sense == a.sense && band.contains(*state);
                return running.iter().any(held);
            }
            let near = |s: State| a.passes(s, ARRIVED);
            a.n.is_some() && near(*state) && near(next)
        };
        if let Some(k) = cell.found.iter().position(|f| arrived(&f.attractor)) {
            return (Some(k), Vec::new());
        }
    }
    let chaotic: Vec<usize> =
        (0..cell.found.len()).filter(|k| cell.found[*k].attractor.kind.is_chaotic()).collect();
    if let [one] = chaotic[..] {
        return (Some(one), Vec::new());
    }
    let mut loose = Vec::with_capacity(KEPT);
    for _ in 0..KEPT {
        step(strobe, state, 1);
        loose.push(*state);
    }
    (None, loose)
}

fn step(strobe: &Strobe, state: &mut State, periods: usize) {
    let (mut theta, mut velocity, mut turns) = ([state[0]], [state[1]], [0.0]);
    // Lengths agree, so this cannot fail.
    let _ = strobe.advance(&mut theta, &mut velocity, &mut turns, periods);
    *state = [theta[0], velocity[0]];
}
