//! The number of steps a period that a tolerance requires.

use super::kernel::stroboscopic::Strobe;
use super::states::{State, States};
use crate::error::Error;
use crate::lanes::InstructionSet;
use crate::model::{Angle, Pendulum};

/// Periods after which step errors are compared.
pub const PERIODS: usize = 5;
/// The share of the sampled starts whose error must stay below the tolerance.
pub const PERCENTILE: f64 = 0.95;
/// Smallest and largest tolerance.
pub const TOLERANCES: [f64; 2] = [1e-13, 1e-2];
const MOST_STEPS: usize = 20_000;

/// The error of `strobe` on `starts`: the 95th percentile of the distance that halving the step
/// makes after five periods.
/// Starts that leave the range of numbers on either side count as infinitely far.
#[must_use]
pub fn error_reached(strobe: &Strobe, starts: &[State]) -> f64 {
    let [coarse, fine] = [strobe, &strobe.refined(2)].map(|strobe| {
        let mut states = States::from(starts);
        strobe.advance(&mut states, PERIODS);
        states
    });
    let mut distances: Vec<f64> = coarse
        .iter()
        .zip(fine.iter())
        .map(|(a, b)| {
            let d = strobe.angle.distance(a, b);
            if d.is_finite() { d } else { f64::INFINITY }
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    let rank = (PERCENTILE * distances.len() as f64).ceil() as usize;
    distances.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// Distance of two states, the angle taken modulo a turn.
#[must_use]
pub fn distance(a: State, b: State) -> f64 {
    Angle::Circle.distance(a, b)
}

/// The angle in [-pi, pi].
#[must_use]
pub fn wrapped(angle: f64) -> f64 {
    Angle::Circle.wrapped(angle)
}

/// The stroboscopic map with the fewest steps a period that reach `tol`, and the error reached.
///
/// # Errors
/// [`Error::Range`] if `tol` is outside [`TOLERANCES`]; [`Error::Diverges`] if most motions leave the
/// range of numbers however many steps are taken; [`Error::Tolerance`] if no number of steps
/// reaches it, as rounding may forbid on chaotic starts.
pub fn choose(
    pendulum: &Pendulum,
    starts: &[State],
    tol: f64,
    simd: InstructionSet,
) -> Result<(Strobe, f64), Error> {
    if !(TOLERANCES[0]..=TOLERANCES[1]).contains(&tol) {
        return Err(Error::Range {
            name: "tol",
            value: tol,
            allowed: "a number from 1e-13 to 1e-2",
        });
    }
    let measure = |steps: usize| {
        let strobe = Strobe::new(pendulum, steps, simd);
        let error = error_reached(&strobe, starts);
        (strobe, error)
    };
    let pull = pendulum.greatest_pull().sqrt();
    let guess = pendulum.period() * pull / 0.25 * (1e-6 / tol).powf(1.0 / 8.0);
    let mut steps = (guess.ceil() as usize).clamp(4, MOST_STEPS);
    let (mut too_few, mut enough) = (3_usize, None::<(Strobe, f64)>);
    let mut best = f64::INFINITY;
    for _ in 0..24 {
        let (strobe, error) = measure(steps);
        best = best.min(error);
        let ratio = (error / tol).powf(1.0 / 8.0);
        if error <= tol {
            enough = Some((strobe, error));
            if steps <= too_few + 1 + too_few / 50 {
                break;
            }
            let aim = (steps as f64 * ratio * 1.005).ceil() as usize;
            steps = aim.clamp(too_few + 1, steps - 1);
        } else {
            too_few = steps;
            let aim = steps as f64 * if ratio.is_finite() { ratio.clamp(1.01, 3.0) } else { 2.0 };
            let limit = enough.as_ref().map_or(MOST_STEPS, |(s, _)| s.steps());
            if too_few + 1 >= limit {
                break;
            }
            steps = (aim.ceil() as usize).clamp(too_few + 1, limit);
            if enough.is_some() && steps == limit {
                steps = usize::midpoint(too_few, limit);
            }
        }
        if steps == too_few {
            break;
        }
    }
    let missed =
        if best.is_finite() { Error::Tolerance { tol, reached: best } } else { Error::Diverges };
    enough.ok_or(missed)
}
