//! Memory, estimated before its allocation: an allocation that fails in the middle of a computation
//! would end the process.
//!
//! Computations whose size a user chooses call [`reckon`] first; lists that grow during a
//! computation call [`room`].

use std::fs::read_to_string;

use crate::error::Error;

/// Memory reserved for everything else, in bytes: threads, modules, files.
const SPARE: f64 = 64e6;

/// Refuses `count` of `what` with `each` bytes each if they need more memory than is free.
///
/// # Errors
/// [`Error::Memory`].
pub fn reckon(what: &str, count: usize, each: usize) -> Result<(), Error> {
    let needed = count as f64 * each as f64;
    let free = free();
    let refused = || Error::Memory { what: what.to_owned(), count, needed, free };
    if needed + SPARE > free.unwrap_or(f64::INFINITY) {
        return Err(refused());
    }
    // Whether the system grants as much at once, which reveals limits that it does not show.
    let mut probe: Vec<u8> = Vec::new();
    probe.try_reserve_exact((needed + SPARE) as usize).map_err(|_| refused())
}

/// Makes room for `more` at the end of `list`.
///
/// # Errors
/// [`Error::Memory`] where the system gives none.
pub fn room<T>(what: &str, list: &mut Vec<T>, more: usize) -> Result<(), Error> {
    let count = list.len().saturating_add(more);
    let needed = count as f64 * size_of::<T>() as f64;
    let refused = |_| Error::Memory { what: what.to_owned(), count, needed, free: free() };
    list.try_reserve(more).map_err(refused)
}

/// Bytes that this process may still allocate, if Linux reports it: limited by the machine, its
/// container, and the process (`ulimit -v`). Where a file cannot be read there is no such limit.
fn free() -> Option<f64> {
    let machine = field("/proc/meminfo", "MemAvailable:").map(|kilobytes| 1024.0 * kilobytes);
    let container = number("/sys/fs/cgroup/memory.max");
    let limit = field("/proc/self/limits", "Max address space");
    let own = limit.zip(field("/proc/self/status", "VmSize:"));
    let own = own.map(|(limit, taken)| (limit - 1024.0 * taken).max(0.0));
    [machine, container, own].into_iter().flatten().reduce(f64::min)
}

/// The number after a name at the beginning of a line of a file; none if it is no number.
fn field(path: &str, name: &str) -> Option<f64> {
    let text = read_to_string(path).ok()?;
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// The number that is the whole content of a file; none if it is no number.
fn number(path: &str) -> Option<f64> {
    read_to_string(path).ok()?.trim().parse().ok()
}
