//! Zeros and minima of functions between two places.

/// Iterations at most.
const ITERATIONS: usize = 60;
/// Steps of the golden section.
const SECTIONS: usize = 32;

/// A zero between two places of opposite sign, or of which the first is a zero already passed, by false
/// position with the value at an end that is kept twice halved (the Illinois variant).
pub fn zero(function: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let (mut ends, mut stayed) = ([(low, function(low)), (high, function(high))], None);
    if ends[0].1 * ends[1].1 > 0.0 {
        return low;
    }
    for _ in 0..ITERATIONS {
        let [(a, fa), (b, fb)] = ends;
        let rise = fb - fa;
        let place = if rise == 0.0 { 0.5 * (a + b) } else { (a * fb - b * fa) / rise };
        let here = function(place);
        if here == 0.0 || (b - a).abs() <= 4.0 * f64::EPSILON * (a.abs() + b.abs()) {
            return place;
        }
        let side = usize::from(here * fa < 0.0);
        if (place - ends[side].0).abs() <= f64::EPSILON * place.abs() {
            return place;
        }
        ends[side] = (place, here);
        if stayed == Some(side) {
            ends[1 - side].1 *= 0.5;
        }
        stayed = Some(side);
    }
    0.5 * (ends[0].0 + ends[1].0)
}

/// Whether a function with these values, in the middle its least, may pass zero between them: the parabola
/// through them falls to less than half of it.
#[must_use]
pub fn may_touch([before, here, after]: [f64; 3]) -> bool {
    let [slope, bend] = [0.5 * (after - before), before - 2.0 * here + after];
    here < before && here < after && here - 0.5 * slope * slope / bend <= 0.5 * here
}

/// A place between two at which a function with one minimum there is negative; none if it stays above.
pub fn below(function: impl Fn(f64) -> f64, low: f64, high: f64) -> Option<f64> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (low, high);
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = inner.map(&function);
    for _ in 0..SECTIONS {
        if let Some(k) = (0..2).find(|k| values[*k] < 0.0) {
            return Some(inner[k]);
        }
        if values[0] < values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [function(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], function(inner[1])];
        }
    }
    None
}
