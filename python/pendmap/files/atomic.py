"""Atomic writing of files and folders: each is complete or absent."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import signal
import stat
import threading
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError

try:
    import fcntl
except ImportError:  # without file locks, stages of killed processes cannot be recognised
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import IO

COMPLETE: Final[list[str]] = []  # Files written so far; the message of an interrupt names them
# Signals that ask the program to stop: Ctrl-C, kill and timeout, a terminal that was closed
STOPS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
# Name of a stage, the temporary folder in which files are written before they are moved
_STAGE: Final = re.compile(r"\.pendmap-[0-9a-f]{32}\.part")
_OWNER: Final = "owner"  # File in a stage that its process keeps locked
_PROBE: Final = 2**20  # Bytes of a trial write, which fails on a full disk, and of one read
_LEAST: Final = 4096  # Bytes of the trial write before a computation: one block of most disks


@contextlib.contextmanager
def held_interrupts() -> Iterator[None]:
    """Delay SIGINT, SIGTERM and SIGHUP until the end of the block, then raise the first one.

    An interrupted library may keep its locks and deadlock (NetCDF's does). Outside the main
    thread, which receives no signals, nothing is done.
    """
    if threading.current_thread() is not threading.main_thread():
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
    """Yield a temporary path with the same file name; move its file to ``path`` at the end.

    ``path`` always holds either the complete new file or its previous content. Raises InputError
    for suffixes other than ``suffixes`` (lower case), OSError if nothing can be written, also if a
    library raises another error for it. An interrupt is delayed until the file is in place.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in suffixes:
        known = " or ".join(suffixes)
        raise InputError(f"cannot write {str(target)!r}: suffix must be {known}, got {suffix!r}")
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(target))
    with _named(target), _stage(target.parent) as stage:
        part = stage / target.name
        part.touch()
        with _disk_faults(part):
            yield part
        synced(part)
        part.replace(target)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path for a new folder; move the folder to ``path`` at the end.

    A folder at ``path`` is kept until the new one is complete, and then removed; the caller checks
    that it may be. Symbolic links are followed. Raises OSError if nothing can be written. An
    interrupt is delayed until the folder is in place.
    """
    target = Path(path).resolve()
    with _named(Path(path)), _stage(target.parent) as stage:
        new = stage / "new" / target.name
        new.parent.mkdir()
        with _disk_faults(stage / "probe"):
            yield new
        synced(new)
        _replace(target, new, stage)


def move_folder(new: Path, target: Path) -> None:
    """Move a folder to ``target``, on the same disk; a folder there is removed after that."""
    synced(new)
    with _named(target), _stage(target.parent) as stage:
        _replace(target, new, stage)


def _replace(target: Path, new: Path, stage: Path) -> None:
    old = stage / "old" / target.name
    old.parent.mkdir()
    if target.exists():
        target.rename(old)
    try:
        new.rename(target)
    except OSError:
        _put_back(stage)
        raise
    _sync(target.parent)


def synced(path: Path) -> None:
    """Write a file, or a folder with all that is in it, from the memory of the system to disk."""
    for folder, _, names in os.walk(path) if path.is_dir() else ():
        for name in names:
            _sync(Path(folder, name))
        _sync(Path(folder))
    if not path.is_dir():
        _sync(path)


def _sync(path: Path) -> None:
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
    """Raise OSError if a file or folder of ``size`` bytes cannot be written.

    Checks the parent folder, the permission and the free space before anything is computed.
    """
    target = Path(path)
    with _named(target), _stage(target.parent) as stage:
        probe = stage / "probe" / target.name
        probe.parent.mkdir()
        probe.write_bytes(bytes(_LEAST))
        free = shutil.disk_usage(stage).free
    if free < size:
        raise OSError(
            errno.ENOSPC,
            f"the disk has {free / 1e6:.0f} MB free, {size / 1e6:.0f} MB are needed",
            str(target),
        )


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
def _disk_faults(part: Path) -> Iterator[None]:
    """Raise the disk's own error in place of an unspecific one of a library."""
    try:
        yield
    except (InputError, MemoryError, OSError):
        raise
    except Exception:
        with part.open("ab") as stream:
            stream.write(bytes(_PROBE))
        raise


@contextlib.contextmanager
def _stage(folder: Path) -> Iterator[Path]:
    """Remove stages of killed processes; yield a new stage, which is removed at the end."""
    with held_interrupts():
        _sweep(folder)
        while True:
            stage = folder / f".pendmap-{uuid.uuid4().hex}.part"
            stage.mkdir()
            # A process that sweeps at the same moment may remove the new stage.
            with contextlib.suppress(FileNotFoundError):
                owner = (stage / _OWNER).open("xb")
                if _locked(owner) and (stage / _OWNER).exists():
                    break
                owner.close()
        with owner:
            try:
                yield stage
            finally:
                _remove(stage)


def _locked(owner: IO[bytes]) -> bool:
    """Lock the owner file of a stage; return False if another process holds the lock."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(owner, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        pass
    return True


def _sweep(folder: Path) -> None:
    """Remove stages of killed processes: those whose lock is free."""
    if fcntl is None:
        return
    for stage in folder.glob(".pendmap-*.part"):
        if not _STAGE.fullmatch(stage.name) or stage.is_symlink():
            continue
        with contextlib.suppress(OSError):
            if not (stage / _OWNER).exists():
                stage.rmdir()  # only if nothing is in it
                continue
            with (stage / _OWNER).open("r+b") as owner:
                fcntl.flock(owner, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _put_back(stage)
                _remove(stage)


def _put_back(stage: Path) -> None:
    """Restore a folder that was moved into a stage and not replaced."""
    for old in (stage / "old").glob("*"):
        if not (stage.parent / old.name).exists():
            old.rename(stage.parent / old.name)


def _remove(stage: Path) -> None:
    """Remove a stage, its lock last, so that a partial removal can be swept later."""
    for entry in stage.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry, ignore_errors=True)
        elif entry.name != _OWNER:
            entry.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        (stage / _OWNER).unlink()
        stage.rmdir()
