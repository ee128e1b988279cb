//! The part of the plane visited by a set of stroboscopic points.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::integrate::State;
use crate::model::{Angle, Pendulum};

/// Two regions that share more than this part of the smaller one's cells meet.
const SHARED: f64 = 0.2;

/// Cells of equal size that contain stroboscopic points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Sorted, each once.
    cells: Vec<[i32; 2]>,
    /// Cells per radian and per unit of velocity.
    scale: [f64; 2],
    /// Cells of a turn.
    side: i32,
    angle: Angle,
}

impl Region {
    /// No cell yet; `side` cells make a turn, and as many the velocity that gravity and drive give over a
    /// radian.
    #[must_use]
    pub fn new(side: usize, pendulum: &Pendulum) -> Self {
        let pull = pendulum.greatest_pull().sqrt();
        let speed = if pull.is_finite() { pull.max(1.0) } else { 1.0 };
        let scale = side as f64 / TAU;
        Self {
            cells: Vec::new(),
            scale: [scale, scale / speed],
            side: side as i32,
            angle: pendulum.angle(),
        }
    }

    fn cell(&self, [theta, velocity]: State) -> [i32; 2] {
        let column = self.column((theta * self.scale[0] + 0.5).floor() as i32);
        // The conversion saturates for a motion that diverges.
        [column, (velocity * self.scale[1] + 0.5).floor() as i32]
    }

    fn column(&self, column: i32) -> i32 {
        if self.angle == Angle::Circle { column.rem_euclid(self.side) } else { column }
    }

    /// Topology of its angles.
    #[must_use]
    pub fn angle(&self) -> Angle {
        self.angle
    }

    /// Adds the cells of these states.
    pub fn mark(&mut self, states: &[State]) {
        self.add(states.iter().map(|state| self.cell(*state)).collect());
    }

    fn add(&mut self, mut cells: Vec<[i32; 2]>) {
        cells.sort_unstable();
        cells.dedup();
        self.merge(&cells);
    }

    /// Adds cells that are sorted, each once.
    fn merge(&mut self, other: &[[i32; 2]]) {
        let own = std::mem::take(&mut self.cells);
        self.cells.reserve(own.len() + other.len());
        let (mut a, mut b) = (own.iter().peekable(), other.iter().peekable());
        while let Some(next) = a.peek().into_iter().chain(b.peek()).min().copied() {
            self.cells.push(*next);
            a.next_if_eq(&next);
            b.next_if_eq(&next);
        }
    }

    /// Whether a state lies in a visited cell.
    #[must_use]
    pub fn contains(&self, state: State) -> bool {
        self.cells.binary_search(&self.cell(state)).is_ok()
    }

    /// Whether most of these states lie in visited cells.
    #[must_use]
    pub fn holds_most(&self, states: &[State]) -> bool {
        2 * states.iter().filter(|state| self.contains(**state)).count() > states.len()
    }

    /// Adds the cells of another region of the same pendulum.
    pub fn unite(&mut self, other: &Self) {
        self.merge(&other.cells);
    }

    /// Whether the two share a fifth of the smaller one's cells.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        let (small, large) =
            if self.cells.len() < other.cells.len() { (self, other) } else { (other, self) };
        let both =
            small.cells.iter().filter(|cell| large.cells.binary_search(cell).is_ok()).count();
        both as f64 > SHARED * small.cells.len() as f64
    }

    /// The image under `(th, v) -> (-th, -v)`; cells are centred on 0, so that it is exact.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let image = |[a, b]: &[i32; 2]| [self.column(a.saturating_neg()), b.saturating_neg()];
        let mut mirrored = Self { cells: Vec::new(), ..*self };
        mirrored.add(self.cells.iter().map(image).collect());
        mirrored
    }
}
