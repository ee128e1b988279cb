//! Long calls: without the interpreter lock, with Ctrl-C and progress.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pendmap::error::Error;
use pendmap::maps::control::{Control, pool};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use super::raise;

/// Interval between checks of signals and progress.
const PAUSE: Duration = Duration::from_millis(50);

/// Runs `work` on another thread and waits for it, detached from the interpreter; at every
/// pause it checks for signals and calls `progress(done, total)`.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Control) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let report = |py: Python<'_>, control: &Control| match progress {
        Some(progress) => progress.call1(py, control.progress()).map(|_| ()),
        None => Ok(()),
    };
    let (result, stop) = stopped(py, report, work)?;
    stop.map_or_else(|| result.map_err(raise), Err)
}

/// Like [`interruptible`], on as many workers.
pub fn pooled<T: Send>(
    py: Python<'_>,
    threads: usize,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Control) -> Result<T, Error> + Send,
) -> PyResult<T> {
    interruptible(py, progress, |control| pool(threads)?.install(|| work(control)))
}

/// Like [`interruptible`] with any action at every pause; returns the result of `work`, and the signal or
/// error of `report` that stopped it.
pub fn stopped<T: Send>(
    py: Python<'_>,
    mut report: impl FnMut(Python<'_>, &Control) -> PyResult<()> + Send,
    work: impl FnOnce(&Control) -> Result<T, Error> + Send,
) -> PyResult<(Result<T, Error>, Option<PyErr>)> {
    let control = Control::default();
    py.detach(|| {
        thread::scope(|scope| {
            let (sender, ended) = channel::<()>();
            let shared = &control;
            let task = move || {
                // Dropped at the end, however the work ends.
                let _sender = sender;
                work(shared)
            };
            let begun = thread::Builder::new().spawn_scoped(scope, task);
            let worker = begun.map_err(|why| raise(Error::Threads(why.to_string())))?;
            let mut stop: Option<PyErr> = None;
            loop {
                match ended.recv_timeout(PAUSE) {
                    Err(RecvTimeoutError::Timeout) if stop.is_none() => {
                        let look = Python::attach(|py| {
                            py.check_signals()?;
                            report(py, shared)
                        });
                        if let Err(error) = look {
                            shared.cancel();
                            stop = Some(error);
                        }
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
                }
            }
            let unexpected = |_| PyRuntimeError::new_err("a worker thread ended unexpectedly");
            Ok((worker.join().map_err(unexpected)?, stop))
        })
    })
}
