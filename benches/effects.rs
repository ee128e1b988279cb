//! The cost of each effect: the time of a step of a trajectory with it, relative to that of a step
//! of the fast route at the same number of steps a period; and the time of a period relative to the
//! fast route's, with the steps that each needs for an error of 1e-6.
//!
//! Effects that can be written as a formula are measured as one too, in addition to the library's
//! own.
//!
//! Both are measured alternately, so that other load of the machine affects both; the least of many
//! times is used. `cargo bench --bench effects -- avx512 drag` measures the cases whose names
//! contain these words.

use std::time::Instant;

use pendmap::integrate::accuracy::choose;
use pendmap::integrate::{State, States, Strobe};
use pendmap::lanes::InstructionSet;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::model::effects::{Group, Mappable, Parameter};
use pendmap::model::{Effect, Kind, Pendulum};

#[path = "../tests/rust/effects_as_formulas.rs"]
#[allow(dead_code)] // the tests use more of it
mod effects_as_formulas;

use effects_as_formulas::rewritten;

/// Trajectories: whole bundles on every instruction set.
const COUNT: usize = 6144;
const STEPS: usize = 24;
const PERIODS: usize = 2;
const ROUNDS: usize = 20;
/// The error for which steps are chosen.
const TOL: f64 = 1e-6;

fn sampled() -> Vec<State> {
    let axis = |name, half: f64| Axis::new(name, -half, half, 100).expect("an axis");
    let plane = Starts::Grid { theta: axis("theta", 3.1), velocity: axis("velocity", 3.0) };
    plane.sampled_states(COUNT, 1)
}

/// Nanoseconds of one period of one trajectory.
fn time(strobe: &Strobe) -> f64 {
    let mut states = States::from(sampled().as_slice());
    let begin = Instant::now();
    strobe.advance(&mut states, PERIODS);
    begin.elapsed().as_secs_f64() * 1e9 / (COUNT * PERIODS) as f64
}

/// The least times of two maps, measured alternately.
fn times(one: &Strobe, other: &Strobe) -> [f64; 2] {
    let mut least = [f64::INFINITY; 2];
    for _ in 0..ROUNDS {
        least = [least[0].min(time(one)), least[1].min(time(other))];
    }
    least
}

/// The map with the steps that it needs.
fn chosen(pendulum: &Pendulum, simd: InstructionSet) -> Strobe {
    let starts = sampled();
    choose(pendulum, &starts[..400], TOL, simd).expect("steps").0
}

/// The effect in the middle of its typical range.
fn typical(kind: &Kind) -> Effect {
    let middle = |p: Parameter| {
        let [low, high] = p.typical;
        if p.name == "n" && *kind == Kind::BearingHarmonic { 3.0 } else { f64::midpoint(low, high) }
    };
    let values: Vec<f64> = kind.definition().parameters.iter().map(middle).collect();
    Effect::new(kind.clone(), &values).expect("in range")
}

fn main() {
    let words: Vec<String> =
        std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let wanted = |names: &[&str]| {
        words.iter().all(|word| names.iter().any(|name| name.contains(word.as_str())))
    };
    let base = Pendulum::new(0.0, 1.0, 2.0, 0.0, 0.0).expect("in range");
    let damped = Pendulum { gamma: 0.1, ..base.clone() };
    for simd in InstructionSet::ALL.into_iter().filter(|simd| simd.available()) {
        let fast = Strobe::new(&damped, STEPS, simd);
        println!(
            "{simd}, {STEPS} steps a period  ns a step      over  steps for   period   formula"
        );
        println!(
            "                                         fast simd    {TOL:e}      over      over"
        );
        for kind in Kind::ALL {
            let definition = kind.definition();
            let absent = definition.group == Group::Reading || definition.mappable == Mappable::No;
            if absent || !wanted(&[simd.name(), definition.name]) {
                continue;
            }
            let base = if *kind == Kind::ViscousDamping { &base } else { &damped };
            let mut pendulum = base.clone().with_effect(typical(kind)).expect("once");
            pendulum.lab_time = 100.0;
            let strobe = Strobe::new(&pendulum, STEPS, simd);
            let [own, reference] = times(&strobe, &fast);
            let formula = rewritten(&typical(kind)).map(|effect| {
                let pendulum = base.clone().with_effect(effect).expect("once");
                let pendulum = Pendulum { lab_time: 100.0, ..pendulum };
                let [formula, library] = times(&Strobe::new(&pendulum, STEPS, simd), &strobe);
                format!("{:>9.2}", formula / library)
            });
            let precise = chosen(&pendulum, simd);
            let [period, other] = times(&precise, &chosen(&damped, simd));
            println!(
                "  {:<26} {:>9.2} {:>9.2} {:>9} {:>9.2} {}",
                definition.name,
                own / STEPS as f64,
                own / reference,
                precise.steps(),
                period / other,
                formula.unwrap_or_default()
            );
        }
    }
}
