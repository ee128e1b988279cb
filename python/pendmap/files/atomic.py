"""Whole files and folders: each is complete or absent; and checks of a path before it is used."""

from __future__ import annotations

import contextlib
import errno
import os
import re
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
# Name of a stage, the temporary folder in which files are written before they are moved
_STAGE: Final = re.compile(r"\.pendmap-\w{8}\.part")
_OWNER: Final = "owner"  # File in a stage that its process keeps locked
_PROBE: Final = 2**20  # Bytes of a trial write, which fails on a full disk, and of one read
_LEAST: Final = 4096  # Bytes of the trial write before a computation: one block of most disks


@contextlib.contextmanager
def held_interrupts() -> Iterator[None]:
    """Delay the signals that stop until the end of the block: a library may deadlock on them."""
    if threading.current_thread() is not threading.main_thread():  # it receives no signals
        yield
        return
    held: list[int] = []
    before = {number: signal.getsignal(number) for number in STOPS}
    holding = [number for number in STOPS if before[number] not in (signal.SIG_IGN, None)]
    for number in holding:
        signal.signal(number, lambda number, _: held.append(number))
    try:
        yield
    finally:
        for number in reversed(holding):  # Ctrl-C last: it may raise at once
            signal.signal(number, before[number])
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
    with _stage(Path(path), target.parent) as stage:
        new, old = (stage / kind / target.name for kind in ("new", "old"))
        new.parent.mkdir()
        old.parent.mkdir()
        yield new
        for folder, _, names in os.walk(new):
            for name in (*names, "."):
                _sync(Path(folder, name))
        if target.exists():
            target.rename(old)
        try:
            new.rename(target)
        except OSError:
            _put_back(stage)
            raise
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
    source = Path(path)
    check_regular(source)
    at_once = getattr(os, "O_NONBLOCK", 0)  # do not block if a pipe has replaced the file
    with open(source, "rb", opener=lambda name, flags: os.open(name, flags | at_once)) as stream:
        check_regular(source, stream.fileno())
        data = bytearray()
        with _named(source):
            while len(data) <= most and (read := stream.read(_PROBE)):
                data += read
    if len(data) > most:
        raise InputError(f"{source}: must be a file up to {most / 2**20:g} MiB, it is larger")
    return bytes(data)


def check_regular(path: str | os.PathLike[str], descriptor: int | None = None) -> None:
    """Raise OSError for a folder or a missing file, InputError for a pipe or a device."""
    status = Path(path).stat() if descriptor is None else os.fstat(descriptor)
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, "must be a file, it is a folder", str(path))
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path}: must be a file, it is a pipe or a device")


def check_room(path: str | os.PathLike[str], size: int = 0) -> None:
    """Raise OSError if a file or folder of ``size`` bytes cannot be written there."""
    target = Path(path)
    with _stage(target) as stage:
        (stage / target.name).write_bytes(bytes(_LEAST))
        free = shutil.disk_usage(stage).free
    if free < size:
        needed = f"the disk has {free / 1e6:.0f} MB free, {size / 1e6:.0f} MB are needed"
        raise OSError(errno.ENOSPC, needed, str(target))


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
def _stage(target: Path, folder: Path | None = None) -> Iterator[Path]:
    """Yield a new folder beside a path, removed at the end; interrupts wait until then."""
    folder = folder or target.parent
    with held_interrupts(), _named(target):
        for other in folder.glob(".pendmap-*.part"):
            if _STAGE.fullmatch(other.name) and not other.is_symlink():
                with contextlib.suppress(OSError), (other / _OWNER).open("rb+") as owner:
                    lock(owner)  # its process was killed
                    _put_back(other)
                    shutil.rmtree(other)
        new = Path(tempfile.mkdtemp(".part", ".pendmap_", folder))
        with (new / _OWNER).open("wb") as owner:
            with contextlib.suppress(OSError):
                lock(owner)
            stage = new.rename(folder / f".pendmap-{new.name.removeprefix('.pendmap_')}")
            try:
                yield stage
            except (InputError, MemoryError, OSError):
                raise
            except Exception:  # the disk's own error is raised in place of an unspecific one
                (stage / "probe").write_bytes(bytes(_PROBE))
                raise
            finally:
                shutil.rmtree(stage, ignore_errors=True)


def lock(file: IO[bytes]) -> None:
    """Lock a file until it is closed; BlockingIOError if another has it, OSError without locks."""
    if fcntl is None:
        raise OSError(errno.ENOLCK, "this system has no locks")
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _put_back(stage: Path) -> None:
    """Put back a folder that was moved into a stage and not replaced."""
    for old in stage.glob("old/*"):
        if not (stage.parent / old.name).exists():
            old.rename(stage.parent / old.name)
