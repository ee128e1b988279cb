//! Effects of the library, written as user formulas.

use pendmap::model::effects::{Parameter, Power};
use pendmap::model::formula::{ParameterSpec, Spec};
use pendmap::model::{Effect, Formula, Kind};

/// The term of an effect whose torque a formula can express.
pub fn term(kind: &Kind) -> Option<&'static str> {
    Some(match kind.definition().name {
        "viscous_damping" => "-gamma*v",
        "coulomb_friction" => "-theta_r*sign(v)",
        "quadratic_drag" => "-q*v*abs(v)",
        "cubic_damping" => "-k3*v^3",
        "power_law_drag" => "-q*abs(v)^n*sign(v)",
        "eddy_brake" => "-b*v/(1 + (v/vc)^2)",
        "stribeck_friction" => "-size*exp(-(v/vs)^2)*sign(v)",
        "load_dependent_friction" => "-k*(abs((1 + a)*cos(theta) + v^2/w0^2) - 1)*sign(v)",
        "asymmetric_viscous" => "-b*abs(v)",
        "coulomb_drift" => "-r*t*sign(v)",
        "viscous_drift" => "-r*t*v",
        "coulomb_warm_up" => "f*(1 - exp(-t/tau))*sign(v)",
        "viscous_warm_up" => "b*(1 - exp(-t/tau))*v",
        "bias_torque" => "torque",
        "bearing_harmonic" => "amplitude*sin(n*theta + psi)",
        "magnet" => "-amplitude*(wrap(theta)/width)*exp(-wrap(theta)^2/(2*width^2))",
        "elastic_restoring" => "-k*theta",
        "natural_frequency_drift" => "-r*t*w0^2*(1 + a)*sin(theta)",
        _ => return None,
    })
}

/// The parameter of a formula with the properties of one of the library.
fn like(parameter: Parameter) -> ParameterSpec {
    let Parameter { name, unit, power, range, typical, meaning, .. } = parameter;
    let (power, less) = match power {
        Power::Of(power) => (f64::from(power), None),
        Power::Real(power) => (power, None),
        Power::TwoMinus(place) => (2.0, Some(place)),
    };
    let name = match name {
        // Names that have another meaning in formulas.
        "a" => "size",
        "phase" => "psi",
        other => other,
    };
    ParameterSpec {
        name: name.to_owned(),
        power,
        less,
        unit: unit.to_owned(),
        range,
        typical,
        meaning: meaning.to_owned(),
        role: None,
    }
}

/// A formula of one parameter with this power of `w0`.
pub fn formula(name: &str, term: &str, parameters: &[(&str, f64)]) -> Spec {
    let parameter = |(name, power): &(&str, f64)| ParameterSpec {
        name: (*name).to_owned(),
        power: *power,
        less: None,
        unit: String::new(),
        range: [f64::NEG_INFINITY, f64::INFINITY],
        typical: [0.01, 0.3],
        meaning: String::new(),
        role: None,
    };
    Spec {
        name: name.to_owned(),
        term: term.to_owned(),
        revealed_by: String::new(),
        parameters: parameters.iter().map(parameter).collect(),
    }
}

/// An effect of the library as a formula with the same parameters, if it can be expressed.
pub fn rewritten(effect: &Effect) -> Option<Effect> {
    let definition = effect.kind.definition();
    let spec = Spec {
        name: format!("own_{}", definition.name),
        term: term(&effect.kind)?.to_owned(),
        revealed_by: String::new(),
        parameters: definition.parameters.iter().map(like).collect(),
    };
    let formula = Formula::new(&spec).unwrap_or_else(|error| panic!("{error}"));
    Some(Effect::new(Kind::Formula(formula), effect.values()).expect("the same ranges"))
}
