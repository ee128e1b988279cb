//! Assignment of every start to the attractor that captures it, on all threads.

use std::sync::atomic::{AtomicI16, AtomicI32, AtomicUsize, Ordering};

use super::control::{Control, Spread};
use super::finite_time::FiniteTime;
use super::starts::Starts;
use crate::attractor::Catalogue;
use crate::attractor::capture::{self, Fate, Outcome, Source};
use crate::error::Error;
use crate::integrate::{State, Strobe};
use crate::memory;

/// Not decided within the bound.
pub const UNDECIDED: i16 = 0;
/// Failed or diverged.
pub const FAILED: i16 = -1;
/// Settle time of a start without one.
pub const NEVER: i32 = -1;

/// Starts per task.
const TAKE: usize = 32;
/// Number of open trajectories that are assigned to chaotic attractors at a time.
const LOT: usize = 512;

/// Labels and related quantities, one entry a start.
#[derive(Debug)]
pub struct Labels {
    /// Attractor number from 1, or [`UNDECIDED`] or [`FAILED`].
    pub label: Vec<i16>,
    /// Periods until captured, or [`NEVER`].
    pub settle: Vec<i32>,
    /// Net turns until then, or until the bound.
    pub turns: Vec<i32>,
    /// Undecided starts, by index.
    pub open: Vec<(usize, State)>,
    /// Total number of integrated periods.
    pub work: u64,
}

impl Labels {
    /// The labels of a plane without basins: all chaotic, or all undecided.
    pub(super) fn unlabelled(layers: &FiniteTime, chaotic: bool, periods: u32) -> Self {
        let count = layers.turns.len();
        let label = layers
            .exponent
            .iter()
            .map(|e| if e.is_finite() { i16::from(chaotic) } else { FAILED })
            .collect();
        Self {
            label,
            settle: vec![NEVER; count],
            turns: layers.turns.clone(),
            open: Vec::new(),
            work: count as u64 * u64::from(periods),
        }
    }

    /// Replaces each label `k + 1` by entry `k` of `moved`.
    pub(super) fn rename(&mut self, moved: &[i16]) {
        for label in self.label.iter_mut().filter(|l| **l > UNDECIDED) {
            *label = moved[*label as usize - 1];
        }
    }

    /// Puts the results for `picks` in their places.
    pub(super) fn replace(&mut self, picks: &[usize], again: Self) {
        for (k, index) in picks.iter().enumerate() {
            self.label[*index] = again.label[k];
            self.settle[*index] = again.settle[k];
            self.turns[*index] = again.turns[k];
        }
        self.open = again.open.into_iter().map(|(k, s)| (picks[k], s)).collect();
        self.work += again.work;
    }
}

struct Shared<'a> {
    strobe: &'a Strobe,
    catalogue: &'a Catalogue,
    starts: &'a Starts,
    picks: Option<&'a [usize]>,
    control: &'a Control,
    next: AtomicUsize,
    tasks: Spread,
    label: Vec<AtomicI16>,
    settle: Vec<AtomicI32>,
    turns: Vec<AtomicI32>,
}

impl Shared<'_> {
    fn count(&self) -> usize {
        self.picks.map_or(self.starts.len(), <[usize]>::len)
    }

    fn start(&self, k: usize) -> State {
        self.starts.get(self.picks.map_or(k, |picks| picks[k]))
    }
}

struct Worker<'a> {
    shared: &'a Shared<'a>,
    range: std::ops::Range<usize>,
    lot: Vec<(usize, State)>,
    open: Vec<(usize, State)>,
    work: u64,
    /// The first error of a lot.
    failed: Option<Error>,
}

impl Source for Worker<'_> {
    fn count(&self) -> usize {
        self.shared.count()
    }

    fn next(&mut self) -> Option<(usize, State)> {
        if self.range.is_empty() {
            let count = self.shared.count();
            let next = self.shared.next.fetch_add(1, Ordering::Relaxed);
            if next < count.div_ceil(TAKE) {
                let begin = self.shared.tasks.part(next) * TAKE;
                self.range = begin..(begin + TAKE).min(count);
            }
        }
        self.range.next().map(|k| (k, self.shared.start(k)))
    }

    fn done(&mut self, index: usize, outcome: Outcome) {
        let shared = self.shared;
        let (label, settle) = match outcome.fate {
            Fate::Captured(attractor) => (attractor as i16 + 1, outcome.periods as i32),
            Fate::Failed => (FAILED, NEVER),
            Fate::Open => {
                self.lot.push((index, outcome.state));
                (UNDECIDED, NEVER)
            }
        };
        shared.label[index].store(label, Ordering::Relaxed);
        shared.settle[index].store(settle, Ordering::Relaxed);
        let turns = outcome.turns.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
        shared.turns[index].store(turns, Ordering::Relaxed);
        self.work += u64::from(outcome.work);
        shared.control.add(1);
        if self.lot.len() >= LOT
            && let Err(error) = self.sort_lot()
        {
            self.failed.get_or_insert(error);
        }
    }
}

impl Worker<'_> {
    /// Assigns the open trajectories of the lot to the chaotic attractors on which they stay.
    fn sort_lot(&mut self) -> Result<(), Error> {
        let Shared { catalogue, strobe, label, control, .. } = self.shared;
        let lot = std::mem::take(&mut self.lot);
        memory::room("starts", &mut self.open, lot.len())?;
        let states: Vec<State> = lot.iter().map(|(_, state)| *state).collect();
        let sets = catalogue.chaos_of(strobe, &states, control.flag())?;
        for ((index, state), set) in lot.into_iter().zip(sets) {
            match set {
                Some(attractor) => label[index].store(attractor as i16 + 1, Ordering::Relaxed),
                None => self.open.push((index, state)),
            }
        }
        Ok(())
    }
}

/// Runs all starts (or those of `picks`) to capture, for at most `bound` periods.
///
/// A start's result depends on the start alone, so neither the number of threads nor the order of
/// their work changes it.
///
/// # Errors
/// [`Error::Interrupted`] if `control` was cancelled; [`Error::Memory`] without room for
/// what is undecided.
pub fn label(
    strobe: &Strobe,
    catalogue: &Catalogue,
    starts: &Starts,
    picks: Option<&[usize]>,
    bound: u32,
    pool: &rayon::ThreadPool,
    control: &Control,
) -> Result<Labels, Error> {
    let count = picks.map_or(starts.len(), <[usize]>::len);
    let shared = Shared {
        strobe,
        catalogue,
        starts,
        picks,
        control,
        next: AtomicUsize::new(0),
        tasks: Spread::of(count.div_ceil(TAKE)),
        label: (0..count).map(|_| AtomicI16::new(UNDECIDED)).collect(),
        settle: (0..count).map(|_| AtomicI32::new(NEVER)).collect(),
        turns: (0..count).map(|_| AtomicI32::new(0)).collect(),
    };
    control.begin(count);
    let workers = pool.broadcast(|_| {
        let mut worker = Worker {
            shared: &shared,
            range: 0..0,
            lot: Vec::new(),
            open: Vec::new(),
            work: 0,
            failed: None,
        };
        capture::run(strobe, &catalogue.traps, bound, control.flag(), &mut worker)?;
        worker.sort_lot()?;
        worker.failed.map_or(Ok((worker.work, worker.open)), Err)
    });
    let (mut work, mut open) = (0, Vec::new());
    for worker in workers {
        let (periods, mut left) = worker?;
        work += periods;
        memory::room("starts", &mut open, left.len())?;
        open.append(&mut left);
    }
    open.sort_by_key(|(index, _)| *index);
    Ok(Labels {
        label: shared.label.into_iter().map(AtomicI16::into_inner).collect(),
        settle: shared.settle.into_iter().map(AtomicI32::into_inner).collect(),
        turns: shared.turns.into_iter().map(AtomicI32::into_inner).collect(),
        open,
        work,
    })
}
