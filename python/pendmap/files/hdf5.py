"""HDF5 files that would let the library read other files: refused before it opens them.

Data outside the file are reached by an external link, by storage in external files, or by a virtual
dataset. The bytes of the file are searched for the messages that say so (HDF5 file format 3.0,
IV.A.2: g, h, i), wherever they stand; each hit is confirmed by what must follow it.
"""

from __future__ import annotations

import mmap
import re
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_MAGIC: Final = b"\x89HDF\r\n\x1a\n"
_LINK: Final = re.compile(rb"\x01([\x08-\x0f\x18-\x1f])\x40", re.DOTALL)
"""Beginning of the message of an external link: version, flags, type."""
_STORAGE: Final = b"\x01\x00\x00\x00"  # Beginning of the data of a message of external files
_STORAGE_TYPES: Final = (4, 6, 8)  # Places of its type before that, by the version of the header
_VIRTUAL: Final = b"\x04\x03"  # Layout of a virtual dataset: version, class
_HEAP: Final = re.compile(rb"FRHP\x00..(?!\x00\x00)", re.DOTALL)
"""Heap that is compressed: links in it cannot be seen."""


def check_alone(path: Path) -> None:
    """Raise InputError if an HDF5 file may refer to other files."""
    with path.open("rb") as file:
        head = file.read(len(_MAGIC))
        if head.startswith(b"CDF"):  # the classic format has one file
            return
        if head != _MAGIC:
            raise InputError(f"{path}: cannot be read as a result of pendmap: it is no NetCDF file")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if _refers(data):
                raise InputError(f"{path}: cannot be read: it refers to other files or is damaged")


def _refers(data: mmap.mmap) -> bool:
    version = data[8]
    sizes, base = (13, 24) if version < 2 else (9, 12)  # noqa: PLR2004 (places in the superblock)
    base += 4 if version == 1 else 0
    if data[sizes] != 8 or data[base : base + 8] != bytes(8):  # noqa: PLR2004 (bytes of an address)
        return True  # no library writes such files unasked, and addresses would be others
    if _HEAP.search(data):
        return True
    for at in _places(data, _STORAGE):
        typed = any(data[max(at - before, 0)] == 7 for before in _STORAGE_TYPES)  # noqa: PLR2004
        if typed and _leads(data, at + 8, b"HEAP"):
            return True
    if any(_leads(data, at + 2, b"GCOL") for at in _places(data, _VIRTUAL)):
        return True
    return any(_is_link(data, hit.end(), hit[1][0]) for hit in _LINK.finditer(data))


def _places(data: mmap.mmap, text: bytes) -> Iterator[int]:
    at = data.find(text)
    while at >= 0:
        yield at
        at = data.find(text, at + 1)


def _leads(data: mmap.mmap, at: int, target: bytes) -> bool:
    """Return whether an address leads to a heap of names."""
    place = int.from_bytes(data[at : at + 8], "little")
    return place < len(data) and data[place : place + 4] == target


def _is_link(data: mmap.mmap, place: int, flags: int) -> bool:
    """Return whether a link follows: its name, then the names of a file and an object in it."""
    place += (8 if flags & 4 else 0) + (1 if flags & 16 else 0)
    size = 1 << (flags & 3)
    place += size + int.from_bytes(data[place : place + size], "little")
    value = int.from_bytes(data[place : place + 2], "little")
    names = data[place + 2 : place + 2 + value]
    return len(names) == value > 3 and names.count(0) == 3 and names[0] == names[-1] == 0  # noqa: PLR2004
