//! Hill's determinant: critical amplitudes of rest, without any integrator.
//!
//! A solution of `th'' + gamma th' + s (1 + p cos(omega tau)) th = 0` with the multiplier 1 or -1 is a sum of harmonics of
//! the frequencies `k omega` or `(k + 1/2) omega`. Each couples to its neighbours alone, so that the condition is that a
//! tridiagonal determinant vanishes (Magnus & Winkler 1966, Hill's equation, section 2.3).

use nalgebra::Complex;

/// Harmonics on either side.
const HARMONICS: i32 = 60;
/// Places at which a sign is looked at.
const PLACES: usize = 6000;

fn determinant([gamma, omega, side]: [f64; 3], multiplier: f64, p: f64) -> f64 {
    let odd = multiplier < 0.0;
    let shift = if odd { 0.5 } else { 0.0 };
    let last = HARMONICS - i32::from(odd);
    let (mut before, mut here) = (Complex::new(0.0, 0.0), Complex::new(1.0, 0.0));
    let mut size = 1.0;
    for k in -HARMONICS..=last {
        let rate = (f64::from(k) + shift) * omega;
        let own = 1.0 + rate * rate;
        let diagonal = Complex::new(side - rate * rate, gamma * rate) / own;
        let next = diagonal * here - before * ((0.5 * p).powi(2) / (own * size));
        (before, here, size) = (here, next, own);
    }
    here.re
}

/// All critical amplitudes of hanging rest, `side` 1, or inverted rest, -1, up to `p_max`: amplitude and multiplier.
pub fn critical(gamma: f64, omega: f64, side: f64, p_max: f64) -> Vec<(f64, f64)> {
    let mut all = Vec::new();
    for multiplier in [1.0, -1.0] {
        let at = |p: f64| determinant([gamma, omega, side], multiplier, p);
        let place = |i: usize| p_max * (i as f64 + 0.01) / PLACES as f64;
        for i in 0..PLACES {
            let (mut low, mut high) = (place(i), place(i + 1).min(p_max));
            if at(low) * at(high) > 0.0 {
                continue;
            }
            while high - low > 4.0 * f64::EPSILON * high {
                let middle = 0.5 * (low + high);
                if at(low) * at(middle) > 0.0 { low = middle } else { high = middle }
            }
            all.push((0.5 * (low + high), multiplier));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}
