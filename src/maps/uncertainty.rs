//! How far a start must be known for its end to be known.

use std::f64::consts::TAU;

use super::label::UNDECIDED;
use super::starts::Axis;
use crate::error::Error;
use crate::integrate::State;

/// Distances are powers of two of the window's sides, from the first to the last exponent. Greater
/// ones see several strips of a basin at once, where the law has not begun; ...
const SCALES: [i32; 2] = [-6, -26];
/// ... they are taken where a short and smooth boundary leaves fewer distances than `LEAST_SCALES`.
const WIDEST: i32 = -4;
const LEAST_SCALES: usize = 5;
/// Starts at every other distance that say how many each takes.
const PILOT: usize = 512;
/// Uncertain starts that are aimed at for each distance.
const AIM: f64 = 600.0;
/// Starts a distance, at least and at most.
const STARTS: [f64; 2] = [200.0, 16_000.0];
/// Uncertain starts in the pilot that tell the share.
const LEAST_TELLING: usize = 3;
/// A distance at which fewer are expected from the most starts says too little.
const LEAST_UNCERTAIN: f64 = 40.0;
/// Labels in all: at least, over the cells of the map, and at most.
const LABELS: [f64; 3] = [30_000.0, 0.125, 150_000.0];
/// Labels of a start: its own and one on either side.
const SIDES: usize = 3;

/// How many starts are uncertain: some of them have another label than a start at a distance `eps`,
/// on one side or on the other, in a direction drawn at random for each (Grebogi, `McDonald`, Ott &
/// Yorke 1983, Physics Letters A 99, 415).
///
/// Starts are drawn anew for each distance, so the counts are independent and binomial. Those with an
/// end that is not known, own or beside, are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Uncertainty {
    /// Distances, in sides of the window, falling.
    pub eps: Vec<f64>,
    /// Uncertain starts.
    pub uncertain: Vec<u64>,
    /// Starts with known ends.
    pub tried: Vec<u64>,
}

/// The shares of uncertain starts in a window of angle and velocity, by what `label` says of starts.
///
/// A pilot says at which distances enough starts are uncertain, and how many each needs; it is not
/// counted. Empty where no boundary was met.
///
/// # Errors
/// Whatever `label` meets.
pub fn uncertainty(
    window: [&Axis; 2],
    seed: u64,
    mut label: impl FnMut(Vec<State>) -> Result<Vec<i16>, Error>,
) -> Result<Uncertainty, Error> {
    let mut draw = Draw { state: seed };
    let mut counted = |plan: &[(i32, usize)]| -> Result<Vec<[u64; 2]>, Error> {
        let mut states = Vec::new();
        for (scale, starts) in plan {
            for _ in 0..*starts {
                states.extend(draw.around(window, 2_f64.powi(*scale)));
            }
        }
        let labels = label(states)?;
        let mut all = labels.chunks_exact(SIDES);
        let mut counts = Vec::new();
        for (_, starts) in plan {
            let mut count = [0; 2];
            for near in
                all.by_ref().take(*starts).filter(|near| near.iter().all(|l| *l > UNDECIDED))
            {
                count[0] += u64::from(near.iter().any(|l| *l != near[0]));
                count[1] += 1;
            }
            counts.push(count);
        }
        Ok(counts)
    };
    let cells = (window[0].count * window[1].count) as f64;
    let labels = (LABELS[1] * cells).clamp(LABELS[0], LABELS[2]);
    let mut planned = |widest: i32| -> Result<Vec<(i32, usize)>, Error> {
        let pilot: Vec<(i32, usize)> =
            (SCALES[1]..=widest).rev().step_by(2).map(|scale| (scale, PILOT)).collect();
        let seen = counted(&pilot)?;
        Ok(plan(&pilot, &seen, labels))
    };
    let mut plan = planned(SCALES[0])?;
    if plan.len() < LEAST_SCALES {
        plan = planned(WIDEST)?;
    }
    let counts = counted(&plan)?;
    Ok(Uncertainty {
        eps: plan.iter().map(|(scale, _)| 2_f64.powi(*scale)).collect(),
        uncertain: counts.iter().map(|c| c[0]).collect(),
        tried: counts.iter().map(|c| c[1]).collect(),
    })
}

/// Distances, and starts for each, from the pilot's counts.
fn plan(pilot: &[(i32, usize)], seen: &[[u64; 2]], labels: f64) -> Vec<(i32, usize)> {
    let told = seen.iter().take_while(|c| c[0] as usize >= LEAST_TELLING).count();
    if told == 0 {
        return Vec::new();
    }
    let share = |k: usize| seen[k][0] as f64 / seen[k][1].max(1) as f64;
    let mut wanted: Vec<(i32, f64)> = Vec::new();
    let mut add = |scale: i32, share: f64| {
        let enough = share * STARTS[1] >= LEAST_UNCERTAIN && scale >= SCALES[1];
        if enough {
            wanted.push((scale, (AIM / share).clamp(STARTS[0], STARTS[1])));
        }
        enough
    };
    for (k, (scale, _)) in pilot.iter().take(told).enumerate() {
        add(*scale, share(k));
        if k + 1 < told {
            add(scale - 1, (share(k) * share(k + 1)).sqrt());
        }
    }
    // Beyond what the pilot tells the share may fall as on a smooth boundary.
    let (mut scale, mut expected) = (pilot[told - 1].0 - 1, 0.5 * share(told - 1));
    while add(scale, expected) {
        (scale, expected) = (scale - 1, 0.5 * expected);
    }
    let all: f64 = SIDES as f64 * wanted.iter().map(|(_, starts)| starts).sum::<f64>();
    let part = (labels / all).min(1.0);
    wanted.into_iter().map(|(scale, starts)| (scale, (part * starts).ceil() as usize)).collect()
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

    /// A start anywhere in the window, and those at a distance `eps` on either side of it.
    fn around(&mut self, window: [&Axis; 2], eps: f64) -> [State; SIDES] {
        let (at, angle) = ([self.next(), self.next()], TAU * self.next());
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
