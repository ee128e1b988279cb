"""Files that are complete or absent."""

from __future__ import annotations

import contextlib
import errno
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

from pendmap.errors import InputError

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence

__all__ = ["whole_file"]


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], suffixes: Sequence[str]) -> Iterator[Path]:
    """Give a temporary place in the same folder and put it at ``path`` at the end.

    Whatever happens in between, an interrupt included, ``path`` then holds either the whole new
    file or what it held before, and the temporary file is gone.

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
    try:
        try:
            part.touch(exist_ok=False)
        except OSError as error:
            raise type(error)(error.errno, error.strerror, str(target)) from error
        yield part
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
