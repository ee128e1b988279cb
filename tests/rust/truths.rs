//! The reference values of `tests/truths.json`, read once.

use std::sync::OnceLock;

use pendmap::integrate::State;
use pendmap::model::Pendulum;
use serde_json::Value;

use crate::support::driven;

/// The whole file.
pub fn truths() -> &'static Value {
    static FILE: OnceLock<Value> = OnceLock::new();
    FILE.get_or_init(|| serde_json::from_str(include_str!("../truths.json")).expect("JSON"))
}

/// A number, written as such or as a string of more digits.
pub fn number(value: &Value) -> f64 {
    match value {
        Value::String(digits) => digits.parse().expect("digits"),
        other => other.as_f64().unwrap_or_else(|| panic!("{other} is no number")),
    }
}

/// A list of numbers.
pub fn numbers(value: &Value) -> Vec<f64> {
    list(value).iter().map(number).collect()
}

/// The entries of a list.
pub fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

/// The entries of a table.
pub fn table(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().expect("a table").iter()
}

fn state(value: &Value) -> State {
    [number(&value[0]), number(&value[1])]
}

/// A stable periodic orbit.
pub struct Known {
    /// The model.
    pub pendulum: Pendulum,
    /// "oscillation" or "rotation".
    pub kind: String,
    /// Period.
    pub n: usize,
    /// Net turns over it.
    pub w: i64,
    /// Its points, in order.
    pub points: Vec<State>,
    /// Multipliers as real and imaginary part.
    pub multipliers: [[f64; 2]; 2],
}

/// All known attractors.
pub fn attractors() -> Vec<Known> {
    list(&truths()["attractors"])
        .iter()
        .map(|a| Known {
            pendulum: model(a),
            kind: a["kind"].as_str().expect("a word").to_owned(),
            n: number(&a["n"]) as usize,
            w: number(&a["winding"]) as i64,
            points: list(&a["points"]).iter().map(state).collect(),
            multipliers: [state(&a["mult"][0]), state(&a["mult"][1])],
        })
        .collect()
}

/// The known attractors at this `p` (omega = 2, gamma = 0.1).
pub fn attractors_at(p: f64) -> Vec<Known> {
    attractors().into_iter().filter(|a| (a.pendulum.drive.p - p).abs() < 1e-12).collect()
}

/// How the cells of the reference grid are shared out: (n, w, theta) and the fraction of each.
pub fn fractions_at(p: f64) -> Vec<((usize, i64, f64), f64)> {
    let entry = list(&truths()["basin_counts_100x100"])
        .iter()
        .find(|entry| (number(&entry["p"]) - p).abs() < 1e-12)
        .unwrap_or_else(|| panic!("no counts at p = {p}"));
    let cells = number(&entry["grid"]).powi(2);
    table(&entry["counts_after_long"])
        .map(|(key, count)| {
            let part: Vec<f64> =
                key.trim_matches(['(', ')']).split(", ").map(|x| x.parse().expect(key)).collect();
            ((part[0] as usize, part[1] as i64, part[2]), number(count) / cells)
        })
        .collect()
}

/// The model of an entry that has gamma, p and omega.
pub fn model(entry: &Value) -> Pendulum {
    driven(number(&entry["gamma"]), number(&entry["p"]), number(&entry["omega"]))
}
