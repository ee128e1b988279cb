"""Whole files and folders: each is complete or absent; and checks of a path before it is used."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import signal
import stat
import tempfile
import threading
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final

from pendmap.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

COMPLETE: Final[list[str]] = []  # Files written so far; the message of an interrupt names them
# Signals that ask the program to stop: Ctrl-C, kill and timeout, a terminal that was closed
STOPS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
_STAGE: Final = ".pendmap-????????.part"  # Folder in which files are written before they are moved
_OWNER: Final = "owner"  # File in a stage that its process keeps locked
_PROBE: Final = 2**20  # Bytes of a trial write, which fails on a full disk, and of one read


@contextlib.contextmanager
def held_interrupts() -> Iterator[None]:
    """Delay the signals that stop until the end of the block: a library may deadlock on them."""
    if threading.current_thread() is not threading.main_thread():  # it receives no signals
        yield
        return
    held: list[int] = []
    before = {n: one for n in STOPS if (one := signal.getsignal(n)) not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, lambda number, _: held.append(number))
    try:
        yield
    finally:
        for number, handler in reversed(before.items()):  # Ctrl-C last: it may raise at once
            signal.signal(number, handler)
        if held:
            signal.raise_signal(held[0])


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], suffixes: Sequence[str]) -> Iterator[Path]:
    """Yield a temporary path with the same name and a known suffix; move its file to ``path``."""
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in suffixes:
        known = " or ".join(suffixes)
        raise InputError(f"cannot write {str(target)!r}: suffix must be {known}, got {suffix!r}")
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(target))
    with _stage(target) as stage:
        part = stage / target.name
        part.touch()
        yield part
        _sync(part)
        part.replace(target)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path for a new folder; move it to ``path``, in the place of one there."""
    target = Path(path).resolve()
    with _stage(target) as stage:
        new, old = (stage / kind / target.name for kind in ("new", "old"))
        new.parent.mkdir()
        old.parent.mkdir()
        yield new
        for folder, _, names in os.walk(new):
            for name in (*names, "."):
                _sync(Path(folder, name))
        if target.exists():
            target.rename(old)
        new.rename(target)
        _sync(target.parent)


def _sync(path: Path) -> None:
    """Write a file or the entries of a folder from the memory of the system to disk."""
    with contextlib.suppress(PermissionError):  # Windows opens no folder
        descriptor = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def read_whole(path: str | os.PathLike[str], most: int) -> bytes:
    """Return the bytes of a file; raise InputError for more than ``most``, a pipe or a device."""
    check_regular(path)
    data = bytearray()
    with _named(Path(path)), Path(path).open("rb") as stream:
        while len(data) <= most and (part := stream.read(_PROBE)):
            data += part
    if len(data) > most:
        raise InputError(f"{path}: must be a file up to {most / 2**20:g} MiB, it is larger")
    return bytes(data)


def check_regular(path: str | os.PathLike[str]) -> None:
    """Raise OSError for a folder or a missing file, InputError for a pipe or a device."""
    mode = Path(path).stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "must be a file, it is a folder", str(path))
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: must be a file, it is a pipe or a device")


def check_room(path: str | os.PathLike[str]) -> None:
    """Raise OSError if no file can be written there."""
    with _stage(Path(path)) as stage:
        (stage / Path(path).name).write_bytes(bytes(4096))


@contextlib.contextmanager
def _named(target: Path) -> Iterator[None]:
    """Re-raise errors of the disk with the name of the target in place of the temporary path."""
    if not target.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "the folder does not exist", str(target.parent))
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(target)) from error


@contextlib.contextmanager
def _stage(target: Path) -> Iterator[Path]:
    """Yield a new folder beside a path, removed at the end; interrupts wait until then."""
    with held_interrupts(), _named(target):
        for other in target.parent.glob(_STAGE):
            with contextlib.suppress(OSError), (other / _OWNER).open("rb+") as owner:
                lock(owner)  # its process was killed
                _remove(other)
        new = Path(tempfile.mkdtemp(".part", ".pendmap_", target.parent))
        with (new / _OWNER).open("wb") as owner:
            with contextlib.suppress(OSError):
                lock(owner)
            stage = new.rename(new.with_name(new.name.replace("_", "-", 1)))
            try:
                yield stage
            except Exception as error:
                # The disk's own error is raised in place of an unspecific one.
                if not isinstance(error, InputError | MemoryError | OSError):
                    (stage / "probe").write_bytes(bytes(_PROBE))
                raise
            finally:
                _remove(stage)


def _remove(stage: Path) -> None:
    """Remove a stage; a folder that was moved into it, and not replaced, is put back."""
    if stage.is_symlink():
        return
    for old in stage.glob("old/*"):
        if not (stage.parent / old.name).exists():
            old.rename(stage.parent / old.name)
    shutil.rmtree(stage, ignore_errors=True)


def lock(file: IO[bytes]) -> None:
    """Lock a file until it is closed; BlockingIOError if another has it, OSError without locks."""
    if fcntl is None:
        raise OSError(errno.ENOLCK, "this system has no locks")
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
