//! Progress and cancellation of a long computation, and its threads.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use rayon::ThreadPool;

use crate::error::{Error, unless_cancelled};
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
        unless_cancelled(&self.cancel)
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

/// Largest number of workers, of a call and of all idle pools together; more only wait for one another.
const MOST_THREADS: usize = 256;

/// A pool that no call uses.
struct Idle {
    /// Its process: a child of the process has none of its parent's threads, and would wait for them.
    process: u32,
    /// The number of workers requested; 0 for one for each processor.
    threads: usize,
    pool: ThreadPool,
}

/// Idle pools, kept for later calls. The lock is only tried: a child of the process may have got it locked.
static IDLE: Mutex<Vec<Idle>> = Mutex::new(Vec::new());

/// The workers of one call; when it has ended they are kept for another one of as many.
#[derive(Debug)]
pub struct Workers {
    threads: usize,
    /// There until it is dropped.
    pool: Option<ThreadPool>,
}

/// The `threads` workers of a call; 0 means one for each processor. Calls at the same time have their own.
///
/// # Errors
/// [`Error::Range`] above 256, [`Error::Threads`] if the system refuses.
pub fn pool(threads: usize) -> Result<Workers, Error> {
    if threads > MOST_THREADS {
        let value = threads as f64;
        return Err(Error::Range {
            name: "threads",
            value,
            allowed: "a whole number from 1 to 256",
        });
    }
    let pool = match idle(threads) {
        Some(pool) => pool,
        None => rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Threads(e.to_string()))?,
    };
    Ok(Workers { threads, pool: Some(pool) })
}

/// Takes an idle pool of this process.
fn idle(threads: usize) -> Option<ThreadPool> {
    // Whoever holds the lock: without it a pool is built.
    let mut idle = IDLE.try_lock().ok()?;
    let process = std::process::id();
    let place = idle.iter().position(|one| (one.process, one.threads) == (process, threads))?;
    Some(idle.swap_remove(place).pool)
}

impl Deref for Workers {
    type Target = ThreadPool;

    fn deref(&self) -> &ThreadPool {
        self.pool.as_ref().expect("it is there until it is dropped")
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        let Some(pool) = self.pool.take() else { return };
        // Whoever holds the lock: without it the threads of this pool end.
        let Ok(mut idle) = IDLE.try_lock() else { return };
        let process = std::process::id();
        let all = idle.iter().filter(|one| one.process == process);
        let workers: usize = all.map(|one| one.pool.current_num_threads()).sum();
        if workers + pool.current_num_threads() <= MOST_THREADS {
            idle.push(Idle { process, threads: self.threads, pool });
        }
    }
}
