//! The library of effects, as Python sees it.

use pendmap::model::Kind;
use pendmap::model::effects::{Definition as Of, Parameter as OfParameter, Power, Role};
use pyo3::prelude::*;

use super::model::GivenFormula;
use super::raise;

/// An effect, as a dictionary.
#[derive(IntoPyObject)]
pub struct Definition {
    name: String,
    group: &'static str,
    family: &'static str,
    formula: String,
    revealed_by: String,
    mappable: &'static str,
    parameters: Vec<Parameter>,
}

/// A parameter of an effect, as a dictionary.
#[derive(IntoPyObject)]
struct Parameter {
    name: String,
    role: &'static str,
    unit: String,
    power_of_w0: Number,
    /// The parameter whose value is subtracted from the power.
    power_of_w0_less: Option<String>,
    range: [f64; 2],
    typical: [f64; 2],
    meaning: String,
}

/// A whole number, or any.
#[derive(IntoPyObject)]
enum Number {
    Whole(i32),
    Real(f64),
}

impl From<Of<'_>> for Definition {
    fn from(own: Of<'_>) -> Self {
        let parameter = |parameter: OfParameter| {
            let (power_of_w0, less) = match parameter.power {
                Power::Of(power) => (Number::Whole(power), None),
                Power::Real(power) => (Number::Real(power), None),
                Power::TwoMinus(place) => {
                    (Number::Whole(2), Some(own.parameters.at(place).name.to_owned()))
                }
            };
            Parameter {
                name: parameter.name.to_owned(),
                role: parameter.role.words(),
                unit: parameter.unit.to_owned(),
                power_of_w0,
                power_of_w0_less: less,
                range: parameter.range,
                typical: parameter.typical,
                meaning: parameter.meaning.to_owned(),
            }
        };
        Self {
            name: own.name.to_owned(),
            group: own.group.word(),
            family: own.family.words(),
            formula: own.formula.to_owned(),
            revealed_by: own.revealed_by.to_owned(),
            mappable: own.mappable.word(),
            parameters: own.parameters.iter().map(parameter).collect(),
        }
    }
}

/// The definitions of all effects.
#[pyfunction]
pub fn effects() -> Vec<Definition> {
    Kind::ALL.iter().map(|kind| kind.definition().into()).collect()
}

/// The roles that a parameter may have.
#[pyfunction]
pub fn roles() -> Vec<&'static str> {
    Role::ALL.into_iter().map(Role::words).collect()
}

/// The definition of a formula, which is checked; and whether it is proportional to its first
/// parameter.
#[pyfunction]
pub fn formula(given: GivenFormula) -> PyResult<(Definition, bool)> {
    let formula = given.formula().map_err(raise)?;
    Ok((formula.definition().into(), formula.is_proportional()))
}
