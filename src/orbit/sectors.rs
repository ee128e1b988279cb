//! Small motions about a rest on a kink over a step: linear in each sector of directions.
//!
//! In a sector the solution is a Chebyshev series in time, by Picard's iteration, so that the time at which a
//! motion leaves it is a zero of a polynomial, and the solution from there on is known.

use std::f64::consts::PI;
use std::sync::LazyLock;

use nalgebra::{Matrix2, Vector2};

use super::brackets::{below, zero};

/// Chebyshev points of a step.
const NODES: usize = 12;
/// Last coefficients, over the largest, of a resolved series.
const RESOLVED: f64 = 1e-11;
/// Picard's iterations at most, the change that ends them, and crossings in a step.
const ITERATIONS: usize = 60;
const ROUNDING: f64 = 1e-15;
const CROSSINGS: usize = 16;
/// Samples of a step between which a crossing is sought.
const LOOKS: usize = 4;

type Series = [f64; NODES];

/// Chebyshev's polynomials, a row each, at the nodes.
static BASIS: LazyLock<[Series; NODES]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| (PI * i as f64 * (j as f64 + 0.5) / NODES as f64).cos())
    })
});

/// One step in each sector: sense of the motion, side of a corner.
#[derive(Clone, Debug)]
pub(super) struct Step {
    sectors: Vec<Sector>,
    /// The boundary of the side: the function `n . x` that changes its sign there.
    normal: [Series; 2],
}

/// The solution in a sector over a step, from the identity on.
#[derive(Clone, Debug)]
struct Sector {
    entries: [Series; 4],
    looks: [Matrix2<f64>; LOOKS + 1],
}

/// Stiffness and damping at one time, `[d a/d theta, d a/d v]` in each sector, and the boundary of the side.
pub(super) struct Slopes {
    pub sectors: Vec<[f64; 2]>,
    pub normal: [f64; 2],
}

impl Step {
    /// The step of this length from time `tau`, and whether its series are resolved.
    pub fn new(tau: f64, length: f64, slopes: &impl Fn(f64) -> Slopes) -> (Self, bool) {
        let point = |j: usize| BASIS[1][j];
        let at: [Slopes; NODES] =
            std::array::from_fn(|j| slopes(tau + 0.5 * length * (1.0 + point(j))));
        let normal = [0, 1].map(|part| series(&std::array::from_fn(|j| at[j].normal[part])));
        let mut resolved = true;
        let sectors = (0..at[0].sectors.len()).map(|k| {
            let matrices: [Matrix2<f64>; NODES] = std::array::from_fn(|j| {
                let [by_theta, by_velocity] = at[j].sectors[k];
                Matrix2::new(0.0, 1.0, by_theta, by_velocity) * (0.5 * length)
            });
            let (sector, own) = Sector::new(&matrices);
            resolved &= own;
            sector
        });
        let sectors = sectors.collect();
        (Self { sectors, normal }, resolved)
    }

    /// The derivative over the step from `start`, whose signs are kept up to date.
    pub fn after(&self, start: Vector2<f64>, signs: &mut Option<[bool; 2]>) -> Matrix2<f64> {
        let mut held = signs.unwrap_or_else(|| self.signs(start));
        let (mut before, mut from) = (Matrix2::identity(), -1.0);
        for _ in 0..CROSSINGS {
            let sector = self.sector(held);
            let back = sector.back(from) * before;
            let first = back * start;
            let crossing = (0..self.sectors.len() / 2)
                .filter_map(|which| {
                    Some((self.crossing(sector, first, which, held[which], from)?, which))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((to, which)) = crossing else {
                *signs = Some(held);
                return sector.looks[LOOKS] * back;
            };
            before = sector.at(to) * back;
            from = to;
            held[which] = !held[which];
        }
        *signs = Some(held);
        let sector = self.sector(held);
        sector.looks[LOOKS] * sector.back(from) * before
    }

    fn sector(&self, [backward, beyond]: [bool; 2]) -> &Sector {
        &self.sectors[(usize::from(backward) + 2 * usize::from(beyond)) % self.sectors.len()]
    }

    /// The function that is positive in the sense forward (0), or on the first side of the corner (1).
    fn boundary(&self, which: usize, at: f64, place: Vector2<f64>) -> f64 {
        if which == 0 {
            return place[1];
        }
        value(&self.normal[0], at) * place[0] + value(&self.normal[1], at) * place[1]
    }

    /// Whether a small motion from `start` is backward, and beyond the corner; where it begins on a boundary,
    /// a moment later.
    fn signs(&self, start: Vector2<f64>) -> [bool; 2] {
        let mut signs = [false; 2];
        for which in (0..self.sectors.len() / 2).rev() {
            let here = self.boundary(which, -1.0, start);
            signs[which] = here < 0.0;
            if here == 0.0 {
                let a_moment = -1.0 + 1e-6;
                let next = self.sector(signs).at(a_moment) * start;
                signs[which] = self.boundary(which, a_moment, next) < 0.0;
            }
        }
        signs
    }

    /// The first time after `from` at which the motion that begins at `first` leaves the sector across a
    /// boundary.
    fn crossing(
        &self,
        sector: &Sector,
        first: Vector2<f64>,
        which: usize,
        negative: bool,
        from: f64,
    ) -> Option<f64> {
        let sign = if negative { -1.0 } else { 1.0 };
        let [.., c, d] = &sector.entries;
        let velocity: Series = std::array::from_fn(|i| c[i] * first[0] + d[i] * first[1]);
        let inside = |at: f64| match which {
            0 => sign * value(&velocity, at),
            _ => sign * self.boundary(which, at, sector.at(at) * first),
        };
        let place = |j: usize| 2.0 * j as f64 / LOOKS as f64 - 1.0;
        // The last two places inside.
        let mut past = [(from, 0.0); 2];
        for j in 1..=LOOKS {
            let at = place(j);
            if at <= from {
                continue;
            }
            let here = sign * self.boundary(which, at, sector.looks[j] * first);
            let [(earlier, high), (last, low)] = past;
            if here < 0.0 {
                return Some(zero(inside, last, at));
            }
            if high > low && low <= here && last > from {
                // It touches the boundary, or passes and comes back.
                if let Some(beyond) = below(inside, earlier, at) {
                    return Some(zero(inside, earlier, beyond));
                }
            }
            past = [past[1], (at, here)];
        }
        None
    }
}

impl Sector {
    /// The solution of `X' = A X` from the identity, by Picard's iteration on the values of `A` at the nodes,
    /// which are times half the step.
    fn new(matrices: &[Matrix2<f64>; NODES]) -> (Self, bool) {
        let mut values = [Matrix2::identity(); NODES];
        let mut entries = [[0.0; NODES]; 4];
        let mut resolved = false;
        for _ in 0..ITERATIONS {
            let rates: [Matrix2<f64>; NODES] = std::array::from_fn(|j| matrices[j] * values[j]);
            entries = std::array::from_fn(|k| {
                let (row, column) = (k / 2, k % 2);
                let coefficients = series(&std::array::from_fn(|j| rates[j][(row, column)]));
                let largest = coefficients.iter().fold(1.0_f64, |m, c| m.max(c.abs()));
                let last = coefficients[NODES - 2..].iter().all(|c| c.abs() <= RESOLVED * largest);
                resolved = last && (k == 0 || resolved);
                integral(&coefficients, f64::from(u8::from(row == column)))
            });
            let next: [Matrix2<f64>; NODES] =
                std::array::from_fn(|j| matrix(&entries, BASIS[1][j]));
            let moved = (0..NODES).map(|j| (next[j] - values[j]).norm()).fold(0.0, f64::max);
            values = next;
            if moved < ROUNDING {
                break;
            }
        }
        let looks = std::array::from_fn(|j| matrix(&entries, 2.0 * j as f64 / LOOKS as f64 - 1.0));
        (Self { entries, looks }, resolved)
    }

    /// The inverse of the solution at a place.
    fn back(&self, place: f64) -> Matrix2<f64> {
        if place + 1.0 == 0.0 {
            return Matrix2::identity();
        }
        self.at(place).try_inverse().unwrap_or_else(Matrix2::identity)
    }

    /// The solution at a place of the step, from -1 to 1.
    fn at(&self, place: f64) -> Matrix2<f64> {
        matrix(&self.entries, place)
    }
}

/// The Chebyshev series through the values at the nodes.
fn series(values: &Series) -> Series {
    let basis = &*BASIS;
    std::array::from_fn(|i| {
        let sum: f64 = (0..NODES).map(|j| values[j] * basis[i][j]).sum();
        sum * if i == 0 { 1.0 } else { 2.0 } / NODES as f64
    })
}

/// The series of the integral from -1, plus a constant.
fn integral(series: &Series, constant: f64) -> Series {
    let at = |i: usize| series.get(i).copied().unwrap_or(0.0) * if i == 0 { 2.0 } else { 1.0 };
    let term = |i: usize| (at(i - 1) - at(i + 1)) / (2.0 * i as f64);
    let mut whole: Series = std::array::from_fn(|i| if i == 0 { 0.0 } else { term(i) });
    whole[0] = constant - value(&whole, -1.0);
    whole
}

/// The sum of a Chebyshev series, by Clenshaw's recurrence.
fn value(series: &Series, x: f64) -> f64 {
    let mut last = [0.0; 2];
    for c in series[1..].iter().rev() {
        last = [2.0 * x * last[0] - last[1] + c, last[0]];
    }
    x * last[0] - last[1] + series[0]
}

fn matrix(entries: &[Series; 4], x: f64) -> Matrix2<f64> {
    let [a, b, c, d] = entries.each_ref().map(|series| value(series, x));
    Matrix2::new(a, b, c, d)
}
