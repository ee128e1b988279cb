//! Trapping regions: a trajectory inside one is captured by its attractor.
//!
//! Around a point of a periodic attractor with monodromy `M` and spectral radius `rho` the discrete
//! Lyapunov equation `M^T S M / r^2 - S = -I`, `rho < r < 1`, gives an ellipse `x^T S x <= level`
//! that `M` shrinks by `r` at least. A circle is insufficient: rotations grow threefold before they
//! shrink. With `r = 1` the ellipse of an orbit with large initial growth would shrink too little
//! to be distinguished from rounding. The extent of the ellipse in the nonlinear map is sampled:
//! the largest level such that every sample within it comes back lower.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix2, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::effort::Sampling;
use super::gauge::Gauge;
use crate::error::{Error, unless_cancelled};
use crate::integrate::accuracy::wrapped;
use crate::integrate::{State, States, Strobe};
use crate::model::Angle;
use crate::orbit::PeriodicOrbit;
use crate::orbit::newton::SAME;

/// An ellipse around one point of an attractor: inside where `y1^2 + y2^2 < 1`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Ellipse {
    /// Centre.
    pub centre: State,
    /// `y1 = shape[0] dtheta + shape[1] dv`, `y2 = shape[2] dv`.
    pub shape: [f64; 3],
    /// Index of the attractor in the catalogue.
    pub attractor: usize,
    /// Index of the point on the attractor's cycle.
    pub point: usize,
    /// Length of that cycle.
    pub cycle: usize,
}

impl Ellipse {
    /// `y1^2 + y2^2` of a state with wrapped angle.
    #[must_use]
    pub fn height(&self, state: State) -> f64 {
        let [a, b, c] = self.shape;
        let (x, y) = (state[0] - self.centre[0], state[1] - self.centre[1]);
        (a * x + b * y).powi(2) + (c * y).powi(2)
    }

    /// Shrinks it where it holds a state with wrapped angle, other than its centre, to end short of that.
    pub fn end_short_of(&mut self, state: State) {
        let height = self.height(state);
        let own = (state[0] - self.centre[0]).hypot(state[1] - self.centre[1]) < SAME;
        if height < 1.0 && !own {
            self.shape = self.shape.map(|x| x / (MARGIN * height.sqrt()));
        }
    }
}

/// Sampled half widths of a band, each `RATIO` of the preceding one.
const LEVELS: usize = 54;
const RATIO: f64 = 0.82;
/// Least contraction of the nonlinear map, as a part of the linear one.
const LEFT: f64 = 0.2;
/// Ellipses need not contract faster than this, however strong the damping.
const LEAST_SHRINK: f64 = 0.3;
/// Samples of a band must come back lower by this factor.
const BAND_LOWER: f64 = 0.999;
/// Periods within which they must.
const RETURNS: usize = 8;
/// Samples of both edges of a band.
const SIDES: usize = BAND_CELLS;
/// An edge has come to the curve within this multiple of the narrowest width that the curve's table resolves.
const ARRIVED: f64 = 2.0;
/// Edges are followed for this multiple of the time in which damping should bring them to the curve.
const PATIENCE: f64 = 2.0;
/// Least damping for which that time is reckoned, per period.
const LEAST_SHRINKING: f64 = 1e-4;
/// The part of the sampled radius that is used.
const MARGIN: f64 = 0.9;

/// The ellipses of the points of `orbit`; empty if sampling finds no safe level.
///
/// Ellipses that cross `theta = pi` are included twice, one turn apart.
///
/// # Errors
/// [`Error::Interrupted`] if `cancel` was set.
pub fn ellipses(
    strobe: &Strobe,
    orbit: &PeriodicOrbit,
    sampling: &Sampling,
    cancel: &AtomicBool,
) -> Result<Vec<Ellipse>, Error> {
    let mut traps = Vec::new();
    let shrink = orbit.multipliers.largest().sqrt().max(LEAST_SHRINK);
    let lower = 1.0 - LEFT * (1.0 - shrink);
    let points = orbit.points.iter().zip(&orbit.monodromy).enumerate();
    for (point, (centre, monodromy)) in points.take(sampling.points) {
        let kinked = Gauge::of_kink(&strobe.pendulum, orbit, shrink);
        let own = || lyapunov_root(&(monodromy / shrink)).map(Gauge::Ellipse);
        let Some(gauge) = kinked.or_else(own) else { return Ok(Vec::new()) };
        let root = gauge.root();
        unless_cancelled(cancel)?;
        let widest = 3.0 / extent(&root);
        let part = sampling.ratio.powi(sampling.levels as i32);
        let from = |round: usize| widest * part.powi(round as i32);
        let radius = (0..sampling.rounds).find_map(|round| {
            safe_radius(strobe, orbit.n, *centre, &gauge, lower, sampling, from(round))
        });
        let Some(radius) = radius else { return Ok(Vec::new()) };
        let shape = root.map(|x| x / radius);
        let reach = radius * extent(&root);
        for turn in strobe.angle.turns() {
            let centre = [centre[0] + turn, centre[1]];
            if *turn == 0.0 || centre[0].abs() - reach <= std::f64::consts::PI {
                traps.push(Ellipse { centre, shape, attractor: 0, point, cycle: orbit.n });
            }
        }
    }
    Ok(traps)
}

/// These ellipses around the mirror image of their orbit, whose points have moved by `moved`
/// places (see [`PeriodicOrbit::mirrored`]).
#[must_use]
pub fn mirrored(ellipses: &[Ellipse], moved: usize) -> Vec<Ellipse> {
    let image = |e: &Ellipse| Ellipse {
        centre: [-e.centre[0], -e.centre[1]],
        point: (e.point + e.cycle - moved) % e.cycle,
        ..*e
    };
    ellipses.iter().map(image).collect()
}

/// The upper triangular root `R` of `S = R^T R`, where `M^T S M - S = -I`, as `[r11, r12, r22]`.
fn lyapunov_root(m: &Matrix2<f64>) -> Option<[f64; 3]> {
    let (a, b, c, d) = (m[(0, 0)], m[(0, 1)], m[(1, 0)], m[(1, 1)]);
    // For S = [[s, t], [t, u]]: three linear equations.
    let matrix = Matrix3::new(
        a * a - 1.0,
        2.0 * a * c,
        c * c,
        a * b,
        a * d + b * c - 1.0,
        c * d,
        b * b,
        2.0 * b * d,
        d * d - 1.0,
    );
    let solution = matrix.lu().solve(&Vector3::new(-1.0, 0.0, -1.0))?;
    let (s, t, u) = (solution[0], solution[1], solution[2]);
    let rest = u - t * t / s;
    (s > 0.0 && rest > 0.0).then(|| [s.sqrt(), t / s.sqrt(), rest.sqrt()])
}

/// Half the width in theta of the ellipse of radius 1.
fn extent(root: &[f64; 3]) -> f64 {
    let [a, b, c] = *root;
    // dtheta = (y1 - b dv) / a with dv = y2 / c.
    (1.0 + (b / c).powi(2)).sqrt() / a
}

/// The largest radius from `widest` inwards within which every sample comes back lower.
fn safe_radius(
    strobe: &Strobe,
    n: usize,
    centre: State,
    gauge: &Gauge,
    lower: f64,
    sampling: &Sampling,
    widest: f64,
) -> Option<f64> {
    let Sampling { rays, levels, ratio, returns, .. } = *sampling;
    let radii: Vec<f64> = (0..levels).map(|k| widest * ratio.powi(k as i32)).collect();
    let count = rays * levels;
    let sample = |k: usize| {
        let (radius, ray) = (radii[k / rays], k % rays);
        let angle = TAU * (ray as f64 + 0.5) / rays as f64;
        let [dtheta, dv] = gauge.point(angle);
        [centre[0] + radius * dtheta, centre[1] + radius * dv]
    };
    let mut states: States = (0..count).map(sample).collect();
    let mut best: Option<f64> = None;
    for _ in 0..returns {
        strobe.advance(&mut states, n);
        let height = |i: usize| {
            let [theta, velocity] = states.get(i);
            gauge.height([strobe.angle.wrapped(theta - centre[0]), velocity - centre[1]])
        };
        // From the smallest level outward, up to the first one with a sample that rises.
        let safe = (0..levels)
            .rev()
            .take_while(|k| (0..rays).all(|ray| height(k * rays + ray) < lower * radii[*k]))
            .last();
        if let Some(k) = safe {
            let radius = MARGIN * radii[k];
            best = Some(best.map_or(radius, |b: f64| b.max(radius)));
        }
    }
    best
}

/// A band around a running state: a curve `v = g(theta)` that attracts trajectories.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Band {
    /// `g` at the centres of equal cells of [-pi, pi).
    pub curve: Vec<f64>,
    /// Half the band's width in velocity.
    pub half_width: f64,
    /// Index of the attractor in the catalogue.
    pub attractor: usize,
}

/// Cells of a band's curve.
pub const BAND_CELLS: usize = 720;

impl Band {
    /// `g(theta)` by linear interpolation.
    #[must_use]
    pub fn at(&self, theta: f64) -> f64 {
        let cells = self.curve.len() as f64;
        let x = (theta / TAU + 0.5).rem_euclid(1.0) * cells - 0.5;
        let (i, part) = (x.floor(), x - x.floor());
        let left = self.curve[(i.rem_euclid(cells)) as usize];
        let right = self.curve[((i + 1.0).rem_euclid(cells)) as usize];
        left + part * (right - left)
    }

    /// Whether a state with wrapped angle is inside.
    #[must_use]
    pub fn contains(&self, state: State) -> bool {
        self.distance(state) < self.half_width
    }

    /// The band around the image of its curve under `(th, v) -> (-th, -v)`.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self { curve: self.curve.iter().rev().map(|v| -v).collect(), ..*self }
    }

    /// The band around states `curve` of a running state, short of the states `apart`; `None` if no sampled width
    /// is safe.
    ///
    /// Both edges are followed until they have come to the curve: the map keeps the order of states across it, so
    /// that nothing between them can end elsewhere.
    #[must_use]
    pub fn around(
        strobe: &Strobe,
        states: &[State],
        attractor: usize,
        apart: &[State],
    ) -> Option<Self> {
        if strobe.angle == Angle::Line {
            // A trajectory that rotates for ever there never returns.
            return None;
        }
        let curve = tabulate(states)?;
        let mut band = Self { curve, half_width: 1.0, attractor };
        let limit = apart.iter().map(|s| band.distance(*s)).fold(f64::INFINITY, f64::min);
        let narrower = |width: &f64| MARGIN * width < limit;
        let widths: Vec<f64> =
            (0..LEVELS).map(|k| 4.0 * RATIO.powi(k as i32)).filter(narrower).collect();
        let mut edges = band.edges(&widths);
        let mut best: Option<[f64; 2]> = None;
        for _ in 0..RETURNS {
            strobe.advance(&mut edges, 1);
            let holds = |k: &usize| {
                (k * SIDES..(k + 1) * SIDES)
                    .all(|i| band.distance(edges.get(i)) < BAND_LOWER * widths[*k])
            };
            // Interpolation of the curve limits how narrow a band can be judged.
            let mut safe = (0..widths.len()).rev().skip_while(|k| !holds(k)).take_while(holds);
            if let Some(first) = safe.next() {
                let width = MARGIN * widths[safe.last().unwrap_or(first)];
                if best.is_none_or(|[widest, _]| width > widest) {
                    best = Some([width, ARRIVED * widths[first]]);
                }
            }
        }
        let [mut width, near] = best?;
        while width > near {
            let Some(elsewhere) = band.stays(strobe, width, near) else {
                band.half_width = width;
                return Some(band);
            };
            width = MARGIN * width.min(elsewhere);
        }
        None
    }

    /// Narrows it where it holds a state with wrapped angle, to end short of that.
    pub fn end_short_of(&mut self, state: State) {
        self.half_width = self.half_width.min(MARGIN * self.distance(state));
    }

    /// How far a state with wrapped angle is from the curve, in velocity.
    #[must_use]
    pub fn distance(&self, state: State) -> f64 {
        (state[1] - self.at(state[0])).abs()
    }

    /// States along both edges of bands of these half widths.
    fn edges(&self, widths: &[f64]) -> States {
        let state = |(k, width): (usize, f64)| {
            let at = TAU * (((k / 2) as f64 + 0.5) / (SIDES / 2) as f64 - 0.5);
            let side = if k.is_multiple_of(2) { -width } else { width };
            [at, self.at(at) + side]
        };
        widths.iter().flat_map(|width| (0..SIDES).map(|k| (k, *width))).map(state).collect()
    }

    /// The least distance from the curve at which states of the edges remain; `None` if all come within `near` of it.
    fn stays(&self, strobe: &Strobe, width: f64, near: f64) -> Option<f64> {
        let mut edges = self.edges(&[width]);
        let shrinking = (width / near).ln()
            / (strobe.pendulum.damping_rate() * strobe.pendulum.period()).max(LEAST_SHRINKING);
        let mut elsewhere = None;
        for _ in 0..RETURNS + (PATIENCE * shrinking) as usize / RETURNS {
            strobe.advance(&mut edges, RETURNS);
            let far = edges.iter().map(|state| self.distance(state));
            let far = far.filter(|distance| distance.is_nan() || *distance >= near);
            elsewhere = far.min_by(f64::total_cmp);
            elsewhere?;
        }
        elsewhere
    }
}

/// `g` from states on the curve; `None` if they do not form a single-valued closed curve.
fn tabulate(states: &[State]) -> Option<Vec<f64>> {
    let mut sorted: Vec<State> = states.iter().map(|s| [wrapped(s[0]), s[1]]).collect();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (first, last) = (*sorted.first()?, *sorted.last()?);
    sorted.push([first[0] + TAU, first[1]]);
    sorted.insert(0, [last[0] - TAU, last[1]]);
    let smooth = sorted.windows(2).all(|s| {
        let (gap, jump) = (s[1][0] - s[0][0], (s[1][1] - s[0][1]).abs());
        gap < 0.2 && jump < 0.02 + 8.0 * gap
    });
    if !smooth {
        return None;
    }
    let value = |at: f64| {
        let i = sorted.partition_point(|s| s[0] <= at).clamp(1, sorted.len() - 1);
        let (a, b) = (sorted[i - 1], sorted[i]);
        let part = if b[0] > a[0] { (at - a[0]) / (b[0] - a[0]) } else { 0.0 };
        a[1] + part * (b[1] - a[1])
    };
    Some(
        (0..BAND_CELLS)
            .map(|i| value(TAU * ((i as f64 + 0.5) / BAND_CELLS as f64 - 0.5)))
            .collect(),
    )
}
