"""Start of the viewer on a recording."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from pendmap.errors import InputError, ViewerError

MAGIC = b"RRF2"  # First bytes of a recording

PATIENCE = 2.0  # Time in which a viewer that cannot start is expected to exit, s

_RUNNING: list[subprocess.Popen[bytes]] = []  # running viewers, referenced to avoid warnings


class NoDisplayError(ViewerError):
    """There is no display to open a window on."""


class RecordingNotFoundError(ViewerError, FileNotFoundError):
    """The recording does not exist."""


class NotARecordingError(ViewerError, InputError):
    """The file is not a recording."""


def open_viewer(path: str | os.PathLike[str]) -> int:
    """Start the viewer on a recording, leave it running, and return its process number."""
    file = Path(path)
    if not file.exists():
        raise RecordingNotFoundError(f"{str(file)!r} does not exist")
    if not file.is_file() or _beginning(file) != MAGIC:
        what = "is a folder" if file.is_dir() else "is not an .rrd recording"
        raise NotARecordingError(f"{str(file)!r} {what}")
    check_display(file)
    command = [str(_program()), "--bind", "127.0.0.1", "--port", "auto", str(file.resolve())]
    with tempfile.TemporaryFile() as text:
        viewer = subprocess.Popen(  # noqa: S603 (our own viewer, a file that was checked)
            command,
            stdin=subprocess.DEVNULL,
            stdout=text,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            viewer.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            _RUNNING.append(viewer)
            return viewer.pid
        text.seek(0)
        words = text.read().decode(errors="replace")
    if any(word in words for word in ("EventLoopError", "X server", "WAYLAND_DISPLAY")):
        raise _no_display("the display does not answer", file)
    lines = [line.strip() for line in words.splitlines() if "rror" in line]
    raise ViewerError(f"the viewer ended at once: {(lines or ['it gave no reason'])[-1][:300]}")


def check_display(file: Path | None = None) -> None:
    """Raise an error without display or viewer; only its start shows whether a display responds."""
    names = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in names):
        raise _no_display("there is no display (DISPLAY is not set)", file)
    _program()


def _no_display(why: str, file: Path | None) -> NoDisplayError:
    what = "the .rrd" if file is None else repr(str(file))
    return NoDisplayError(
        f"{why}; copy {what} to a computer with a screen and open it there with 'pendmap view"
        f"{f' {file.name}' if file else ''}'"
    )


def _beginning(file: Path) -> bytes:
    with file.open("rb") as stream:
        return stream.read(len(MAGIC))


def _program() -> Path:
    """Return the viewer's executable; the ``rerun`` on PATH is only a script that calls it."""
    package = importlib.util.find_spec("rerun_cli")
    for folder in package.submodule_search_locations or [] if package else []:
        program = Path(folder) / ("rerun.exe" if sys.platform == "win32" else "rerun")
        if program.is_file():
            return program
    raise ViewerError("the viewer is not installed; it comes with the extra pendmap[viewer]")
