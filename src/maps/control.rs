//! Progress and cancellation of a long computation, and its threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::Error;
use crate::progress::Progress;

/// Progress and cancellation, shared between threads.
#[derive(Debug, Default)]
pub struct Control {
    cancel: AtomicBool,
    progress: Arc<Progress>,
}

impl Control {
    /// Requests all workers to stop at the end of the next period.
    pub fn cancel(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }

    /// The flag read by the workers.
    #[must_use]
    pub fn flag(&self) -> &AtomicBool {
        &self.cancel
    }

    /// Done and total, in cells; of a search for attractors in periods.
    #[must_use]
    pub fn progress(&self) -> (usize, usize) {
        self.progress.read()
    }

    /// The progress that a search for attractors reports.
    #[must_use]
    pub fn shared(&self) -> Arc<Progress> {
        Arc::clone(&self.progress)
    }

    /// Begins a part of `total` cells.
    pub fn begin(&self, total: usize) {
        self.progress.show(0, total);
    }

    /// Adds `count` finished cells.
    pub fn add(&self, count: usize) {
        self.progress.add(count);
    }

    /// # Errors
    /// [`Error::Interrupted`] after [`Control::cancel`].
    pub fn check(&self) -> Result<(), Error> {
        if self.cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    }
}

/// Parts of a computation in an order that spreads every beginning of it over the whole, so that the time of the first
/// ones tells that of all. Steps are nearly the golden section of the whole, whose multiples are even (Knuth, The Art
/// of Computer Programming 3, section 6.4).
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    count: usize,
    step: usize,
}

impl Spread {
    /// The order of `count` parts.
    #[must_use]
    pub fn of(count: usize) -> Self {
        let nearest = (count as f64 * 0.618_033_988_749_895) as usize;
        let step = (nearest.max(1)..=count).find(|step| coprime(*step, count)).unwrap_or(1);
        Self { count, step }
    }

    /// The part in place `k` of the order, for `k` below the count.
    #[must_use]
    pub fn part(&self, k: usize) -> usize {
        (k as u128 * self.step as u128 % self.count as u128) as usize
    }
}

fn coprime(a: usize, b: usize) -> bool {
    if b == 0 { a == 1 } else { coprime(b, a % b) }
}

/// Largest number of workers; more only wait for one another.
const MOST_THREADS: usize = 256;

/// A pool of `threads` workers; 0 means one for each processor. It lives as long as the call that made
/// it: a child of the process has none of its parent's threads, and would wait for them.
///
/// # Errors
/// [`Error::Range`] above 256, [`Error::Threads`] if the system refuses.
pub fn pool(threads: usize) -> Result<rayon::ThreadPool, Error> {
    if threads > MOST_THREADS {
        let value = threads as f64;
        return Err(Error::Range {
            name: "threads",
            value,
            allowed: "a whole number from 1 to 256",
        });
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Threads(e.to_string()))
}
