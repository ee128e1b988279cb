"""Results that are trees of dataclasses, as JSON and arrays; shared parts stay shared."""

from __future__ import annotations

import dataclasses
import datetime as dt
import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendmap.errors import InputError, short_repr

PACKAGE: Final = "pendmap."
"""Beginning of the modules whose classes a file may name."""
_INLINE: Final = 16  # Number of values up to which an array stands in the JSON
_MAKERS: Final[dict[str, Callable[[Any], Any]]] = {
    **{kind.__name__: kind for kind in (dict, tuple, set, frozenset, Path)},
    **{kind.__name__: kind.fromisoformat for kind in (dt.datetime, dt.date, dt.time)},
}


class Packed:
    """A tree as plain values for JSON, and its large arrays by name."""

    def __init__(self, value: object) -> None:
        self.arrays: dict[str, np.ndarray[Any, Any]] = {}
        self._seen: dict[int, int] = {}
        self._kept: list[object] = []  # holds what is seen, so that no id is used twice
        self.tree = self._plain(value)

    def _plain(self, value: Any) -> Any:  # noqa: ANN401, C901, PLR0911 (JSON, a line a type)
        match value:
            case np.generic():
                return self._plain(value.item())
            case None | bool() | int() | float() | str():
                return value
            case list():
                return [self._plain(part) for part in value]
            case Mapping():
                pairs = [[self._plain(k), self._plain(v)] for k, v in value.items()]
                return {"is": "dict", "of": pairs}
            case set() | frozenset():
                return {"is": type(value).__name__, "of": [self._plain(x) for x in sorted(value)]}
            case Path():
                return {"is": "Path", "of": str(value)}
            case dt.datetime() | dt.date() | dt.time():
                return {"is": type(value).__name__, "of": value.isoformat()}
        if id(value) in self._seen:
            return {"is": "same", "of": self._seen[id(value)]}
        place = len(self._kept)
        self._kept.append(value)
        if isinstance(value, tuple):
            name = _named(type(value)) if hasattr(value, "_fields") else "tuple"
            found: dict[str, Any] = {"is": name, "of": [self._plain(part) for part in value]}
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biufU":
            found = {"is": "array", "of": self._array(value), "dtype": value.dtype.str}
            found["shape"] = list(value.shape)
        elif dataclasses.is_dataclass(value) and _named(type(value)).startswith(PACKAGE):
            state = {name: self._plain(part) for name, part in vars(value).items()}
            found = {"is": _named(type(value)), "of": state}
        else:
            raise InputError(f"a result with {short_repr(value)} cannot be saved")
        self._seen[id(value)] = place
        return {**found, "at": place}

    def _array(self, value: np.ndarray[Any, Any]) -> list[Any] | str:
        """Return the values of a small array, or the name of a large one."""
        if value.size <= _INLINE or value.dtype.kind == "U":
            return list(value.ravel().tolist())
        name = f"array_{len(self.arrays)}"
        self.arrays[name] = value.astype(np.int8) if value.dtype.kind == "b" else value
        return name


def unpacked(tree: Any, arrays: Mapping[str, np.ndarray[Any, Any]]) -> Any:  # noqa: ANN401
    """Return the value that was packed; only classes of the package are made, none is called."""
    seen: dict[int, Any] = {}

    def made(node: Any) -> Any:  # noqa: ANN401 (any value)
        if isinstance(node, list):
            return [made(part) for part in node]
        if not isinstance(node, dict):
            return node
        of = node["of"]
        if node["is"] == "same":
            return seen[of]
        if node["is"] == "array":
            values = np.asarray(arrays[of] if isinstance(of, str) else of)
            value = np.ascontiguousarray(values.astype(node["dtype"]).reshape(node["shape"]))
        elif node["is"] in _MAKERS:
            value = _MAKERS[node["is"]](made(of) if isinstance(of, list) else of)
        else:
            parts = made(of) if isinstance(of, list) else {key: made(of[key]) for key in of}
            value = _instance(node["is"], parts)
        if "at" in node:
            seen[node["at"]] = value
        return value

    return made(tree)


def _named(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _instance(name: str, state: dict[str, Any] | list[Any]) -> Any:  # noqa: ANN401 (any class)
    """Return an instance of a dataclass or named tuple of the package with this state."""
    module, _, own = name.partition(":")
    if not module.startswith(PACKAGE):
        raise InputError(f"{short_repr(name)} is no class of pendmap")
    kind = getattr(importlib.import_module(module), own)
    if isinstance(state, list):
        return kind._make(state)
    fields = {field.name for field in dataclasses.fields(kind)}
    if not fields <= state.keys():
        lacking = ", ".join(sorted(fields - state.keys()))
        raise InputError(f"{own} lacks {lacking}: another version of pendmap wrote it")
    found = object.__new__(kind)
    found.__dict__.update(state)
    return found
