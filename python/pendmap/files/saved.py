"""Results of records as datasets: tables and arrays as named variables, all else as JSON.

A table says which fields have arrays that become variables; arrays of several runs stand one after
the other along their last dimension.
"""

from __future__ import annotations

import abc
import dataclasses
import importlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.errors import InputError, short_repr
from pendmap.files.variables import CONVENTIONS, FORMAT_VERSION, flag, variable
from pendmap.formatting import Readable

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pandas as pd
    from numpy.typing import NDArray

    About = tuple[str, str, str] | Mapping[str, tuple[str, str, str]]
    """Dimensions (separated by spaces), unit and meaning of arrays; by name, of a matrix's rows."""

_PACKAGE: Final = "pendmap."
"""Beginning of the modules whose classes a file may name."""
_LEFT_OUT: Final = frozenset(("experiment", "data", "joint", "fit"))
"""Fields whose names are no part of the names of variables."""
_PLAIN: Final = {"dict": dict, "tuple": tuple, "Path": Path, "float": float}


class Saved(Readable):
    """A result that a file can hold."""

    KIND: ClassVar[str]
    """Its kind in files."""
    ROWS: ClassVar[str]
    """The dimension of its table in files."""
    COLUMNS: ClassVar[Mapping[str, str]]
    """Meaning of each column of its table; units are in the column ``unit``."""
    ARRAYS: ClassVar[Mapping[str, About]]
    """Arrays of its parts that are variables, by class and field."""

    @abc.abstractmethod
    def to_dataframe(self) -> pd.DataFrame:
        """Return the result as a table."""

    def further(self) -> dict[str, Any]:
        """Return further variables of the dataset."""
        return {}

    def to_dataset(self) -> xr.Dataset:
        """Return the result as a dataset, as files have it.

        Variables are the columns of :meth:`to_dataframe`, and the arrays of records, fits and
        statistics by name; those of several runs stand one after the other along one dimension. The
        attribute ``content`` is JSON of all that is no array.
        """
        summary, further = str(self), self.further()
        packed = _Packed(self, self.ARRAYS)
        data: dict[str, Any] = {**packed.variables(), **further}
        table = self.to_dataframe().reset_index()
        for name, column in table.items() if len(table) else ():
            values = column.to_numpy()
            values = values if values.dtype.kind in "biuf" else values.astype(str)
            data[str(name)] = variable(self.ROWS, values, "", self.COLUMNS[str(name)])
        attributes = {
            "Conventions": CONVENTIONS,
            "kind": self.KIND,
            "format_version": FORMAT_VERSION,
            "title": repr(self),
            "summary": summary,
            "source": f"pendmap {_core.__version__}",
            "pendmap_version": _core.__version__,
            "content": packed.content,
        }
        return xr.Dataset(data, attrs=attributes)


class _Packed:
    """A result as JSON (``content``) and variables; ``table`` has arrays by ``Class.field``."""

    def __init__(self, value: object, table: Mapping[str, About]) -> None:
        self._table = table
        self._parts: dict[str, list[tuple[str, NDArray[Any]]]] = {}
        self._about: dict[str, tuple[str, str, str]] = {}
        self._seen: dict[int, int] = {}
        self._alive: list[object] = []  # holds what is seen, so that no id is used twice
        self.content = json.dumps(self._plain(value), allow_nan=False)

    def _plain(  # noqa: C901, PLR0911 (a line a type)
        self,
        value: Any,  # noqa: ANN401 (a part of a result)
        path: tuple[str, ...] = (),
        label: str = "",
        about: About | None = None,
    ) -> Any:  # noqa: ANN401 (JSON)
        """Return a value for JSON; ``path`` are the names of its fields, ``label`` of its run."""
        match value:
            case np.generic():
                return self._plain(value.item())
            case float() if not math.isfinite(value):
                return {"is": "float", "of": str(value)}
            case None | bool() | int() | float() | str():
                return value
            case list():
                return self._items(value, path, label, about)
            case np.ndarray() if value.dtype.kind in "biufU":
                return self._array(value, path, label, about)
            case Path():
                return {"is": "Path", "of": str(value)}
            case Mapping():
                inner = {k: (*path, str(k)) if about else path for k in value}
                parts = [[k, self._plain(v, inner[k], str(k), about)] for k, v in value.items()]
                return {"is": "dict", "of": parts}
        if id(value) in self._seen:
            return {"is": "same", "of": self._seen[id(value)]}
        place = self._seen[id(value)] = len(self._alive)
        self._alive.append(value)
        if isinstance(value, tuple):
            return {"is": "tuple", "of": self._items(value, path, label, about), "at": place}
        kind = f"{type(value).__module__}:{type(value).__qualname__}"
        if not (dataclasses.is_dataclass(value) and kind.startswith(_PACKAGE)):
            raise InputError(f"a result with {short_repr(value)} cannot be saved")
        holder = type(value).__name__
        state = {
            name: self._plain(part, (*path, name), label, self._table.get(f"{holder}.{name}"))
            for name, part in vars(value).items()
        }
        return {"is": kind, "of": state, "at": place}

    def _items(
        self, values: Iterable[Any], path: tuple[str, ...], label: str, about: About | None
    ) -> list[Any]:
        """Return the items of a sequence, labelled by the name of each or of its run."""
        items = []
        for k, part in enumerate(values):
            name = getattr(part, "name", getattr(getattr(part, "run", None), "name", None))
            place = name if isinstance(name, str) else f"{label} {k}".strip()
            items.append(self._plain(part, path, place, about))
        return items

    def _array(
        self, value: NDArray[Any], path: tuple[str, ...], label: str, about: About | None
    ) -> dict[str, Any]:
        """Return the place of an array in a variable, or its values if the table lacks it."""
        if isinstance(about, Mapping) and value.size:
            pairs = zip(value, about.items(), strict=True)
            rows = [
                self._array(row, (*path, name), label, described)
                for row, (name, described) in pairs
            ]
            return {"is": "rows", "of": rows}
        node = {"is": "array", "shape": list(value.shape), "dtype": value.dtype.str}
        if not isinstance(about, tuple) or not value.size:
            return {**node, "of": [self._plain(x) for x in value.ravel().tolist()]}
        name = "_".join(part for part in path if part not in _LEFT_OUT)
        self._about[name] = about
        parts = self._parts.setdefault(name, [])
        begin = sum(part.shape[-1] for _, part in parts)
        parts.append((label, value))
        return {**node, "of": name, "from": begin}

    def variables(self) -> dict[str, Any]:
        """Return the variables by name, and for those of several runs what tells them apart."""
        made: dict[str, Any] = {}
        dims: dict[tuple[str, tuple[int, ...]], str] = {}
        for name, parts in self._parts.items():
            over, units, meaning = self._about[name]
            values = np.concatenate([part for _, part in parts], axis=-1)
            lengths = [*((n,) for n in values.shape[:-1]), tuple(p.shape[-1] for _, p in parts)]
            names = []
            for key in zip(over.split(), lengths, strict=True):
                other = f"{name}_{key[0]}" if key[0] in dims.values() else key[0]
                names.append(dims.setdefault(key, other))
            truth = values.dtype.kind == "b"
            made[name] = (
                flag(tuple(names), values, meaning)
                if truth
                else variable(tuple(names), values, units, meaning)
            )
            if len(parts) > 1:
                labels = {k: label for k, (label, _) in enumerate(parts)}
                owner = np.repeat(np.arange(len(parts), dtype=np.int16), lengths[-1])
                meaning = f"number of the run, method or statistic that a {names[-1]} belongs to"
                which = variable(names[-1], owner, "", meaning, flags=labels)
                made.setdefault(f"{names[-1]}_of", which)
        return made


def unpacked(content: str, arrays: Mapping[str, NDArray[Any]]) -> Any:  # noqa: ANN401 (a result)
    """Return the result that was packed; only classes of the package are made, none is called."""
    seen: dict[int, Any] = {}

    def made(node: Any) -> Any:  # noqa: ANN401 (any value)
        if isinstance(node, list):
            return [made(part) for part in node]
        if not isinstance(node, dict):
            return node
        of = node["of"]
        match node["is"]:
            case "same":
                return seen[of]
            case "rows":
                return np.stack(made(of))
            case "array":
                return _values(node, made(of) if isinstance(of, list) else arrays[of])
            case kind if kind in _PLAIN:
                value = _PLAIN[kind](made(of))
            case kind:
                value = _instance(kind, {name: made(part) for name, part in of.items()})
        if "at" in node:
            seen[node["at"]] = value
        return value

    return made(json.loads(content))


def _values(node: Mapping[str, Any], values: Any) -> NDArray[Any]:  # noqa: ANN401 (an array)
    """Return an array from the values of its node, or from its place in a variable."""
    if "from" in node:
        begin = node["from"]
        values = values[..., begin : begin + node["shape"][-1]]
    return np.ascontiguousarray(np.asarray(values).astype(node["dtype"]).reshape(node["shape"]))


def _instance(name: str, state: dict[str, Any]) -> Any:  # noqa: ANN401 (any class)
    """Return an instance of a dataclass of the package with this state."""
    module, _, short = name.partition(":")
    if not module.startswith(_PACKAGE):
        raise InputError(f"{short_repr(name)} is no class of pendmap")
    kind = getattr(importlib.import_module(module), short)
    fields = {field.name for field in dataclasses.fields(kind)}
    if not fields <= state.keys():
        lacking = ", ".join(sorted(fields - state.keys()))
        raise InputError(f"{short} lacks {lacking}: another version of pendmap wrote it")
    value = object.__new__(kind)
    value.__dict__.update(state)
    return value
