//! The attractors along one parameter: all coexisting ones, and those followed under slow increase
//! and decrease.

use super::bounds::decay_periods;
use super::cell::{Cell, LIKE};
use super::control::{Control, pool};
use super::parameter_map::{ParameterMap, Plane, Range, Request as MapRequest, parameter_map};
use crate::attractor::Attractor;
use crate::attractor::rest::standing;
use crate::attractor::trap::Band;
use crate::error::Error;
use crate::integrate::{State, States, Strobe, TangentStates};
use crate::model::Pendulum;
use crate::orbit::PoincareMap;
use crate::orbit::rotation::running_states;

/// Number of points stored of a non-periodic attractor.
const KEPT: usize = 200;
/// Periods between two tests of a followed motion.
const ROUND: usize = 32;
/// Number of tests after which, and after its multiples, it may be on an attractor without a period.
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
    pool(request.threads)?.install(|| followed(map, &plane, request.first, request.bound, control))
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
/// At each value a motion is followed for as long as the attractor that attracts most slowly there needs, at most for
/// `bound` periods.
///
/// # Errors
/// [`Error::Interrupted`] if `control` was cancelled.
pub fn followed(
    map: ParameterMap,
    plane: &Plane,
    first: Option<State>,
    bound: Option<u32>,
    control: &Control,
) -> Result<Diagram, Error> {
    let offset = offsets(&map.cells);
    let follow = Follow { map: &map, plane, bound, control };
    let sweep = |order: Vec<usize>| follow.along(&offset, order, first);
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

/// What both sweeps share.
struct Follow<'a> {
    map: &'a ParameterMap,
    plane: &'a Plane<'a>,
    bound: Option<u32>,
    control: &'a Control,
}

impl Follow<'_> {
    fn along(
        &self,
        offset: &[usize],
        order: Vec<usize>,
        first: Option<State>,
    ) -> Result<Vec<Followed>, Error> {
        let cells = &self.map.cells;
        let mut followed = vec![Followed::default(); cells.len()];
        let leading = order.first().and_then(|cell| leading(&cells[*cell]));
        let mut state = first.or(leading).unwrap_or([NUDGE, NUDGE]);
        for cell in order {
            let pendulum = self.plane.pendulum(cell);
            let strobe = self.map.resolution.strobe(&pendulum, self.plane.place(cell));
            state = [state[0] + NUDGE, state[1] + NUDGE];
            let (on, loose) = self.settle(&strobe, &cells[cell], &mut state)?;
            followed[cell] = Followed { on: on.map(|k| offset[cell] + k), loose };
        }
        Ok(followed)
    }

    /// Integrates `state` until it has converged to an attractor of the cell and returns its index, or
    /// else the points.
    fn settle(
        &self,
        strobe: &Strobe,
        cell: &Cell,
        state: &mut State,
    ) -> Result<(Option<usize>, Vec<State>), Error> {
        // Without drive a running state is not synchronous with the section: its band traps it.
        let runs = cell.found.iter().any(|f| f.attractor.is_running());
        let states = if runs { running_states(&strobe.pendulum) } else { Vec::new() };
        let apart =
            if runs { standing(strobe, &PoincareMap::of_steps(strobe)) } else { Vec::new() };
        let running: Vec<(i64, Band)> = states
            .iter()
            .filter_map(|one| Some((one.sense, Band::around(strobe, &one.curve, 0, &apart)?)))
            .collect();
        let rates = cell.found.iter().map(|f| -f.attractor.exponent).filter(|rate| *rate > 0.0);
        let slowest = rates.fold(f64::INFINITY, f64::min);
        let least = cell.observed.max((ROUNDS * ROUND) as u32);
        let periods = decay_periods(&strobe.pendulum, slowest, least, self.bound) as usize;
        for round in 1..=periods.div_ceil(ROUND) {
            self.control.check()?;
            *state = after(strobe, *state, ROUND);
            let next = after(strobe, *state, 1);
            let arrived = |a: &Attractor| {
                if a.is_held() {
                    let same = (state[0].cos() < 0.0) == (a.points[0][0].cos() < 0.0);
                    return same && state[1] == 0.0 && strobe.equation.holds_for_ever(state[0]);
                }
                if a.is_running() {
                    let held = |(sense, band): &(i64, Band)| *sense == a.w && band.contains(*state);
                    return running.iter().any(held);
                }
                let near = |s: State| a.passes(s, ARRIVED);
                a.n.is_some() && near(*state) && near(next)
            };
            if let Some(k) = cell.found.iter().position(|f| arrived(&f.attractor)) {
                return Ok((Some(k), Vec::new()));
            }
            if round.is_multiple_of(ROUNDS)
                && let Some(k) = on_set(strobe, cell, *state)
            {
                return Ok((Some(k), Vec::new()));
            }
        }
        let mut loose = Vec::with_capacity(KEPT);
        for _ in 0..KEPT {
            *state = after(strobe, *state, 1);
            loose.push(*state);
        }
        Ok((None, loose))
    }
}

/// The attractor without a period that a motion is nearest to on average: chaos, if the motion's exponent is nearer
/// to that of the attractor than to 0, where a slow one has it; a quasi-periodic rotation within [`LIKE`].
fn on_set(strobe: &Strobe, cell: &Cell, state: State) -> Option<usize> {
    let mut motion = TangentStates::along(&[state], [1.0, 0.0]);
    let mut points = Vec::with_capacity(KEPT);
    for _ in 0..KEPT {
        strobe.stretch(&mut motion, 1);
        points.push(motion.states().get(0));
    }
    let exponent = motion.growth()[0] / (KEPT as f64 * strobe.pendulum.period());
    let mean = |a: &Attractor| -> f64 {
        let nearest = |p: &State| {
            let away = a.points.iter().map(|q| a.angle.distance(*p, *q));
            away.fold(f64::INFINITY, f64::min)
        };
        points.iter().map(nearest).sum::<f64>() / points.len() as f64
    };
    let fits = |a: &Attractor, apart: f64| {
        if a.kind.is_chaotic() { exponent > 0.5 * a.exponent } else { apart < LIKE }
    };
    let sets = cell.found.iter().map(|f| &f.attractor).enumerate().filter(|(_, a)| a.n.is_none());
    let far = sets.map(|(k, a)| (k, a, mean(a))).filter(|(_, a, apart)| fits(a, *apart));
    far.min_by(|a, b| a.2.total_cmp(&b.2)).map(|(k, ..)| k)
}

/// A point of the attractor that most starts end on; the first of equals.
fn leading(cell: &Cell) -> Option<State> {
    let most = cell.found.iter().map(|f| f.share).fold(0.0, f64::max);
    let found = cell.found.iter().find(|f| f.share >= most)?;
    found.attractor.points.first().copied()
}

/// The state after `periods` forcing periods.
fn after(strobe: &Strobe, state: State, periods: usize) -> State {
    let mut states = States::from([state].as_slice());
    strobe.advance(&mut states, periods);
    states.get(0)
}
