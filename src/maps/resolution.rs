//! Step lengths over a plane of parameters.

use serde::{Deserialize, Serialize};

use super::parameter_map::Plane;
use crate::error::Error;
use crate::integrate::accuracy::{choose, error_reached};
use crate::integrate::{State, Strobe};
use crate::lanes::InstructionSet;
use crate::model::Pendulum;

/// Cells along each side at which the longest step is found.
const MEASURED: usize = 9;

/// The step length times the root of the greatest load, by cell.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Resolution {
    columns: Vec<usize>,
    rows: Vec<usize>,
    /// Rows of equal second parameter.
    step: Vec<f64>,
    simd: InstructionSet,
    /// The greatest error measured, halfway between those cells.
    pub reached_error: f64,
}

impl Resolution {
    /// The longest steps that keep the error of `probes` after five periods within `tol`, as
    /// [`error_reached`] defines it, at cells spread over the plane and halfway between them.
    ///
    /// # Errors
    /// Those of [`choose`].
    pub fn new(
        plane: &Plane,
        probes: &[State],
        tol: f64,
        simd: InstructionSet,
    ) -> Result<Self, Error> {
        let [columns, rows] = plane.size().map(spread);
        let mut step = Vec::new();
        for row in &rows {
            for column in &columns {
                let pendulum = plane.pendulum(plane.cell(*column, *row));
                let (strobe, _) = choose(&pendulum, probes, tol, simd)?;
                step.push(measure(&pendulum) / strobe.steps() as f64);
            }
        }
        let mut all = Self { columns, rows, step, simd, reached_error: 0.0 };
        let middles = |places: &[usize]| -> Vec<usize> {
            places.windows(2).map(|pair| usize::midpoint(pair[0], pair[1])).collect()
        };
        let (across, up) = (middles(&all.columns), middles(&all.rows));
        let single = |places: Vec<usize>, own: &[usize]| {
            if places.is_empty() { own.to_vec() } else { places }
        };
        let (across, up) = (single(across, &all.columns), single(up, &all.rows));
        for row in up {
            for column in &across {
                let at = [*column, row];
                let pendulum = plane.pendulum(plane.cell(*column, row));
                let mut error = error_reached(&all.strobe(&pendulum, at), probes);
                if error > tol {
                    let (strobe, reached) = choose(&pendulum, probes, tol, simd)?;
                    let step = measure(&pendulum) / strobe.steps() as f64;
                    all.around(at).for_each(|k| all.step[k] = all.step[k].min(step));
                    error = reached;
                }
                all.reached_error = all.reached_error.max(error);
            }
        }
        Ok(all)
    }

    /// This one on another instruction set, if it was measured on this plane.
    #[must_use]
    pub fn restored(self, plane: &Plane, simd: InstructionSet) -> Option<Self> {
        let places = [&self.columns, &self.rows];
        let own = places.into_iter().zip(plane.size()).all(|(own, size)| *own == spread(size));
        (own && self.step.len() == self.columns.len() * self.rows.len())
            .then_some(Self { simd, ..self })
    }

    /// The stroboscopic map of the cell at this column and row.
    #[must_use]
    pub fn strobe(&self, pendulum: &Pendulum, at: [usize; 2]) -> Strobe {
        let steps = (measure(pendulum) / self.step(at) * (1.0 - 1e-12)).ceil().max(1.0);
        Strobe::new(pendulum, steps as usize, self.simd)
    }

    /// The smallest of the measured steps of the surrounding cells.
    fn step(&self, at: [usize; 2]) -> f64 {
        self.around(at).map(|k| self.step[k]).fold(f64::INFINITY, f64::min)
    }

    /// Indices of the measured cells around one: itself, two or four.
    fn around(&self, [column, row]: [usize; 2]) -> impl Iterator<Item = usize> + use<> {
        let beside = |places: &[usize], at: usize| {
            let after = places.partition_point(|place| *place < at).min(places.len() - 1);
            let own = places[after] == at;
            if own { after..=after } else { after.saturating_sub(1)..=after }
        };
        let (across, width) = (beside(&self.columns, column), self.columns.len());
        beside(&self.rows, row).flat_map(move |j| across.clone().map(move |i| j * width + i))
    }
}

/// Places spread over a side, its ends among them.
fn spread(count: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..MEASURED).map(|k| k * (count - 1) / (MEASURED - 1)).collect();
    places.dedup();
    places
}

/// The length of a period, in units in which steps are equally hard.
fn measure(pendulum: &Pendulum) -> f64 {
    pendulum.period() * pendulum.greatest_pull().sqrt()
}
