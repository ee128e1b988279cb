//! Trajectories run until an attractor has captured them: a lane that has finished takes the next
//! start at a period's end.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_1_PI, PI, TAU};
use std::sync::atomic::{AtomicBool, Ordering};

use super::trap::{Band, Ellipse};
use crate::integrate::kernel::block::Block;
use crate::integrate::{State, Strobe};
use crate::lanes::{Isa, Job, Lane, dispatch};
use crate::model::Angle;

/// All trapping regions.
#[derive(Clone, Debug, Default)]
pub struct Traps {
    /// Around the points of periodic attractors.
    pub ellipses: Vec<Ellipse>,
    /// Around running states.
    pub bands: Vec<Band>,
    /// With friction, the states of permanent sticking.
    pub rests: Rests,
}

/// The sets of states that friction holds for ever: at most one around each half turn.
#[derive(Clone, Debug, Default)]
pub struct Rests {
    /// Topology of the angle: circle or line.
    pub angle: Angle,
    /// The index of each set's attractor, by [`Angle::half_turn`].
    pub sets: BTreeMap<i64, usize>,
}

impl Rests {
    /// The set that holds the angle `theta`.
    #[must_use]
    pub fn of(&self, theta: f64) -> Option<usize> {
        self.sets.get(&self.angle.half_turn(theta)).copied()
    }
}

/// At the edge of a set at rest a pendulum creeps into it, ever more slowly, and never arrives: if
/// it is held in two successive periods, nearer in the second, and within this part of the friction
/// of permanent sticking, it is at rest. Held states form a line, on which their map is monotone.
const CREEPING: f64 = 0.05;

/// How a trajectory ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    /// Inside the traps of this attractor for two successive periods.
    Captured(usize),
    /// The bound was reached first.
    Open,
    /// Left the range of numbers.
    Failed,
}

/// A trajectory's end.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// How it ended.
    pub fate: Fate,
    /// Periods until the first of the two hits, or until the bound.
    pub periods: u32,
    /// Net turns over these periods.
    pub turns: i64,
    /// The state at the end, angle in [-pi, pi].
    pub state: State,
    /// Periods integrated.
    pub work: u32,
}

impl Outcome {
    /// The periods after which it ended; `None` if nothing ended it within the bound.
    #[must_use]
    pub fn end(&self) -> Option<u32> {
        (self.fate != Fate::Open).then_some(self.periods)
    }
}

/// A source of starts: indices and states.
pub trait Source {
    /// Approximate number of starts.
    fn count(&self) -> usize;
    /// The next start.
    fn next(&mut self) -> Option<(usize, State)>;
    /// Takes the outcome of start `index`.
    fn done(&mut self, index: usize, outcome: Outcome);
}

/// Runs all starts of `source` for at most `bound` periods; `cancel` ends it early.
pub fn run(
    strobe: &Strobe,
    traps: &Traps,
    bound: u32,
    cancel: &AtomicBool,
    source: &mut dyn Source,
) {
    Watch::new(Capture { strobe, traps, bound, cancel, source }).run();
}

/// All outcomes of `starts`, in their order; `None` if `cancel` was set.
#[must_use]
pub fn outcomes(
    strobe: &Strobe,
    traps: &Traps,
    bound: u32,
    starts: &[State],
    cancel: &AtomicBool,
) -> Option<Vec<Outcome>> {
    struct Slice<'a>(std::iter::Enumerate<std::slice::Iter<'a, State>>, Vec<Option<Outcome>>);
    impl Source for Slice<'_> {
        fn count(&self) -> usize {
            self.1.len()
        }
        fn next(&mut self) -> Option<(usize, State)> {
            self.0.next().map(|(i, s)| (i, *s))
        }
        fn done(&mut self, index: usize, outcome: Outcome) {
            self.1[index] = Some(outcome);
        }
    }
    let mut slice = Slice(starts.iter().enumerate(), vec![None; starts.len()]);
    run(strobe, traps, bound, cancel, &mut slice);
    slice.1.into_iter().collect()
}

struct Capture<'a> {
    strobe: &'a Strobe,
    traps: &'a Traps,
    bound: u32,
    cancel: &'a AtomicBool,
    source: &'a mut dyn Source,
}

/// A hit: which attractor and point, when, and where the trajectory was.
#[derive(Clone, Copy)]
struct Hit {
    attractor: usize,
    point: usize,
    clock: u64,
    turns: f64,
    theta: f64,
    velocity: f64,
}

/// The trajectory in one lane.
#[derive(Clone, Copy)]
struct Tenant {
    index: usize,
    first_theta: f64,
    born: u64,
    hit: Option<Hit>,
    /// When friction last held it, and by how much the maximum load exceeds the friction.
    held: Option<(u64, f64)>,
}

/// A block whose lanes take a new start when one has ended.
struct Watch<'a> {
    job: Capture<'a>,
    /// Ellipses in the coordinates of a lane: half turns and kick.
    scaled: Vec<Ellipse>,
    block: Block,
    height: Vec<f64>,
    tenants: Vec<Option<Tenant>>,
    clock: u64,
    next_expiry: u64,
}

impl<'a> Watch<'a> {
    fn new(job: Capture<'a>) -> Self {
        let width = job.strobe.block_width(job.source.count());
        let scale = job.strobe.schedule.kick;
        let scaled = job
            .traps
            .ellipses
            .iter()
            .map(|e| Ellipse {
                centre: [e.centre[0] * FRAC_1_PI, e.centre[1] * scale],
                shape: [e.shape[0] * PI, e.shape[1] / scale, e.shape[2] / scale],
                ..*e
            })
            .collect();
        Self {
            job,
            scaled,
            block: Block::new(width),
            height: vec![f64::INFINITY; width],
            tenants: vec![None; width],
            clock: 0,
            next_expiry: u64::MAX,
        }
    }

    fn run(mut self) {
        let width = self.tenants.len();
        let mut occupied = 0;
        for lane in 0..width {
            occupied += usize::from(self.refill(lane));
        }
        while occupied > 0 {
            self.job.strobe.period(&mut self.block);
            let heights = Heights {
                angle: self.job.strobe.angle,
                block: &mut self.block,
                ellipses: &self.scaled,
                height: &mut self.height,
            };
            let low = dispatch::run(self.job.strobe.simd, heights);
            self.clock += 1;
            let bands = !self.job.traps.bands.is_empty();
            if low < 1.0 || bands {
                for lane in 0..width {
                    if (self.height[lane] < 1.0 || bands) && self.captured(lane) {
                        occupied -= usize::from(!self.refill(lane));
                    }
                }
            }
            if self.job.strobe.friction {
                for lane in 0..width {
                    if !self.block.held_at[lane].is_nan() && self.at_rest(lane) {
                        occupied -= usize::from(!self.refill(lane));
                    }
                }
            }
            if self.clock >= self.next_expiry {
                occupied -= self.expire(width);
            }
            if self.job.cancel.load(Ordering::Relaxed) {
                return;
            }
        }
    }

    /// Puts the next start into `lane`; false if there is none.
    #[inline(never)]
    fn refill(&mut self, lane: usize) -> bool {
        let Some((index, [theta, velocity])) = self.job.source.next() else {
            self.tenants[lane] = None;
            (self.block.half_turns[lane], self.block.kick[lane]) = (0.0, 0.0);
            return false;
        };
        self.block.half_turns[lane] = theta * FRAC_1_PI;
        self.block.kick[lane] = velocity * self.job.strobe.schedule.kick;
        self.block.turns[lane] = 0.0;
        self.tenants[lane] =
            Some(Tenant { index, first_theta: theta, born: self.clock, hit: None, held: None });
        self.next_expiry = self.next_expiry.min(self.clock + u64::from(self.job.bound));
        true
    }

    /// The trap that holds `lane`, as attractor, point and length of its cycle.
    fn trap(&self, lane: usize) -> Option<(usize, usize, usize)> {
        let state = [self.block.half_turns[lane], self.block.kick[lane]];
        if let Some(e) = self.scaled.iter().find(|e| e.height(state) < 1.0) {
            return Some((e.attractor, e.point, e.cycle));
        }
        let state = [self.theta(lane), self.velocity(lane)];
        self.job.traps.bands.iter().find(|b| b.contains(state)).map(|b| (b.attractor, 0, 1))
    }

    /// Whether `lane` has hit the same attractor, one point on, in two successive periods; if so
    /// its outcome has been delivered.
    #[inline(never)]
    fn captured(&mut self, lane: usize) -> bool {
        let (Some(mut tenant), Some((attractor, point, cycle))) =
            (self.tenants[lane], self.trap(lane))
        else {
            return false;
        };
        if let Some(hit) = tenant.hit {
            let consecutive = hit.clock + 1 == self.clock && hit.attractor == attractor;
            if consecutive && point == (hit.point + 1) % cycle {
                let end = (hit.theta, hit.velocity, hit.turns, hit.clock);
                self.hand_over(tenant, Fate::Captured(attractor), end);
                return true;
            }
        }
        tenant.hit = Some(Hit {
            attractor,
            point,
            clock: self.clock,
            turns: self.block.turns[lane],
            theta: self.theta(lane),
            velocity: self.velocity(lane),
        });
        self.tenants[lane] = Some(tenant);
        false
    }

    /// Whether friction holds `lane` for ever, or it creeps to such a state; if so its outcome has
    /// been delivered.
    #[inline(never)]
    fn at_rest(&mut self, lane: usize) -> bool {
        let theta = self.block.held_at[lane] * PI;
        let (Some(mut tenant), Some(rest)) = (self.tenants[lane], self.job.traps.rests.of(theta))
        else {
            return false;
        };
        let equation = &self.job.strobe.equation;
        let excess = equation.excess(theta);
        let limit = equation.hold(theta);
        let creeps = tenant.held.is_some_and(|(clock, before)| {
            clock + 1 == self.clock && excess < before && excess < CREEPING * limit
        });
        if equation.holds_for_ever(theta) || creeps {
            let end = (self.theta(lane), self.velocity(lane), self.block.turns[lane], self.clock);
            self.hand_over(tenant, Fate::Captured(rest), end);
            return true;
        }
        tenant.held = Some((self.clock, excess));
        self.tenants[lane] = Some(tenant);
        false
    }

    fn theta(&self, lane: usize) -> f64 {
        self.block.half_turns[lane] * PI
    }

    fn velocity(&self, lane: usize) -> f64 {
        self.block.kick[lane] / self.job.strobe.schedule.kick
    }

    fn hand_over(&mut self, tenant: Tenant, fate: Fate, end: (f64, f64, f64, u64)) {
        let (theta, velocity, turns, clock) = end;
        let whole = turns + (theta - tenant.first_theta) / TAU;
        let outcome = Outcome {
            fate,
            periods: (clock - tenant.born) as u32,
            turns: whole.round() as i64,
            state: [theta, velocity],
            work: (self.clock - tenant.born) as u32,
        };
        self.job.source.done(tenant.index, outcome);
    }

    /// Ends the lanes that have reached their bound; returns the number of lanes that stay empty.
    #[inline(never)]
    fn expire(&mut self, width: usize) -> usize {
        let bound = u64::from(self.job.bound);
        self.next_expiry = u64::MAX;
        let mut emptied = 0;
        for lane in 0..width {
            let Some(tenant) = self.tenants[lane] else { continue };
            let expiry = tenant.born + bound;
            if expiry > self.clock {
                self.next_expiry = self.next_expiry.min(expiry);
                continue;
            }
            let (theta, velocity) = (self.theta(lane), self.velocity(lane));
            let finite = theta.is_finite() && velocity.is_finite() && velocity.abs() < 1e6;
            let fate = if finite { Fate::Open } else { Fate::Failed };
            self.hand_over(tenant, fate, (theta, velocity, self.block.turns[lane], self.clock));
            emptied += usize::from(!self.refill(lane));
        }
        emptied
    }
}

/// Removes whole turns; returns the lowest height above the traps' centres.
struct Heights<'a> {
    angle: Angle,
    block: &'a mut Block,
    ellipses: &'a [Ellipse],
    height: &'a mut [f64],
}

impl Job for Heights<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<S: Isa>(self, isa: S) -> f64 {
        if self.height.len() == S::Few::WIDTH {
            self.of::<S::Few>(isa)
        } else {
            self.of::<S::Lanes>(isa)
        }
    }
}

impl Heights<'_> {
    #[inline(always)]
    fn of<L: Lane>(self, token: L::Token) -> f64 {
        let mut lowest = f64::INFINITY;
        let mut at = 0;
        while at < self.height.len() {
            let (half_turns, whole) = self.angle.wrap(L::load(token, &self.block.half_turns[at..]));
            let kick = L::load(token, &self.block.kick[at..]);
            let mut height = L::splat(token, f64::INFINITY);
            for e in self.ellipses {
                let x = half_turns - half_turns.like(e.centre[0]);
                let y = kick - half_turns.like(e.centre[1]);
                let y1 = x.scale_add(e.shape[0], y.scale(e.shape[1]));
                let y2 = y.scale(e.shape[2]);
                height = y1.mul_add(y1, y2 * y2).min(height);
            }
            half_turns.store(&mut self.block.half_turns[at..]);
            (L::load(token, &self.block.turns[at..]) + whole).store(&mut self.block.turns[at..]);
            height.store(&mut self.height[at..]);
            for h in &self.height[at..at + L::WIDTH] {
                lowest = if *h < lowest { *h } else { lowest };
            }
            at += L::WIDTH;
        }
        lowest
    }
}
