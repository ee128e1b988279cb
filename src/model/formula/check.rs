//! Checks of a formula's names and terms, with messages that state what is allowed.

use super::tree::{Function, Tree, Variable};
use super::{Spec, parse, probe};
use crate::model::effects::{Kind, MOST_PARAMETERS, Parameter};

fn is_name(name: &str) -> bool {
    let mut characters = name.chars();
    characters.next().is_some_and(|c| c.is_ascii_alphabetic())
        && characters.all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Checks the names, numbers and ranges of a formula's parameters.
///
/// # Errors
/// A message, where a name, a number of parameters or a range is refused.
pub(super) fn names(spec: &Spec) -> Result<(), String> {
    let letters = "a letter, then letters, digits and _";
    if !is_name(&spec.name) {
        return Err(format!("its name must be {letters}"));
    }
    if Kind::named(&spec.name).is_ok() {
        return Err("its name must be another, it is one of the library".to_owned());
    }
    let count = spec.parameters.len();
    if !(1..=MOST_PARAMETERS).contains(&count) {
        return Err(format!(
            "must have 1 to {MOST_PARAMETERS} parameters, got {count}; other numbers may stand in \
             the term"
        ));
    }
    for (k, parameter) in spec.parameters.iter().enumerate() {
        let name = &parameter.name;
        if !is_name(name) {
            return Err(format!("parameter '{name}' must be {letters}"));
        }
        if parse::is_taken(name) {
            return Err(format!("parameter '{name}' must be another, it has a meaning of its own"));
        }
        if spec.parameters[..k].iter().any(|p| p.name == *name) {
            return Err(format!("parameter '{name}' is there twice"));
        }
        let ([low, high], [least, greatest]) = (parameter.typical, parameter.range);
        if !(low < high && low.is_finite() && high.is_finite()) {
            return Err(format!(
                "parameter '{name}': typical must be two numbers, the lower first, got [{low}, \
                 {high}]"
            ));
        }
        if !(least <= low && high <= greatest) {
            return Err(format!(
                "parameter '{name}': range must be one that holds the typical [{low}, {high}], got \
                 [{least}, {greatest}]"
            ));
        }
        if !parameter.power.is_finite() || parameter.less.is_some_and(|p| p >= count || p == k) {
            return Err(format!("parameter '{name}': power is no number"));
        }
    }
    Ok(())
}

/// Checks a term against its parameters.
///
/// # Errors
/// A message, where a term lacks a parameter, jumps, is no finite number or has no balanced units.
pub(super) fn term(tree: &Tree, parameters: &[Parameter]) -> Result<(), String> {
    for (k, parameter) in parameters.iter().enumerate() {
        let used = |tree: &Tree| {
            let mut values: Vec<bool> = vec![false; MOST_PARAMETERS];
            mark(tree, &mut values);
            values[k]
        };
        if !used(tree) {
            return Err(format!("parameter '{}' is not in the term", parameter.name));
        }
    }
    let mut abrupt = false;
    tree.functions(&mut |function, inner| {
        abrupt |= function == Function::Sign && inner.moves() && !inner.is_velocity();
    });
    if abrupt {
        return Err("jumps where what is under sign(...) passes zero: it must be sign(v), or \
                    tanh(x/width) for sign(x)"
            .to_owned());
    }
    if tree.kinks().into_iter().any(|inner| probe::vanishes_at_rest(inner, parameters)) {
        return Err("has a kink where v passes zero that is not one of abs(v): what is under abs(...), \
                    min(...) and max(...) must have v as a factor, as v*(1 + v^2), or not vanish with v"
            .to_owned());
    }
    if let Some((at, values)) = probe::gap(tree, parameters) {
        let given: Vec<String> = parameters
            .iter()
            .zip(&values)
            .map(|(p, value)| format!("{} = {value:.3}", p.name))
            .collect();
        return Err(format!(
            "is no finite number at theta = {:.3}, v = {:.3}, {} (without dimensions)",
            at.theta,
            at.velocity,
            given.join(", ")
        ));
    }
    probe::balances(tree, parameters).map_err(|power| {
        let unit = "the term is an acceleration in rad/s^2, v a velocity, t a time";
        match power {
            Some(power) => format!(
                "its units do not balance: {unit}; '{}' must have power = {power}",
                parameters[0].name
            ),
            None => format!(
                "its units do not balance: {unit}; the powers of w0 of its parameters are wrong, or \
                 a w0 is missing"
            ),
        }
    })
}

/// Marks the parameters that occur in a tree.
fn mark(tree: &Tree, used: &mut [bool]) {
    match tree {
        Tree::Variable(Variable::Parameter(place)) => used[*place] = true,
        Tree::Number(_) | Tree::Variable(_) => {}
        Tree::Apply(_, inner) => mark(inner, used),
        Tree::Join(_, left, right) => {
            mark(left, used);
            mark(right, used);
        }
    }
}
