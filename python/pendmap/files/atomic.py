"""Files that are complete or absent."""

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
except ImportError:  # without locks no folder of another run is certainly left over
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from types import FrameType
    from typing import IO

# Names of the files that the running command has written: an interrupt names them
COMPLETE: Final[list[str]] = []
# Signals that ask the program to stop: Ctrl-C, kill and timeout, a terminal that was closed
STOPS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
# Name of a folder in which files are written before they take their places
_STAGE: Final = re.compile(r"\.pendmap-[0-9a-f]{32}\.part")
_OWNER: Final = "owner"  # File in a stage that its run keeps locked while it lives
# Bytes written on trial after a library failed to write: a full disk refuses them
_PROBE: Final = 2**20
_LEAST: Final = 4096  # Bytes written on trial before anything is computed: one block of most disks


@contextlib.contextmanager
def held_interrupts() -> Iterator[None]:
    """Hold signals that ask to stop back until the end of the block, then let them happen.

    An interrupt in the middle of a library that writes may leave its locks closed (NetCDF's, for
    one) and the program waiting for ever. Outside the main thread, where no signal arrives,
    nothing is done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []

    def hold(number: int, _: FrameType | None) -> None:
        held.append(number)

    before = {number: signal.getsignal(number) for number in STOPS}
    holding = [number for number in STOPS if before[number] not in (signal.SIG_IGN, None)]
    for number in holding:
        signal.signal(number, hold)
    try:
        yield
    finally:
        for number in reversed(holding):  # Ctrl-C last: it may raise at once
            signal.signal(number, before[number])
        if held:
            signal.raise_signal(held[0])


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], suffixes: Sequence[str]) -> Iterator[Path]:
    """Give a temporary place beside ``path`` to write in and put the file there at the end.

    Whatever happens in between, ``path`` then holds either the whole new file or what it held
    before, and nothing else is left. An interrupt waits until the file is in its place.

    Parameters
    ----------
    path : str or path
        Where the file shall be in the end; an existing file is replaced.
    suffixes : sequence of str
        The suffixes allowed, lower case, with their dots.

    Yields
    ------
    Path
        Where to write; it has the same name.

    Raises
    ------
    InputError
        If the suffix is not one of ``suffixes``.
    OSError
        If the folder does not exist, the path is a folder, nothing may be written there, or the
        disk takes no more, whatever error a library makes of that.
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
        part.replace(target)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary place beside ``path`` for a folder and put it there at the end.

    What ``path`` held stays until the new folder is whole, and goes then: whether it may be
    replaced is for the caller to check. An interrupt waits until the folder is in its place.

    Parameters
    ----------
    path : str or path
        Where the folder shall be in the end; of a link, where it leads.

    Yields
    ------
    Path
        Where to make the folder; it does not exist yet.

    Raises
    ------
    OSError
        If the folder above does not exist, nothing may be written there, or the disk takes no more.
    """
    target = Path(path).resolve()
    with _named(Path(path)), _stage(target.parent) as stage:
        new, old = (stage / kind / target.name for kind in ("new", "old"))
        new.parent.mkdir()
        old.parent.mkdir()
        with _disk_faults(stage / "probe"):
            yield new
        if target.exists():
            target.rename(old)
        try:
            new.rename(target)
        except OSError:
            _put_back(stage)
            raise


def read_whole(path: str | os.PathLike[str], most: int) -> bytes:
    """Read a file of at most ``most`` bytes; pipes and devices are refused, not waited for.

    Raises
    ------
    InputError
        If it is a pipe, a device, or longer.
    OSError
        If it cannot be read.
    """
    source = Path(path)
    _check_regular(source, source.stat().st_mode)
    with open(source, "rb", opener=_at_once) as stream:
        _check_regular(source, os.fstat(stream.fileno()).st_mode)
        data = bytearray()
        with _named(source):
            while len(data) <= most and (read := stream.read(_PROBE)):
                data += read
    if len(data) > most:
        raise InputError(f"{source}: must be a file up to {most / 2**20:g} MiB, it is larger")
    return bytes(data)


def check_regular(path: str | os.PathLike[str]) -> None:
    """Refuse what is no regular file: a folder, a pipe or a device.

    Raises
    ------
    InputError
        If it is a pipe or a device.
    OSError
        If it is a folder, or there is nothing.
    """
    _check_regular(Path(path), Path(path).stat().st_mode)


def _check_regular(source: Path, mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "must be a file, it is a folder", str(source))
    if not stat.S_ISREG(mode):
        raise InputError(f"{source}: must be a file, it is a pipe or a device")


def _at_once(name: str, flags: int) -> int:
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))


def check_room(path: str | os.PathLike[str], size: int = 0) -> None:
    """Refuse a place where no file can be written, before it is computed.

    Parameters
    ----------
    path : str or path
        The file or folder that shall be made.
    size : int
        Bytes that it will have at least.

    Raises
    ------
    OSError
        If the folder does not exist, nothing may be written there, or there is less space.
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
    """Let errors of the disk name the file that was asked for, not its temporary place."""
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
    """Give a hidden folder, removed at the end together with stages of runs that were killed."""
    with held_interrupts():
        _sweep(folder)
        stage, owner = _made(folder)
        try:
            yield stage
        finally:
            _remove(stage)
            owner.close()


def _made(folder: Path) -> tuple[Path, IO[bytes]]:
    """Make a stage and lock it; a run that sweeps at the same moment may take it away again."""
    while True:
        stage = folder / f".pendmap-{uuid.uuid4().hex}.part"
        stage.mkdir()
        try:
            owner = (stage / _OWNER).open("xb")
        except FileNotFoundError:
            continue
        if _locked(owner) and (stage / _OWNER).exists():
            return stage, owner
        owner.close()


def _locked(owner: IO[bytes]) -> bool:
    """Lock a stage's file for this run, unless another one holds it."""
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
    """Remove the stages of runs that were killed: those whose lock nobody holds."""
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
    """Restore a folder that was to be replaced where nothing took its place."""
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
