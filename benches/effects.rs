//! What each effect costs: the time of a step of a trajectory with it, beside that of a step of the
//! fast path at the same number of steps a period.
//!
//! Both are measured in turns, so that whatever else the machine does meets both; the least of many
//! times counts. `cargo bench --bench effects -- avx512 drag` measures what these words are part of.

use std::time::Instant;

use pendmap::integrate::Strobe;
use pendmap::lanes::Path;
use pendmap::maps::starts::{Axis, Starts};
use pendmap::model::effects::{Action, Parameter};
use pendmap::model::{Effect, Kind, Pendulum};

/// Trajectories: whole bundles on every path.
const COUNT: usize = 6144;
const STEPS: usize = 24;
const PERIODS: usize = 2;
const ROUNDS: usize = 40;

fn columns() -> (Vec<f64>, Vec<f64>) {
    let axis = |name, half: f64| Axis::new(name, -half, half, 100).expect("an axis");
    let plane = Starts::Grid { theta: axis("theta", 3.1), velocity: axis("velocity", 3.0) };
    plane.sampled_states(COUNT, 1).into_iter().map(|s| (s[0], s[1])).unzip()
}

/// Nanoseconds of one step of one trajectory.
fn time(strobe: &Strobe) -> f64 {
    let (mut theta, mut velocity) = columns();
    let mut turns = vec![0.0; COUNT];
    let begin = Instant::now();
    strobe.advance(&mut theta, &mut velocity, &mut turns, PERIODS).expect("equal lengths");
    begin.elapsed().as_secs_f64() * 1e9 / (COUNT * STEPS * PERIODS) as f64
}

/// The effect in the middle of its typical range.
fn typical(kind: Kind) -> Effect {
    let middle = |p: &Parameter| {
        let [low, high] = p.typical;
        if p.name == "n" && kind == Kind::BearingHarmonic { 3.0 } else { f64::midpoint(low, high) }
    };
    let values: Vec<f64> = kind.definition().parameters.iter().map(middle).collect();
    Effect::new(kind, &values).expect("in range")
}

fn main() {
    let words: Vec<String> =
        std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let wanted = |names: &[&str]| {
        words.iter().all(|word| names.iter().any(|name| name.contains(word.as_str())))
    };
    let base = Pendulum::new(0.0, 1.0, 2.0, 0.0, 0.0).expect("in range");
    let damped = Pendulum { gamma: 0.1, ..base.clone() };
    for path in Path::ALL.into_iter().filter(|path| path.available()) {
        let fast = Strobe::new(&damped, STEPS, path);
        println!("{path}, {STEPS} steps a period      ns a step  over the fast path");
        for kind in Kind::ALL {
            let definition = kind.definition();
            if definition.action == Action::Reading || !wanted(&[path.name(), definition.name]) {
                continue;
            }
            let base = if *kind == Kind::ViscousDamping { &base } else { &damped };
            let mut pendulum = base.clone().with_effect(typical(*kind)).expect("once");
            pendulum.lab_time = 100.0;
            let strobe = Strobe::new(&pendulum, STEPS, path);
            let (mut own, mut reference) = (f64::INFINITY, f64::INFINITY);
            for _ in 0..ROUNDS {
                own = own.min(time(&strobe));
                reference = reference.min(time(&fast));
            }
            println!("  {:<26} {own:>9.2} {:>9.2}", definition.name, own / reference);
        }
    }
}
