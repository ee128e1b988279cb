"""Processes that a test interrupts."""

from __future__ import annotations

import contextlib
import glob
import signal
import subprocess
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path


@contextlib.contextmanager
def started(words: Sequence[str], **given: Any) -> Iterator[subprocess.Popen[str]]:  # noqa: ANN401
    """Start a process that receives Ctrl-C, also below a shell's job, and ends with the test."""
    process = subprocess.Popen(
        words,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509 (no threads)
        **given,
    )
    with process:
        try:
            yield process
        finally:
            process.kill()


def until(process: subprocess.Popen[str], come: Callable[[], bool], step: float = 0.1) -> None:
    """Wait until a process has come so far, or has ended; fail if it takes too long."""
    end = time.monotonic() + 120.0  # s: then it is taken to hang
    while process.poll() is None and not come():
        assert time.monotonic() < end, f"{process.args} has not come so far"
        time.sleep(step)


def any_file(folder: Path, pattern: str) -> bool:
    """Return whether a file matches, also while folders beside it are created and removed."""
    return bool(glob.glob(str(folder / pattern)))  # noqa: PTH207 (Path.glob fails if a folder is removed)
