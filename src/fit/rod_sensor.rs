//! A sensor on the rod that does not read the angle: a gyroscope, or an accelerometer.
//!
//! A gyroscope reads `th'`, wherever it sits. An accelerometer at the distance `r` from the pivot
//! does not measure `r th''` but the specific force, acceleration less gravity. Towards positive
//! theta that is `r th'' + g sin th`, towards the pivot `r th'^2 + g cos th`; an axis that is turned
//! by `d` out of the tangential direction reads
//! `r (th'' cos d + th'^2 sin d) + g sin(th + d)`.
//! Where friction jumps with the sense of the motion, `th''` and the reading jump with it, at every
//! turn; a pendulum that is held fast has `th'' = 0` and shows gravity alone. A reading is the mean
//! over an interval of sampling: at a turn within it the jump is shared in proportion, so that the
//! sum of squares has no steps where a turn passes a sample. An acceleration of the pivot, that of a
//! pivot that gives way too, is left out of the reading.

use std::f64::consts::FRAC_1_PI;

use crate::integrate::reference::problem::{OdeProblem, Past};
use crate::integrate::tangent::Number;
use crate::lanes::Work;
use crate::lanes::sine::Fine;

/// The reading of a sensor on the rod: `rate th' + place (th'' cos tilt + th'^2 sin tilt) +
/// gravity sin(th + tilt) + bias`, in any unit that the readings have. A gyroscope has a rate alone,
/// an accelerometer none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodSensor {
    /// The factor on `th'`, time being counted in `1 / w_ref`.
    pub rate: f64,
    /// The factor on `th''`.
    pub place: f64,
    /// The factor on gravity's part; 0 where gravity has been taken out.
    pub gravity: f64,
    /// Its reading at rest without gravity.
    pub bias: f64,
    /// The averaging interval of a reading, in `1 / w_ref`.
    pub interval: f64,
    /// The angle between its axis and the tangential direction, rad.
    pub tilt: f64,
}

impl RodSensor {
    /// The reading in one state; `moving` gives the sense of the motion, the side of a corner, and
    /// the values kept at the last turn; none while friction holds the pendulum. `bias` and `tilt`
    /// are the sensor's, with derivatives.
    pub fn read<N: Number>(
        &self,
        ode: &OdeProblem<N>,
        tau: f64,
        state: [N; 2],
        moving: Option<([f64; 2], Past<N>)>,
        own: [N; 2],
    ) -> N {
        let mut reading = own[0];
        let (sensor, into) = (*self, &mut reading);
        own[0].aside(Reading { sensor, ode, tau, state, moving, own, into });
        reading
    }
    /// Whether all factors are numbers, and the sensor is sensitive to motion.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let all = [self.rate, self.place, self.gravity, self.bias, self.interval, self.tilt];
        all.iter().all(|x| x.is_finite()) && all[..3].iter().any(|factor| *factor != 0.0)
    }
}

/// A reading, in its own function.
struct Reading<'a, N> {
    sensor: RodSensor,
    ode: &'a OdeProblem<N>,
    tau: f64,
    state: [N; 2],
    moving: Option<([f64; 2], Past<N>)>,
    own: [N; 2],
    into: &'a mut N,
}

impl<N: Number> Work for Reading<'_, N> {
    #[inline(always)]
    fn run(self) {
        let RodSensor { rate, place, gravity, .. } = self.sensor;
        let ([theta, velocity], [bias, tilt]) = (self.state, self.own);
        let turning = velocity.scale(rate) + bias;
        if place == 0.0 && gravity == 0.0 {
            *self.into = turning;
            return;
        }
        let leaning = (theta + tilt).scale(FRAC_1_PI).sine::<Fine>().scale(gravity);
        let turned = tilt.scale(FRAC_1_PI);
        let pull = match self.moving {
            Some((signs, past)) => self.mean_acceleration(signs, past),
            None => theta.like(0.0),
        };
        let inward = velocity * velocity * turned.sine::<Fine>();
        let moving = pull.mul_add(turned.cosine::<Fine>(), inward);
        *self.into = moving.scale_add(place, leaning) + turning;
    }
}

impl<N: Number> Reading<'_, N> {
    /// `th''`, with the jump of friction at a turn less than half an interval away shared: the turn
    /// is `|th'| / |th''|` away.
    #[inline(always)]
    fn mean_acceleration(&self, [sense, side]: [f64; 2], past: Past<N>) -> N {
        let (ode, tau, state) = (self.ode, self.tau, self.state);
        let velocity = state[1];
        let here = ode.acceleration(tau, state, [sense, side], past);
        let away = velocity.scale(sense);
        let reach = here.scale((0.5 * self.sensor.interval).copysign(here.value()));
        if !ode.jumps() || away.value() >= reach.value() {
            return here;
        }
        let past = ode.turned(state[0], sense, past);
        let mut there = ode.acceleration(tau, state, [-sense, side], past);
        // Before a turn the pull is against the motion; where it would be so after it, too, friction
        // holds the pendulum.
        if here.value() * sense < 0.0 && there.value() * sense >= 0.0 {
            there = here.like(0.0);
        }
        let share = (away / reach).affine(-0.5, 0.5);
        (there - here).mul_add(share, here)
    }
}
