//! Cubic interpolation of a function over a piece of a trajectory.

/// Steps of Newton's method on the cubic.
const POLISHINGS: usize = 3;

/// The velocity over a piece, or a switching function, as a cubic of the time in pieces, from both
/// ends.
pub(super) struct Cubic([f64; 4]);

impl Cubic {
    /// The cubic through the values at both ends and the rates there, over a piece of length `h`.
    pub(super) fn new([u0, u1, b0, b1]: [f64; 4], h: f64) -> Self {
        let (d0, d1, rise) = (b0 * h, b1 * h, u1 - u0);
        Self([u0, d0, 3.0 * rise - 2.0 * d0 - d1, d0 + d1 - 2.0 * rise])
    }

    /// Its value at a part of the piece.
    pub(super) fn at(&self, x: f64) -> f64 {
        let [a, b, c, d] = self.0;
        a + x * (b + x * (c + x * d))
    }

    /// The position of its interior minimum.
    pub(super) fn lowest(&self) -> f64 {
        let [_, b, c, d] = self.0;
        // b + 2 c x + 3 d x^2 = 0 with rising slope, without cancellation.
        let root = (c * c - 3.0 * b * d).max(0.0).sqrt();
        let x = if c >= 0.0 { -b / (c + root) } else { (root - c) / (3.0 * d) };
        if (0.0..=1.0).contains(&x) { x } else { 0.5 }
    }

    /// The zero at which it falls, which exists by its values at the ends: accurate enough to start
    /// Newton's method on the motion itself.
    pub(super) fn zero(&self) -> f64 {
        // After a reversal the beginning is itself a zero, which is divided out.
        let [a, b, c, d] = match self.0 {
            [0.0, b, c, d] => [b, c, d, 0.0],
            whole => whole,
        };
        let (mut low, mut high) = (0.0, 1.0);
        let mut x = a / (a - (a + b + c + d));
        for _ in 0..POLISHINGS {
            let value = a + x * (b + x * (c + x * d));
            if value < 0.0 {
                high = x;
            } else {
                low = x;
            }
            let next = x - value / (b + x * (2.0 * c + 3.0 * d * x));
            x = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        x
    }
}
