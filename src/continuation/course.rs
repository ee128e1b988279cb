//! A curve in the space of a pendulum's parameters, with derivatives.

use crate::error::Error;
use crate::integrate::tangent::Tangent;
use crate::model::spline::Spline;
use crate::model::{Equation, Parameter, Pendulum};

/// A smooth function of the coordinate of a course.
#[derive(Clone, Debug)]
pub enum Law {
    /// `a + b s + c s^2`.
    Quadratic([f64; 3]),
    /// The spline of degree 5 through values at these coordinates, and its derivative.
    Spline {
        /// The coordinates, which rise.
        places: Vec<f64>,
        /// The function and its first derivative.
        splines: Box<[Spline; 2]>,
    },
}

impl Law {
    /// The coordinate itself.
    pub const IDENTITY: Self = Self::Quadratic([0.0, 1.0, 0.0]);

    /// The function through `values` at `places`, which rise: of a polynomial of degree 2 itself, otherwise a
    /// spline of degree 5.
    ///
    /// # Errors
    /// [`Error::Range`] for fewer than two places; of other functions for fewer than six.
    pub fn through(places: &[f64], values: &[f64]) -> Result<Self, Error> {
        let count = places.len().min(values.len());
        let few = |allowed| Error::Range { name: "number of values", value: count as f64, allowed };
        if count < 2 {
            return Err(few("2 or more"));
        }
        let [first, middle, last] = [0, count / 2, count - 1];
        let slope = |a: usize, b: usize| (values[b] - values[a]) / (places[b] - places[a]);
        let bend = if count > 2 {
            (slope(middle, last) - slope(first, middle)) / (places[last] - places[first])
        } else {
            0.0
        };
        // Newton's form about the first and the last place.
        let (x, y) = (places[first], places[last]);
        let rise = slope(first, last);
        let law =
            Self::Quadratic([values[first] - rise * x + bend * x * y, rise - bend * (x + y), bend]);
        let size = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let fits = |(place, value): (&f64, &f64)| (law.at(*place)[0] - value).abs() <= 1e-12 * size;
        if places.iter().zip(values).all(fits) {
            return Ok(law);
        }
        if count < Spline::FEWEST {
            return Err(few("6 or more along a curve"));
        }
        let of = |order| Spline::derivative(places, values, order);
        Ok(Self::Spline { places: places.to_vec(), splines: Box::new([of(0), of(1)]) })
    }

    /// Value and derivative.
    #[must_use]
    pub fn at(&self, s: f64) -> [f64; 2] {
        match self {
            Self::Quadratic([a, b, c]) => [a + s * (b + s * c), b + 2.0 * c * s],
            Self::Spline { places, splines } => {
                let after = places.partition_point(|place| *place <= s);
                let piece = after.clamp(1, places.len() - 1) - 1;
                [0, 1].map(|order| splines[order].at(piece, s - places[piece]))
            }
        }
    }
}

/// Parameters of a pendulum along one coordinate or two, which are their own values where a parameter varies alone.
#[derive(Clone, Debug)]
pub struct Course {
    /// The pendulum; what varies replaces its own.
    pub base: Pendulum,
    /// For each coordinate the parameters and their functions of it; one of both is the product.
    pub axes: Vec<Vec<(Parameter, Law)>>,
}

impl Course {
    /// The course of one parameter.
    #[must_use]
    pub fn of(base: &Pendulum, parameter: Parameter) -> Self {
        Self { base: base.clone(), axes: vec![vec![(parameter, Law::IDENTITY)]] }
    }

    /// The value of a parameter, and its derivative by each coordinate; none if it does not vary.
    fn value(&self, parameter: Parameter, at: &[f64]) -> Option<(f64, [f64; 2])> {
        let mut found = None::<(f64, [f64; 2])>;
        for (k, axis) in self.axes.iter().enumerate() {
            for (_, law) in axis.iter().filter(|(known, _)| *known == parameter) {
                let [value, slope] = law.at(at[k]);
                let (before, slopes) = found.unwrap_or((1.0, [0.0; 2]));
                let mut slopes = slopes.map(|s| s * value);
                slopes[k] += before * slope;
                found = Some((before * value, slopes));
            }
        }
        found
    }

    /// The pendulum at these coordinates.
    #[must_use]
    pub fn pendulum(&self, at: &[f64]) -> Pendulum {
        let mut pendulum = self.base.clone();
        for (parameter, _) in self.axes.iter().flatten() {
            if let Some((value, _)) = self.value(*parameter, at) {
                // Without any drive the period would be another one.
                let still = *parameter == Parameter::P && value == 0.0;
                pendulum.set(*parameter, if still { f64::MIN_POSITIVE } else { value });
            }
        }
        pendulum
    }

    /// Makes a number of each parameter, whose derivatives by the coordinates begin in column 2.
    pub fn number<const N: usize>(
        &self,
        at: &[f64],
    ) -> impl Fn(Parameter, f64) -> Tangent<f64, N> + '_ {
        let at = at.to_vec();
        move |parameter, value| {
            let mut number = Tangent::constant(value);
            if let Some((_, slopes)) = self.value(parameter, &at) {
                for (slope, own) in number.slope.iter_mut().skip(2).zip(slopes) {
                    *slope = own;
                }
            }
            number
        }
    }

    /// The equation at these coordinates over such numbers.
    #[must_use]
    pub fn equation<const N: usize>(&self, at: &[f64]) -> Equation<Tangent<f64, N>> {
        Equation::lift(&self.pendulum(at), self.number::<N>(at))
    }

    /// Whether the strength of a friction varies, which may be 0 on the way.
    #[must_use]
    pub fn varies_friction(&self) -> bool {
        let rubs = |parameter: &Parameter| match parameter {
            Parameter::ThetaR => true,
            Parameter::OfEffect { effect, .. } => self.base.effects[*effect].rubs(),
            _ => false,
        };
        self.axes.iter().flatten().any(|(parameter, _)| rubs(parameter))
    }

    /// # Errors
    /// [`Error::Range`] or [`Error::Parameter`] for the first parameter that is outside its range at these
    /// coordinates; [`Error::NotMappable`] for an effect that no map can have.
    pub fn check(&self, at: &[f64]) -> Result<(), Error> {
        use crate::model::Effect;
        let Pendulum { gamma, drive, torque, theta_r, effects, .. } = self.pendulum(at);
        let mut checked = Pendulum::new(gamma, drive.p, drive.omega, drive.phase, torque)?
            .with_friction(theta_r)?;
        for effect in effects {
            checked = checked.with_effect(Effect::new(effect.kind.clone(), effect.values())?)?;
        }
        checked.check_mappable()
    }
}
