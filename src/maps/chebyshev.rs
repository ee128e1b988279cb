//! Zeros of a smooth function on an interval, by Chebyshev's polynomials.

use std::f64::consts::PI;

/// Initial number of points of the interpolant, doubled until it converges.
const POINTS: [usize; 3] = [32, 64, 128];
/// Coefficients this small relative to the largest are rounding.
const ROUNDING: f64 = 1e-12;
/// Number of sign samples between two points.
const BETWEEN: usize = 12;
/// Halvings of a bracket.
const HALVINGS: usize = 60;

/// Values of several functions at a place.
pub(super) type Values<const K: usize> = [f64; K];

/// Several functions on one interval.
#[derive(Clone, Debug)]
pub(super) struct Interpolant<const K: usize> {
    low: f64,
    high: f64,
    /// Coefficients of each function.
    series: [Vec<f64>; K],
}

impl<const K: usize> Interpolant<K> {
    /// The series of `function` between two places. An entire function's series falls faster than any
    /// power; where a few hundred terms are too few for it, the best is kept.
    pub fn of(low: f64, high: f64, mut function: impl FnMut(f64) -> Values<K>) -> Self {
        let mut made = Self { low, high, series: std::array::from_fn(|_| Vec::new()) };
        for count in POINTS {
            // Chebyshev's points of the first kind.
            let angle = |j: usize| PI * (j as f64 + 0.5) / count as f64;
            let values: Vec<Values<K>> =
                (0..count).map(|j| function(made.place(angle(j).cos()))).collect();
            for (k, series) in made.series.iter_mut().enumerate() {
                let coefficient = |i: usize| {
                    let sum: f64 =
                        (0..count).map(|j| values[j][k] * (i as f64 * angle(j)).cos()).sum();
                    sum * if i == 0 { 1.0 } else { 2.0 } / count as f64
                };
                *series = (0..count).map(coefficient).collect();
            }
            let resolved = made.series.iter().all(|series| {
                let largest = series.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
                series[count - 3..].iter().all(|c| c.abs() <= ROUNDING * largest)
            });
            if resolved {
                break;
            }
        }
        made
    }

    fn place(&self, x: f64) -> f64 {
        0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * x
    }

    /// Function `k` at a point, by Clenshaw's recurrence.
    pub fn value(&self, k: usize, place: f64) -> f64 {
        let x = (2.0 * place - self.low - self.high) / (self.high - self.low);
        let mut last = [0.0; 2];
        for c in self.series[k].iter().skip(1).rev() {
            last = [2.0 * x * last[0] - last[1] + c, last[0]];
        }
        x * last[0] - last[1] + self.series[k].first().copied().unwrap_or(0.0)
    }

    /// The zeros of `combined`, made of the functions, in order; also pairs of zeros between two
    /// samples, next to an extremum.
    pub fn zeros(&self, combined: impl Fn(Values<K>) -> f64) -> Vec<f64> {
        let at = |place: f64| combined(std::array::from_fn(|k| self.value(k, place)));
        let count = BETWEEN * self.series[0].len();
        // Denser toward the ends, as the points are.
        let place = |i: usize| match i {
            0 => self.low,
            _ if i == count => self.high,
            _ => self.place(-(PI * i as f64 / count as f64).cos()),
        };
        let places: Vec<f64> = (0..=count).map(place).collect();
        let values: Vec<f64> = places.iter().map(|p| at(*p)).collect();
        let mut zeros = Vec::new();
        for i in 0..count {
            let [left, right] = [values[i], values[i + 1]];
            if i > 0 && left * right > 0.0 && left * values[i - 1] > 0.0 {
                let lowest = left.abs() <= values[i - 1].abs() && left.abs() <= right.abs();
                if lowest {
                    let inner = least(&at, places[i - 1], places[i + 1], left.signum());
                    if at(inner) * left < 0.0 {
                        zeros.push(bisected(&at, places[i - 1], inner));
                        zeros.push(bisected(&at, inner, places[i + 1]));
                    }
                }
            }
            if left == 0.0 {
                zeros.push(places[i]);
            } else if left * right < 0.0 {
                zeros.push(bisected(&at, places[i], places[i + 1]));
            }
        }
        if values[count] == 0.0 {
            zeros.push(places[count]);
        }
        zeros
    }
}

/// The minimum of a function times `sign`, by the golden section.
fn least(function: &impl Fn(f64) -> f64, low: f64, high: f64, sign: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (low, high);
    for _ in 0..HALVINGS {
        let [a, b] = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        if sign * function(a) < sign * function(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

fn bisected(function: &impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    let sign = function(low).signum();
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if function(middle) * sign > 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}
