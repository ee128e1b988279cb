//! Uncertain starts: those whose attractor changes within a given distance.

use std::f64::consts::{LN_2, TAU};

use super::boundary_distance::{Nearness, Thinned};
use super::label::UNDECIDED;
use super::starts::Axis;
use crate::error::Error;
use crate::integrate::State;

/// Distances are powers of two of the window's sides, from the first to the last exponent. Greater
/// distances cross several strips of a basin at once, where the power law does not hold yet.
const SCALES: [i32; 2] = [-6, -26];
/// First exponent where a short and smooth boundary leaves fewer distances than `LEAST_SCALES`.
const WIDEST: i32 = -4;
const LEAST_SCALES: usize = 5;
/// Number of starts at every other distance in the pilot.
const PILOT: usize = 512;
/// Target number of uncertain starts for each distance.
const AIM: f64 = 600.0;
/// Least and largest number of starts for a distance.
const STARTS: [f64; 2] = [200.0, 16_000.0];
/// Number of uncertain starts in the pilot that determine the share.
const LEAST_TELLING: usize = 3;
/// Least expected number of uncertain starts for a distance to be used.
const LEAST_UNCERTAIN: f64 = 40.0;
/// Number of labels: the least, the multiple of the cells of the map, and the most.
const LABELS: [f64; 3] = [30_000.0, 0.125, 150_000.0];
/// Standard error of the exponent above which the largest number of labels is used.
const ERROR: f64 = 0.015;
/// Part of the starts of the pilot that is drawn where the map shows a change within the distance.
const PILOT_NEAR: f64 = 0.5;
/// That part after a pilot without uncertain starts elsewhere.
const NEAR: f64 = 0.9;
/// Labels of a start: its own and one on either side.
const SIDES: usize = 3;

/// Numbers of uncertain starts, whose label differs from that of a start at a distance `eps`, on
/// one side or on the other, in a direction drawn at random for each (Grebogi, `McDonald`, Ott &
/// Yorke 1983, Physics Letters A 99, 415).
///
/// Starts are drawn anew for each distance, so the counts are independent. Those with an unknown
/// label, their own or a neighbour's, are left out. If the pilot meets uncertain starts only in
/// cells from which the map shows a change of label within the distance, most starts are drawn
/// there, the others elsewhere, and both are weighted by their shares of the map (stratified
/// sampling): the counts are those of uniformly drawn starts that would give the share with the
/// same precision.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Uncertainty {
    /// Distances, in sides of the window, decreasing.
    pub eps: Vec<f64>,
    /// Uncertain starts.
    pub uncertain: Vec<u64>,
    /// Starts with known ends.
    pub tried: Vec<u64>,
}

/// The shares of uncertain starts in a window of angle and velocity with this map; `label` labels
/// starts.
///
/// A pilot determines the distances at which enough starts are uncertain, and the number of starts
/// that each needs; it is not included in the counts. Empty if it meets no boundary.
///
/// # Errors
/// Errors of `label`.
pub fn uncertainty(
    window: [&Axis; 2],
    map: &Thinned,
    seed: u64,
    mut label: impl FnMut(Vec<State>) -> Result<Vec<i16>, Error>,
) -> Result<Uncertainty, Error> {
    let near = Nearness::new(map);
    let mut draw = Draw { state: seed };
    let mut counted = |plan: &[(i32, usize)], part: f64| -> Result<Vec<Counts>, Error> {
        let mut states = Vec::new();
        let mut counts = Vec::new();
        for (scale, starts) in plan {
            let eps = 2_f64.powi(*scale);
            let mut count = Counts::planned(near.reached(eps), near.count(), *starts, part);
            for stratum in &mut count.strata {
                for _ in 0..stratum.drawn {
                    let rank = stratum.first + (draw.next() * stratum.cells as f64) as usize;
                    let last = stratum.first + stratum.cells - 1;
                    let part = [draw.next(), draw.next()];
                    let at = near.place(rank.min(last), part);
                    states.extend(draw.around(window, at, eps));
                }
            }
            counts.push(count);
        }
        let labels = label(states)?;
        let mut all = labels.chunks_exact(SIDES);
        for stratum in counts.iter_mut().flat_map(|count| &mut count.strata) {
            for near in
                all.by_ref().take(stratum.drawn).filter(|near| near.iter().all(|l| *l > UNDECIDED))
            {
                stratum.uncertain += usize::from(near.iter().any(|l| *l != near[0]));
                stratum.known += 1;
            }
        }
        Ok(counts)
    };
    let labels = (LABELS[1] * map.labels.len() as f64).clamp(LABELS[0], LABELS[2]);
    let mut planned = |widest: i32| -> Result<(Vec<(i32, usize)>, f64), Error> {
        let pilot: Vec<(i32, usize)> =
            (SCALES[1]..=widest).rev().step_by(2).map(|scale| (scale, PILOT)).collect();
        let seen = counted(&pilot, PILOT_NEAR)?;
        let part = if seen.iter().any(Counts::astray) { 0.0 } else { NEAR };
        Ok((plan(&pilot, &seen, part, labels), part))
    };
    let (mut plan, mut part) = planned(SCALES[0])?;
    if plan.len() < LEAST_SCALES {
        (plan, part) = planned(WIDEST)?;
    }
    let counts: Vec<[u64; 2]> = counted(&plan, part)?.iter().map(Counts::even).collect();
    Ok(Uncertainty {
        eps: plan.iter().map(|(scale, _)| 2_f64.powi(*scale)).collect(),
        uncertain: counts.iter().map(|c| c[0]).collect(),
        tried: counts.iter().map(|c| c[1]).collect(),
    })
}

/// Starts drawn from some cells of a map, and their results.
#[derive(Clone, Copy, Debug)]
struct Stratum {
    first: usize,
    cells: usize,
    drawn: usize,
    known: usize,
    uncertain: usize,
}

/// The starts of one distance.
#[derive(Clone, Debug)]
struct Counts {
    strata: Vec<Stratum>,
}

impl Counts {
    /// Draws `starts`, this part at least from the first `near` of `cells`; all from all where it is 0.
    fn planned(near: usize, cells: usize, starts: usize, part: f64) -> Self {
        let stratum = |first, cells, drawn| Stratum { first, cells, drawn, known: 0, uncertain: 0 };
        if part == 0.0 || near == cells {
            return Self { strata: vec![stratum(0, cells, starts)] };
        }
        let share = (near as f64 / cells as f64).max(part);
        let first = (share * starts as f64) as usize;
        // One elsewhere at least: without it the share would be that of the first cells.
        let first = first.min(starts - 1);
        Self { strata: vec![stratum(0, near, first), stratum(near, cells - near, starts - first)] }
    }

    /// Whether a start was uncertain elsewhere than in the first cells.
    fn astray(&self) -> bool {
        self.strata.iter().skip(1).any(|s| s.uncertain > 0)
    }

    /// The share of starts with known ends that are uncertain, and its variance.
    fn share(&self) -> (f64, f64) {
        let cells: usize = self.strata.iter().map(|s| s.cells).sum();
        let weight = |s: &Stratum| s.cells as f64 / cells as f64;
        let sum = |of: fn(&Stratum) -> usize| -> f64 {
            self.strata.iter().map(|s| weight(s) * of(s) as f64 / s.drawn as f64).sum()
        };
        let known = sum(|s| s.known);
        let share = sum(|s| s.uncertain) / known;
        // Of the ratio of two means, to first order.
        let variance = |s: &Stratum| {
            let [hit, known] = [s.uncertain, s.known].map(|n| n as f64 / s.drawn as f64);
            let mean = hit - share * known;
            let square = hit * (1.0 - 2.0 * share) + share * share * known;
            weight(s).powi(2) * (square - mean * mean) / s.drawn as f64
        };
        (share, self.strata.iter().map(variance).sum::<f64>() / (known * known))
    }

    fn uncertain(&self) -> usize {
        self.strata.iter().map(|s| s.uncertain).sum()
    }

    /// Starts that one uncertain start takes where this part is drawn from the first cells.
    fn price(&self, part: f64) -> f64 {
        let (near, cells) = (&self.strata[0], self.strata.iter().map(|s| s.cells).sum::<usize>());
        let rate = near.uncertain as f64 / near.drawn.max(1) as f64;
        let even = || 1.0 / self.share().0;
        if part == 0.0 { even() } else { 1.0 / (rate * part.max(near.cells as f64 / cells as f64)) }
    }

    /// Uncertain starts and starts, of those drawn evenly that tell the share as precisely.
    fn even(&self) -> [u64; 2] {
        let (share, variance) = self.share();
        if self.uncertain() == 0 || variance <= 0.0 {
            return [self.uncertain() as u64, self.strata.iter().map(|s| s.known as u64).sum()];
        }
        let uncertain = (share * share * (1.0 - share) / variance).round().max(1.0);
        [uncertain as u64, (uncertain / share).round() as u64]
    }
}

/// Distances, and starts for each, from the pilot's counts: the first of the usable distances, in
/// the number that minimises the error of the exponent.
fn plan(pilot: &[(i32, usize)], seen: &[Counts], part: f64, labels: f64) -> Vec<(i32, usize)> {
    let told = seen.iter().take_while(|c| c.uncertain() >= LEAST_TELLING).count();
    if told == 0 {
        return Vec::new();
    }
    let mut prices: Vec<f64> = Vec::new();
    for k in 0..told {
        prices.push(seen[k].price(part));
        if k + 1 < told {
            prices.push((seen[k].price(part) * seen[k + 1].price(part)).sqrt());
        }
    }
    // Beyond the distances of the pilot the share may fall as on a smooth boundary.
    let last = prices[prices.len() - 1];
    prices.extend((1..SCALES[0] - SCALES[1]).map(|k| last * 2_f64.powi(k)));
    let all = (pilot[0].0 - SCALES[1]) as usize + 1;
    let enough = |price: &f64| STARTS[1] >= LEAST_UNCERTAIN * price;
    let count = prices.iter().take(all).take_while(|price| enough(price)).count();
    let starts = |count: usize, labels: f64| -> Vec<f64> {
        let wanted = prices[..count].iter().map(|price| (AIM * price).clamp(STARTS[0], STARTS[1]));
        let wanted: Vec<f64> = wanted.collect();
        let part = (labels / SIDES as f64 / wanted.iter().sum::<f64>()).min(1.0);
        wanted.iter().map(|starts| part * starts).collect()
    };
    // The error of a line's slope through independent points, an octave apart.
    let error = |count: usize, labels: f64| {
        let starts = starts(count, labels);
        let weights: Vec<f64> = starts.iter().zip(&prices).map(|(n, p)| n / p).collect();
        let moment = |power: i32| -> f64 {
            weights.iter().enumerate().map(|(k, w)| w * (k as f64).powi(power)).sum()
        };
        LN_2.recip() / (moment(2) - moment(1).powi(2) / moment(0)).sqrt()
    };
    let best = |labels: f64| {
        (LEAST_SCALES.min(count)..=count)
            .min_by(|a, b| error(*a, labels).total_cmp(&error(*b, labels)))
            .unwrap_or(0)
    };
    let more = (error(best(labels), labels) / ERROR).powi(2).max(1.0);
    let labels = (more * labels).min(LABELS[2]);
    let starts = starts(best(labels), labels);
    let scales = (0..).map(|k| pilot[0].0 - k);
    let rounded = starts.into_iter().map(|starts| starts.ceil() as usize);
    scales.zip(rounded).collect()
}

/// Random numbers by `SplitMix64` (Steele, Lea & Flood 2014, OOPSLA): the same on every machine.
struct Draw {
    state: u64,
}

impl Draw {
    /// Between 0 and 1.
    fn next(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    }

    /// The start at a place in the window, in its sides, and those at a distance `eps` on either side.
    fn around(&mut self, window: [&Axis; 2], at: [f64; 2], eps: f64) -> [State; SIDES] {
        let angle = TAU * self.next();
        let away = [eps * angle.cos(), eps * angle.sin()];
        [0.0, 1.0, -1.0].map(|side| {
            let part = |k: usize| {
                let Axis { low, high, .. } = window[k];
                low + (high - low) * (at[k] + side * away[k])
            };
            [part(0), part(1)]
        })
    }
}
