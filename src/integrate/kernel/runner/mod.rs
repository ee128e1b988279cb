//! The steps of a block on each route through the kernel, and the queue of the lanes whose velocity
//! passes zero or that meet a corner.

use std::f64::consts::{FRAC_1_PI, PI};
use std::marker::PhantomData;
use std::ops::Range;

use crate::integrate::kernel::block::{Block, Held, See};
use crate::integrate::kernel::corner::{self, Corner};
use crate::integrate::kernel::general::{Clock, Running, STEP, Shared, Stages, Stepping};
use crate::integrate::kernel::step::{Moving, Rubbing};
use crate::integrate::kernel::stroboscopic::Strobe;
use crate::lanes::sine::{Coarse, Degree, Fine};
use crate::lanes::{Lane, Work};
use crate::model::Equation;
use crate::model::pendulum::Route;
use crate::model::rest::{Release, release};

mod queue;

use queue::keep;

/// Largest change of a velocity within a step, relative to that by its first acceleration.
const REACH: f64 = 1.25;

/// Runs a block; `Q` is the narrower kind of lanes, for the queue and for effects.
#[inline(always)]
pub(super) fn run<L: Lane, Q: Lane>(
    strobe: &Strobe,
    tokens: (L::Token, Q::Token),
    block: &mut Block,
    see: See,
) {
    if strobe.is_plain() {
        smooth::<L>(strobe, tokens.0, block, see);
    } else {
        Runner::<L, Q>::new(strobe, tokens).run(block, see);
    }
}

/// A period of a block without events or effects: at once if nothing sees the steps.
#[inline(always)]
pub(super) fn smooth<L: Lane>(strobe: &Strobe, token: L::Token, block: &mut Block, mut see: See) {
    let length = if see.is_some() { 1 } else { strobe.steps() };
    let mut first = 0;
    while first < strobe.steps() {
        let range = first..first + length;
        if strobe.fine {
            L::apart(token, Smooth::<L, Fine> { strobe, token, block, range, degree: PhantomData });
        } else {
            let degree = PhantomData;
            L::apart(token, Smooth::<L, Coarse> { strobe, token, block, range, degree });
        }
        if let Some(see) = &mut see {
            see(block);
        }
        first += length;
    }
}

struct Smooth<'a, L: Lane, D> {
    strobe: &'a Strobe,
    token: L::Token,
    block: &'a mut Block,
    range: Range<usize>,
    degree: PhantomData<D>,
}

impl<L: Lane, D: Degree> Work for Smooth<'_, L, D> {
    #[inline(always)]
    fn run(self) {
        let Self { strobe, token, block, range, .. } = self;
        let schedule = &strobe.schedule;
        let steps = &schedule.steps()[range];
        let mut at = 0;
        while at < block.kick.len() {
            let mut lanes = load::<L>(token, block, at);
            for loads in steps {
                lanes.step::<D>(loads, schedule.decay);
            }
            lanes.half_turns.store(&mut block.half_turns[at..]);
            lanes.kick.store(&mut block.kick[at..]);
            at += L::WIDTH;
        }
    }
}

#[inline(always)]
fn load<L: Lane>(token: L::Token, block: &Block, at: usize) -> Moving<L> {
    Moving {
        half_turns: L::load(token, &block.half_turns[at..]),
        kick: L::load(token, &block.kick[at..]),
    }
}

/// The arguments of a step of a block.
struct Step<'a, L: Lane, Q: Lane> {
    runner: &'a Runner<'a, L, Q>,
    block: &'a mut Block,
    k: usize,
    time: [f64; 2],
    stages: &'a mut Stages<Q>,
}

// Each part of a step has its own function: the compiler's time grows faster than a function's length.
macro_rules! apart {
    ($($name:ident => |$runner:ident, $block:ident, $k:ident, $time:ident, $stages:ident| $call:expr;)*) => {$(
        struct $name<'a, L: Lane, Q: Lane>(Step<'a, L, Q>);

        impl<L: Lane, Q: Lane> Work for $name<'_, L, Q> {
            #[inline(always)]
            fn run(self) {
                let Step { runner: $runner, block: $block, k: $k, time: $time, stages: $stages } = self.0;
                $call;
            }
        }
    )*};
}

apart! {
    General => |runner, block, k, time, stages| runner.general_step(block, k, time, stages);
    UnderFriction => |runner, block, k, time, _stages| runner.friction_step(block, k, time);
    WithEffects => |runner, block, k, time, _stages| runner.step_with_effects(block, k, time);
    Queue => |runner, block, _k, _time, stages| runner.work_off(block, stages);
}

/// Runs the blocks of one pendulum; `Q` is the narrower kind of lanes, for the queue and for effects.
struct Runner<'a, L: Lane, Q: Lane> {
    strobe: &'a Strobe,
    tokens: (L::Token, Q::Token),
    equation: Equation<Q>,
    single: &'a Equation<f64>,
    corner: Option<Corner<Q>>,
    length: f64,
}

impl<'a, L: Lane, Q: Lane> Runner<'a, L, Q> {
    #[inline(always)]
    fn new(strobe: &'a Strobe, tokens: (L::Token, Q::Token)) -> Self {
        let single = &strobe.equation;
        let equation = single.map(Q::splat(tokens.1, 0.0));
        let corner = Corner::new(single, Q::splat(tokens.1, 0.0));
        Self { strobe, tokens, equation, single, corner, length: single.drive_period() }
    }

    #[inline(always)]
    fn run(&self, block: &mut Block, mut see: See) {
        let Strobe { route, events, extra, .. } = *self.strobe;
        if events {
            self.begin(block);
        }
        let stages = &mut Stages::new(Q::splat(self.tokens.1, 0.0));
        let steps = self.strobe.steps();
        for k in 0..steps {
            let time = [k, k + 1].map(|k| self.length * k as f64 / steps as f64);
            let step = Step { runner: self, block, k, time, stages };
            match (route, extra) {
                (Route::General, _) => Q::apart(self.tokens.1, General(step)),
                (Route::Friction, false) => Q::apart(self.tokens.1, UnderFriction(step)),
                _ => Q::apart(self.tokens.1, WithEffects(step)),
            }
            if events {
                block.let_go(time);
                if !block.queue.is_empty() {
                    let step = Step { runner: self, block, k, time, stages };
                    Q::apart(self.tokens.1, Queue(step));
                }
            }
            if let Some(see) = &mut see {
                see(block);
            }
        }
    }

    /// Holds lanes at rest, or starts their motion.
    #[inline(never)]
    fn begin(&self, block: &mut Block) {
        block.held.clear();
        block.queue.clear();
        block.held_at.fill(f64::NAN);
        for lane in 0..block.kick.len() {
            if block.kick[lane] != 0.0 || block.idle[lane] {
                continue;
            }
            let half_turns = block.half_turns[lane];
            let (until, sense) = match release(self.single, 0.0, half_turns * PI, self.length) {
                Release::Now(sense) => (0.0, sense),
                Release::At(time, sense) => (time, sense),
                Release::Later | Release::Never => (f64::INFINITY, 1.0),
            };
            let held = Held { lane, half_turns, until, sense };
            if held.until > 0.0 {
                block.held_at[lane] = half_turns;
            }
            block.held.push(held);
        }
    }

    /// A step under Coulomb friction with the sign of each velocity held.
    #[inline(always)]
    fn friction_step(&self, block: &mut Block, k: usize, time: [f64; 2]) {
        let schedule = &self.strobe.schedule;
        let loads = &schedule.steps()[k];
        let one = L::splat(self.tokens.0, 1.0);
        let mut at = 0;
        while at < block.kick.len() {
            let before = load::<L>(self.tokens.0, block, at);
            let mut after = before;
            let sense = one.with_sign_of(before.kick);
            let rubbing = Rubbing(sense.scale(-self.single.theta_r));
            let ends = after.step_with::<Fine, _>(loads, schedule.decay, &rubbing);
            after.half_turns.store(&mut block.half_turns[at..]);
            after.kick.store(&mut block.kick[at..]);
            let flags = passages(before.kick * sense, after.kick * sense, ends, sense);
            if flags != 0 {
                self.flagged(block, at, flags, [before, after], ends, time);
            }
            at += L::WIDTH;
        }
    }

    /// A step with effects that depend only on the sign of the velocity.
    #[inline(always)]
    fn step_with_effects(&self, block: &mut Block, k: usize, time: [f64; 2]) {
        let schedule = &self.strobe.schedule;
        let token = self.tokens.1;
        let one = Q::splat(token, 1.0);
        let mut at = 0;
        while at < block.kick.len() {
            let before = Moving {
                half_turns: Q::load(token, &block.half_turns[at..]),
                kick: Q::load(token, &block.kick[at..]),
            };
            let mut after = before;
            let sense = one.with_sign_of(before.kick);
            let loads = &schedule.steps()[k];
            let ends = after.step_under(&self.equation, loads, schedule.decay, sense);
            after.half_turns.store(&mut block.half_turns[at..]);
            after.kick.store(&mut block.kick[at..]);
            if self.strobe.events {
                let flags = passages(before.kick * sense, after.kick * sense, ends, sense);
                if flags != 0 {
                    self.flagged(block, at, flags, [before, after], ends, time);
                }
            }
            at += Q::WIDTH;
        }
    }

    /// A step with torques that depend on the velocity.
    #[inline(always)]
    fn general_step(&self, block: &mut Block, k: usize, time: [f64; 2], stages: &mut Stages<Q>) {
        let table = &self.strobe.timetable;
        let token = self.tokens.1;
        let scale = self.strobe.schedule.kick;
        let one = Q::splat(token, 1.0);
        let length = Q::splat(token, table.length);
        let clock = Shared { forcing: &table.steps()[k], length };
        // No closure: it would lose the instruction set.
        let mut corner = None;
        if let Some(own) = &self.corner {
            let begin = own.forcing(Q::splat(token, time[0]));
            let end = own.forcing(Q::splat(token, time[1]));
            corner = Some((own, begin, end));
        }
        let mut at = 0;
        while at < block.kick.len() {
            let half_turns = Q::load(token, &block.half_turns[at..]);
            let kick = Q::load(token, &block.kick[at..]);
            let sense = one.with_sign_of(kick);
            let mut lanes =
                Running { theta: half_turns.scale(PI), velocity: kick.scale(1.0 / scale) };
            let begin = lanes;
            let before = lanes.velocity * sense;
            let mut ends = [sense; 2];
            let mut side = one;
            let mut first = None;
            if let Some((corner, begin, _)) = &corner {
                let switch = corner.at(begin, lanes.theta, lanes.velocity);
                side = switch.value.sign();
                first = Some(switch);
            }
            self.carry(STEP, clock, [sense, side], &mut lanes, &mut ends, stages);
            let after = Moving {
                half_turns: lanes.theta.scale(FRAC_1_PI),
                kick: lanes.velocity.scale(scale),
            };
            after.half_turns.store(&mut block.half_turns[at..]);
            after.kick.store(&mut block.kick[at..]);
            if self.strobe.events {
                // A velocity that passes zero twice begins against the motion, strongly enough to stop
                // within the step.
                let b0 = ends[0] * sense;
                let reach = b0.scale_add(REACH * table.length, before);
                let passed = (lanes.velocity * sense).signs();
                let moving = !(before - before.like(f64::MIN_POSITIVE)).signs();
                let mut flags = moving & (passed | (b0.signs() & reach.signs()));
                if flags != 0 || first.is_some() {
                    ends[1] = last_acceleration(begin, lanes, ends[0], table.length);
                }
                if let (Some((corner, _, end)), Some(first)) = (&corner, first) {
                    let last = corner.at(end, lanes.theta, lanes.velocity);
                    let values = [first.value, last.value];
                    let rates = [first.rate(ends[0]), last.rate(ends[1])];
                    flags |= moving & corner::passages(side, values, rates, length);
                    keep(&mut block.scratch, side, values, rates);
                }
                if flags != 0 {
                    let gain = scale * table.length;
                    let ends = [ends[0].scale(gain), ends[1].scale(gain)];
                    let before = Moving { half_turns, kick };
                    self.flagged(block, at, flags, [before, after], ends, time);
                }
            }
            at += Q::WIDTH;
        }
    }

    /// A part of a step of the general method.
    #[inline(always)]
    fn carry<K: Clock<Q>>(
        &self,
        part: Range<usize>,
        clock: K,
        signs: [Q; 2],
        state: &mut Running<Q>,
        ends: &mut [Q; 2],
        stages: &mut Stages<Q>,
    ) {
        let equation = &self.equation;
        Q::apart(self.tokens.1, Stepping { equation, clock, signs, part, state, ends, stages });
    }
}

/// The acceleration at the end of a step, by the cubic that the velocity is with these angles,
/// velocities and first acceleration: near enough to begin a search for zeros, where a stage would
/// cost a thirteenth of the step.
#[inline(always)]
fn last_acceleration<L: Lane>(begin: Running<L>, end: Running<L>, first: L, length: f64) -> L {
    let mean = (end.theta - begin.theta).scale(12.0 / length);
    let both = end.velocity.scale_add(6.0, begin.velocity.scale(6.0));
    (both - mean).scale_add(1.0 / length, first)
}

/// The lanes whose velocity, `u` before and `v` after a step in the sense of the motion, has passed
/// zero, or may have touched it: its parabola's least value says so, with a margin. Lanes at rest have
/// not.
#[inline(always)]
fn passages<L: Lane>(u: L, v: L, [first, last]: [L; 2], sense: L) -> u128 {
    let moving = !(u - u.like(f64::MIN_POSITIVE)).signs();
    let (b0, b1) = (first * sense, last * sense);
    let lowest = u.scale(1.6).mul_add(b1 - b0, -(b0 * b0));
    moving & (v.signs() | (b0.signs() & !b1.signs() & lowest.signs()))
}
