"""Reading of TOML up to a largest size, and writing with one key per line."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any, Final

import tomli_w

from pendmap.errors import InputError
from pendmap.files.atomic import read_whole

_MOST_TOML: Final = 2**22  # Largest size of a TOML file, bytes; a thousand runs take a tenth
_DEEPEST: Final = 20  # Most parts of a key: the time to read one grows with their square
_PART: Final = rb"""(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')[ \t]*"""
_DEEP: Final = re.compile(rb"(?<![\w-])(?:%b\.[ \t]*){%d}" % (_PART, _DEEPEST))


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file, with or without a byte order mark; raise InputError for anything else."""
    data = read_whole(path, _MOST_TOML)
    if _DEEP.search(data):
        raise InputError(f"{os.fspath(path)}: keys must have at most {_DEEPEST} parts, got more")
    try:
        return tomllib.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # too many digits are a ValueError
        reason = "it is no text" if isinstance(error, UnicodeDecodeError) else error
        raise InputError(f"{os.fspath(path)}: not a TOML file: {reason}") from None


def packaged(path: str) -> dict[str, Any]:
    """Return the content of a TOML file of this package, like ``tables/words.toml``."""
    return tomllib.loads(resources.files("pendmap").joinpath(path).read_text("utf-8"))


def toml_text(content: Mapping[str, Any]) -> str:
    """Return TOML, lists of tables as ``[[name]]``; TypeError for what TOML does not have."""
    plain: dict[str, Any] = {}
    blocks: list[str] = []
    for key, value in content.items():
        if isinstance(value, Mapping):
            blocks.append(tomli_w.dumps({key: value}))
        elif isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
            for table in value:
                lines = [_value({name: part})[2:-2] for name, part in table.items()]
                blocks.append("\n".join([f"[[{key}]]", *lines, ""]))
        else:
            plain[key] = value
    return "\n".join([*([tomli_w.dumps(plain)] if plain else []), *blocks])


def _value(value: object) -> str:
    """Return the TOML of a value on one line."""
    if isinstance(value, Mapping):
        inside = (f"{tomli_w.dumps({k: 0})[:-5]} = {_value(part)}" for k, part in value.items())
        return f"{{ {', '.join(inside)} }}" if value else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").removesuffix("\n")
