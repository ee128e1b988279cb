"""Start of the viewer on a recording."""

from __future__ import annotations

import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pendmap.errors import InputError, ViewerError

MAGIC = b"RRF2"  # First bytes of a recording

PATIENCE = 2.0  # Time in which a viewer that cannot start is expected to exit, s


_NO_DISPLAY = "there is no display (DISPLAY is not set)"

_RUNNING: list[subprocess.Popen[bytes]] = []  # running viewers, referenced to avoid warnings


class NoDisplayError(ViewerError):
    """There is no display to open a window on."""


class RecordingNotFoundError(ViewerError, FileNotFoundError):
    """The recording does not exist."""


class NotARecordingError(ViewerError, InputError):
    """The file is not a recording."""


def open_viewer(path: str | os.PathLike[str]) -> int:
    """Start the viewer on a recording, leave it running, and return its process number."""
    file = _checked(Path(path))
    if not _display():
        raise NoDisplayError(_elsewhere(file, _NO_DISPLAY))
    command = [str(_program()), "--bind", "127.0.0.1", "--port", str(_free_port()), str(file)]
    with tempfile.TemporaryFile() as text:
        viewer = subprocess.Popen(  # noqa: S603 (our own viewer, a file that was checked)
            command,
            stdin=subprocess.DEVNULL,
            stdout=text,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            if viewer.poll() is not None:
                text.seek(0)
                raise _ended(file, text.read().decode(errors="replace"))
            time.sleep(0.05)
    _RUNNING.append(viewer)
    return viewer.pid


def _checked(file: Path) -> Path:
    if not file.exists():
        raise RecordingNotFoundError(f"{str(file)!r} does not exist")
    if file.is_dir():
        raise NotARecordingError(f"{str(file)!r} is a folder, not an .rrd recording")
    if not file.is_file():
        raise NotARecordingError(f"{str(file)!r} is a pipe or a device, not an .rrd recording")
    with file.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise NotARecordingError(f"{str(file)!r} is not an .rrd recording")
    return file.resolve()


def check_display() -> None:
    """Raise an error if no window can be opened: without a display or the viewer."""
    if not _display():
        raise NoDisplayError(
            f"{_NO_DISPLAY}; leave it out, copy the .rrd to a computer with a screen"
            " and open it there with 'pendmap view'"
        )
    _program()


def _display() -> bool:
    """Return whether a display is set; whether it responds is known only when the viewer starts."""
    names = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
    return not sys.platform.startswith("linux") or any(os.environ.get(name) for name in names)


def _elsewhere(file: Path, why: str) -> str:
    return (
        f"cannot open a window: {why}; copy {str(file)!r} to a computer with a screen"
        f" and open it there with 'pendmap view {file.name}'"
    )


def _program() -> Path:
    """Return the viewer's executable; the ``rerun`` on PATH is only a script that calls it."""
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    package = importlib.util.find_spec("rerun_cli")
    for folder in package.submodule_search_locations or [] if package else []:
        program = Path(folder) / name
        if program.is_file():
            return program
    result = shutil.which("rerun")
    if result is None:
        raise ViewerError("the viewer is not installed; it comes with the extra pendmap[viewer]")
    return Path(result)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


def _ended(file: Path, text: str) -> ViewerError:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    reason = next((line for line in reversed(lines) if "rror" in line), "it gave no reason")
    if any(word in text for word in ("EventLoopError", "X server", "WAYLAND_DISPLAY")):
        return NoDisplayError(_elsewhere(file, "the display does not answer"))
    return ViewerError(f"the viewer ended at once: {reason[:300]}")
