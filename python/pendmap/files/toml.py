"""TOML: read within bounds, written one key on a line."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from typing import Any, Final

import tomli_w

from pendmap.errors import InputError
from pendmap.files.atomic import read_whole

_LONGEST: Final = 100  # Characters of a line of TOML that a table within a table may take
# Bytes of the largest TOML file that is read: a thousand runs take a tenth of it
_MOST_TOML: Final = 2**22


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file, with the mark before it that editors on Windows put there.

    Raises
    ------
    InputError
        If it is no TOML, no regular file, or too large.
    OSError
        If it cannot be read.
    """
    data = read_whole(path, _MOST_TOML)
    try:
        return tomllib.loads(data.decode("utf-8-sig"))
    except (
        ValueError,
        RecursionError,
    ) as error:  # an integer of thousands of digits is a ValueError
        raise InputError(f"{os.fspath(path)}: not a TOML file: {error}") from None


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
    """Return one ``[[name]]``; values too long for a line follow as tables of their own."""
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
    """Return a value on one line."""
    if isinstance(value, Mapping):
        keys = {key: tomli_w.dumps({key: 0}).removesuffix(" = 0\n") for key in value}
        inside = ", ".join(f"{keys[key]} = {_value(part)}" for key, part in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").removesuffix("\n")
