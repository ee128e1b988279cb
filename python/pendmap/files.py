"""Files that are complete or absent."""

from __future__ import annotations

import contextlib
import errno
import signal
import threading
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import tomli_w

from pendmap.errors import InputError

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from types import FrameType

__all__ = ["held_interrupts", "toml_text", "whole_file"]

_LONGEST: Final = 100
"""Characters of a line of TOML that a table within a table may take."""


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


def toml_text(content: Mapping[str, Any]) -> str:
    """Return TOML whose lists of tables are written ``[[name]]``, a line a key, as people do.

    Parameters
    ----------
    content : mapping of str
        Numbers, texts, lists and tables of TOML, tables in tables included.

    Raises
    ------
    TypeError, ValueError
        If something in it is nothing that TOML has.
    """
    parts = {key: value for key, value in content.items() if _is_table(value) or _tables(value)}
    head = {key: value for key, value in content.items() if key not in parts}
    blocks = [tomli_w.dumps(head)] if head else []
    for key, value in parts.items():
        if _tables(value):
            blocks += [_entry(key, table) for table in value]
        else:
            blocks.append(tomli_w.dumps({key: value}))
    return "\n".join(blocks)


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(map(_is_table, value))


def _entry(name: str, table: Mapping[str, Any]) -> str:
    """One ``[[name]]``; what is too long for a line is a table of its own after the others."""
    lines = {key: f"{_value({key: value})[2:-2]}\n" for key, value in table.items()}
    long = {
        key: value
        for key, value in table.items()
        if _is_table(value) and len(lines[key]) > _LONGEST
    }
    head = "".join(line for key, line in lines.items() if key not in long)
    further = (f"\n{tomli_w.dumps({name: {key: value}})}" for key, value in long.items())
    return "".join([f"[[{name}]]\n", head, *further])


def _value(value: object) -> str:
    """A value on one line."""
    if isinstance(value, Mapping):
        keys = {key: tomli_w.dumps({key: 0}).removesuffix(" = 0\n") for key in value}
        inside = ", ".join(f"{keys[key]} = {_value(part)}" for key, part in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").removesuffix("\n")
