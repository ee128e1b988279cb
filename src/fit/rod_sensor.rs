//! A gyroscope on the rod, which reads `th'` wherever it sits.

use crate::integrate::tangent::Number;

/// The reading of a gyroscope: `rate th' + bias`, in any unit that the readings have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodSensor {
    /// The factor on `th'`, time being counted in `1 / w_ref`.
    pub rate: f64,
    /// Its reading at rest.
    pub bias: f64,
}

impl RodSensor {
    /// The reading at a velocity; `bias` is the sensor's, with derivatives.
    pub fn read<N: Number>(&self, velocity: N, bias: N) -> N {
        velocity.scale(self.rate) + bias
    }

    /// Whether both are numbers, and the sensor is sensitive to motion.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.rate.is_finite() && self.bias.is_finite() && self.rate != 0.0
    }
}
