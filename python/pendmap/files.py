"""Files that are complete or absent."""

from __future__ import annotations

import contextlib
import errno
import signal
import threading
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

from pendmap.errors import InputError

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from types import FrameType

__all__ = ["held_interrupts", "whole_file"]


@contextlib.contextmanager
def held_interrupts() -> Iterator[None]:
    """Hold Ctrl-C back until the end of the block, then let it happen.

    An interrupt in the middle of a library that writes may leave its locks closed (NetCDF's, for
    one) and the program waiting for ever. Outside the main thread, where no interrupt arrives,
    nothing is done.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    held: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda number, frame: held.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if held:
            before(*held[0])


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], suffixes: Sequence[str]) -> Iterator[Path]:
    """Give a temporary place in the same folder and put it at ``path`` at the end.

    Whatever happens in between, ``path`` then holds either the whole new file or what it held
    before, and the temporary file is gone. An interrupt waits until the file is in its place.

    Parameters
    ----------
    path : str or path
        Where the file shall be in the end; an existing file is replaced.
    suffixes : sequence of str
        The suffixes allowed, lower case, with their dots.

    Yields
    ------
    Path
        Where to write; it has the same suffix.

    Raises
    ------
    InputError
        If the suffix is not one of ``suffixes``.
    FileNotFoundError, IsADirectoryError, PermissionError
        If the folder does not exist, the path is a folder, or nothing may be written there.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in suffixes:
        known = ", ".join(suffixes)
        raise InputError(f"cannot write {str(target)!r}: suffix {suffix!r}, allowed are {known}")
    if not target.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "the folder does not exist", str(target.parent))
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(target))
    part = target.with_name(f".{target.stem}-{uuid.uuid4().hex[:8]}.part{suffix}")
    with held_interrupts():
        try:
            try:
                part.touch(exist_ok=False)
            except OSError as error:
                raise type(error)(error.errno, error.strerror, str(target)) from error
            yield part
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
