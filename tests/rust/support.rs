//! Shared helpers: instruction sets, pendulums, starts that cover a plane, whole maps.

use std::f64::consts::PI;
use std::marker::PhantomData;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use pendmap::attractor::{Catalogue, Effort};
use pendmap::integrate::accuracy::choose;
use pendmap::integrate::{Moving, Schedule, State, States, Strobe};
use pendmap::lanes::sine::Fine;
use pendmap::lanes::{InstructionSet, Isa, Job, Lane, dispatch};
use pendmap::maps::basins::{BasinMap, Options, basins};
use pendmap::maps::control::{Control, pool};
use pendmap::maps::label::{Labels, label};
use pendmap::maps::starts::{Axis, Starts};
use pendmap::model::Pendulum;

/// The instruction sets of this processor, fastest first.
pub fn instruction_sets() -> Vec<InstructionSet> {
    InstructionSet::ALL.into_iter().filter(|simd| simd.available()).collect()
}

/// The instruction set of a map: the fastest, or the one named by `PENDMAP_SIMD`.
pub fn simd() -> InstructionSet {
    InstructionSet::choose().expect("PENDMAP_SIMD names a simd of this processor")
}

/// A driven pendulum without torque.
pub fn driven(gamma: f64, p: f64, omega: f64) -> Pendulum {
    Pendulum::new(gamma, p, omega, 0.0, 0.0).expect("in range")
}

/// An undriven pendulum with torque.
pub fn undriven(gamma: f64, torque: f64) -> Pendulum {
    Pendulum::new(gamma, 0.0, 1.0, 0.0, torque).expect("in range")
}

/// The map of `pendulum` with the fine sine at any step.
pub fn fine_strobe(pendulum: &Pendulum, steps: usize, simd: InstructionSet) -> Strobe {
    Strobe { fine: true, ..Strobe::new(pendulum, steps, simd) }
}

/// `count` states that cover `[-theta, theta] x [-velocity, velocity]` evenly (an additive
/// recurrence with the plastic number).
pub fn spread(count: usize, theta: f64, velocity: f64) -> Vec<State> {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    (1..=count)
        .map(|k| {
            let at = |ratio: f64| 2.0 * (0.5 + k as f64 * ratio).fract() - 1.0;
            [theta * at(1.0 / PLASTIC), velocity * at(1.0 / (PLASTIC * PLASTIC))]
        })
        .collect()
}

/// The grid of the reference values: `count` x `count` cells of [-pi, pi] x [-3, 3].
pub fn plane(count: usize) -> Starts {
    Starts::Grid {
        theta: Axis::new("theta", -PI, PI, count).expect("an axis"),
        velocity: Axis::new("velocity", -3.0, 3.0, count).expect("an axis"),
    }
}

/// The default options without the reliability check.
pub fn unchecked() -> Options {
    Options { check: false, ..Options::default() }
}

/// The basins of `pendulum` on [`plane`].
pub fn basins_on_plane(pendulum: &Pendulum, count: usize) -> BasinMap {
    basins(pendulum, &plane(count), &unchecked(), &Control::default()).expect("a map")
}

/// The steps and attractors of a plane on a chosen instruction set.
pub fn searched(pendulum: &Pendulum, starts: &Starts, simd: InstructionSet) -> (Strobe, Catalogue) {
    let sample = starts.sampled_states(400, 0);
    let (strobe, _) = choose(pendulum, &sample, 1e-6, simd).expect("steps");
    let never = AtomicBool::new(false);
    let mut catalogue = Catalogue::new(&strobe, Effort::THOROUGH, &never).expect("attractors");
    catalogue.search(&strobe, &sample, 1000, &never).expect("attractors");
    (strobe, catalogue)
}

/// The steps, attractors and labels of a plane on a chosen instruction set.
pub fn labelled(
    pendulum: &Pendulum,
    starts: &Starts,
    simd: InstructionSet,
) -> (Strobe, Catalogue, Labels) {
    let (strobe, catalogue) = searched(pendulum, starts, simd);
    let labels = relabelled(&strobe, &catalogue, starts, None, 1);
    (strobe, catalogue, labels)
}

/// Chaos coexisting with other attractors, on `plane(24)`: p = 1.52, omega = 1.1.
pub fn chaos_among_others() -> &'static (Strobe, Catalogue, Labels) {
    static FOUND: OnceLock<(Strobe, Catalogue, Labels)> = OnceLock::new();
    FOUND.get_or_init(|| labelled(&driven(0.1, 1.52, 1.1), &plane(24), simd()))
}

/// The labels of all starts, or of `picks`.
pub fn relabelled(
    strobe: &Strobe,
    catalogue: &Catalogue,
    starts: &Starts,
    picks: Option<&[usize]>,
    threads: usize,
) -> Labels {
    let pool = pool(threads).expect("a pool");
    label(strobe, catalogue, starts, picks, 4000, &pool, &Control::default()).expect("labels")
}

/// The name of every cell's attractor.
pub fn cell_names(map: &BasinMap) -> Vec<&str> {
    let name = |label: &i16| {
        usize::try_from(label - 1).ok().map_or("none", |i| map.attractors[i].name.as_str())
    };
    map.labels.label.iter().map(name).collect()
}

/// Assert that labels are equal in every field, bit for bit.
pub fn assert_same(a: &Labels, b: &Labels, what: &str) {
    assert_eq!(a.label, b.label, "labels: {what}");
    assert_eq!(a.settle, b.settle, "settling times: {what}");
    assert_eq!(a.turns, b.turns, "turns: {what}");
    assert_eq!(a.open.len(), b.open.len(), "open starts: {what}");
    for ((i, x), (j, y)) in a.open.iter().zip(&b.open) {
        assert!(i == j && bits(x) == bits(y), "open start {i}: {what}");
    }
    assert_eq!(a.work, b.work, "work: {what}");
}

/// The states after `periods` periods, wrapped.
pub fn advanced(strobe: &Strobe, states: &[State], periods: usize) -> Vec<State> {
    let mut all = States::from(states);
    strobe.advance(&mut all, periods);
    all.to_vec()
}

/// One trajectory through a schedule; the angle is not wrapped.
pub fn along(schedule: &Schedule, [theta, velocity]: State) -> State {
    let mut moving = Moving::new(schedule, theta, velocity);
    moving.run::<Fine>(schedule);
    [moving.theta(), moving.velocity(schedule)]
}

/// The bits of numbers, for comparison without tolerance.
pub fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// A function of the lane arithmetic, applied to many numbers.
struct Each<'a, F>(&'a [f64], PhantomData<F>);

/// A function over any lane; a trait, since a closure cannot be generic.
pub trait Function {
    fn of<L: Lane>(x: L) -> L;
}

impl<F: Function> Job for Each<'_, F> {
    type Output = [Vec<f64>; 2];
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) -> [Vec<f64>; 2] {
        let width = S::Lanes::WIDTH;
        let mut lanes = self.0.to_vec();
        lanes.resize(self.0.len().next_multiple_of(width), 0.0);
        for chunk in lanes.chunks_exact_mut(width) {
            F::of(S::Lanes::load(isa, chunk)).store(chunk);
        }
        lanes.truncate(self.0.len());
        let mut singles = self.0.to_vec();
        for x in singles.chunks_exact_mut(1) {
            F::of(S::Single::load((), x)).store(x);
        }
        [lanes, singles]
    }
}

/// `F` of many numbers on `simd`; asserts that lanes and single numbers agree bit for bit.
pub fn each<F: Function>(simd: InstructionSet, numbers: &[f64]) -> Vec<f64> {
    let [lanes, singles] = dispatch::run(simd, Each::<F>(numbers, PhantomData));
    assert!(bits(&lanes) == bits(&singles), "lanes and single numbers differ on {simd}");
    lanes
}
