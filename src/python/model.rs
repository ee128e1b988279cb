//! A model as Python passes it: a `pendmap.Pendulum`, read by its attributes.

use std::sync::Arc;

use pendmap::error::Error;
use pendmap::maps::parameter_map::Range;
use pendmap::model::effects::Role;
use pendmap::model::formula::{ParameterSpec, Spec};
use pendmap::model::{Effect, Formula, Kind, Pendulum};
use pyo3::prelude::*;

use super::raise;

/// A pendulum, nondimensional.
#[derive(FromPyObject)]
pub struct Model {
    gamma: f64,
    p: f64,
    omega: f64,
    phase: f64,
    torque: f64,
    theta_r: f64,
    lab_time: f64,
    effects: Vec<GivenEffect>,
}

/// An effect with values for its parameters, in the definition's order.
#[derive(FromPyObject)]
struct GivenEffect {
    name: String,
    values: Vec<f64>,
    formula: Option<OwnFormula>,
}

/// A `pendmap.Formula`.
#[derive(FromPyObject)]
struct OwnFormula {
    key: GivenFormula,
}

/// A formula of the user.
#[derive(FromPyObject)]
pub struct GivenFormula {
    name: String,
    term: String,
    revealed_by: String,
    parameters: Vec<GivenParameter>,
}

/// A parameter of a formula; `less` is the place of the parameter whose value is subtracted from the
/// power of `w0`.
#[derive(FromPyObject)]
struct GivenParameter {
    name: String,
    power: f64,
    less: Option<usize>,
    unit: String,
    range: [f64; 2],
    typical: [f64; 2],
    meaning: String,
    role: Option<String>,
}

impl Model {
    /// The pendulum, its numbers and effects checked.
    pub fn pendulum(self) -> PyResult<Pendulum> {
        self.checked().map_err(raise)
    }

    fn checked(self) -> Result<Pendulum, Error> {
        let Self { gamma, p, omega, phase, torque, theta_r, lab_time, effects } = self;
        let mut pendulum = Pendulum::new(gamma, p, omega, phase, torque)?.with_friction(theta_r)?;
        pendulum.lab_time = lab_time;
        for GivenEffect { name, values, formula } in effects {
            let kind = match formula {
                Some(own) => Kind::Formula(own.key.formula()?),
                None => Kind::named(&name)?,
            };
            pendulum = pendulum.with_effect(Effect::new(kind, &values)?)?;
        }
        Ok(pendulum)
    }
}

impl GivenFormula {
    /// The formula, checked.
    pub fn formula(self) -> Result<Arc<Formula>, Error> {
        let Self { name, term, revealed_by, parameters } = self;
        let parameters = parameters.into_iter().map(GivenParameter::spec).collect();
        Formula::new(&Spec { name, term, revealed_by, parameters })
    }
}

impl GivenParameter {
    fn spec(self) -> ParameterSpec {
        let Self { name, power, less, unit, range, typical, meaning, role } = self;
        let role = Role::ALL.into_iter().find(|known| Some(known.words()) == role.as_deref());
        ParameterSpec { name, power, less, unit, range, typical, meaning, role }
    }
}

/// The range of parameters of a pendulum, each with as many values.
pub fn range(pendulum: &Pendulum, along: Vec<(String, Vec<f64>)>) -> PyResult<Range> {
    let one = |(name, values): (String, Vec<f64>)| Ok((pendulum.parameter(&name)?, values));
    let parameters =
        along.into_iter().map(one).collect::<Result<Vec<_>, Error>>().map_err(raise)?;
    let found = Range { parameters };
    let uneven = found.parameters.iter().find(|(_, values)| values.len() != found.places());
    if let Some((_, values)) = uneven {
        let (value, allowed) = (values.len() as f64, "the same for all parameters of an axis");
        return Err(raise(Error::Range { name: "number of values", value, allowed }));
    }
    Ok(found)
}
