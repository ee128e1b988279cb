//! The library of effects, as Python sees it.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::model::GivenFormula;
use crate::model::Kind;
use crate::model::effects::{Power, Role};

/// Name, group, family, formula, parameters and the rest of every effect.
#[pyfunction]
pub fn effects(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for &kind in Kind::ALL {
        list.append(entry(py, kind)?)?;
    }
    Ok(list)
}

/// The words for what a parameter may do.
#[pyfunction]
pub fn roles() -> Vec<&'static str> {
    Role::ALL.into_iter().map(Role::words).collect()
}

/// The same of a user's own effect, which is checked; and whether it is proportional to its first
/// parameter.
#[pyfunction]
pub fn formula(py: Python<'_>, given: GivenFormula) -> PyResult<(Bound<'_, PyDict>, bool)> {
    let formula = given.formula()?;
    Ok((entry(py, Kind::Formula(formula))?, formula.is_proportional()))
}

fn entry(py: Python<'_>, kind: Kind) -> PyResult<Bound<'_, PyDict>> {
    let definition = kind.definition();
    let dict = PyDict::new(py);
    dict.set_item("name", definition.name)?;
    dict.set_item("group", definition.group.word())?;
    dict.set_item("family", definition.family.words())?;
    dict.set_item("formula", definition.formula)?;
    dict.set_item("revealed_by", definition.revealed_by)?;
    dict.set_item("mappable", definition.mappable.word())?;
    let parameters = PyList::empty(py);
    for parameter in definition.parameters {
        let entry = PyDict::new(py);
        entry.set_item("name", parameter.name)?;
        entry.set_item("role", parameter.role.words())?;
        entry.set_item("unit", parameter.unit)?;
        // w0 to this power, or to 2 less the value of the parameter of that name.
        let mut exponent = None;
        match parameter.power {
            Power::Of(power) => entry.set_item("power_of_w0", power)?,
            Power::Real(power) => entry.set_item("power_of_w0", power)?,
            Power::TwoMinus(index) => {
                exponent = Some(definition.parameters[index].name);
                entry.set_item("power_of_w0", 2)?;
            }
        }
        entry.set_item("power_of_w0_less", exponent)?;
        entry.set_item("range", parameter.range)?;
        entry.set_item("typical", parameter.typical)?;
        entry.set_item("meaning", parameter.meaning)?;
        parameters.append(entry)?;
    }
    dict.set_item("parameters", parameters)?;
    Ok(dict)
}
