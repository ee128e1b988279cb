"""Results of records as datasets: tables and arrays as named variables, all else as JSON."""

from __future__ import annotations

import abc
import dataclasses
import importlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.errors import InputError, short_repr
from pendmap.files.toml import packaged
from pendmap.files.variables import CONVENTIONS, FORMAT_VERSION, flag, variable
from pendmap.formatting import Readable

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    About = list[str] | dict[str, list[str]]
    """Dimensions (separated by spaces), unit and meaning of arrays; by name, of a matrix's rows."""

_TABLES: Final = packaged("files/saved.toml")
COLUMNS: Final[dict[str, dict[str, str]]] = _TABLES["columns"]
"""Meaning of the columns of a table, by the dimension of its rows."""
_ARRAYS: Final[dict[str, About]] = _TABLES["arrays"]  # that become variables, by class and field
_PACKAGE: Final = "pendmap."  # Beginning of the modules whose classes a file may name
_LEFT_OUT: Final = {"experiment", "data", "joint", "fit"}  # Fields that names of variables lack
_PLAIN: Final[dict[str, Any]] = {"dict": dict, "list": list, "tuple": tuple, "Path": Path}


class Saved(Readable):
    """A result that a file can hold."""

    KIND: ClassVar[str]  # Its kind in files
    ROWS: ClassVar[str]  # The dimension of its table in files

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
        packed, further = _Packed(), self.further()
        attributes = {
            "Conventions": CONVENTIONS,
            "kind": self.KIND,
            "format_version": FORMAT_VERSION,
            "title": repr(self),
            "summary": str(self),
            "source": f"pendmap {_core.__version__}",
            "pendmap_version": _core.__version__,
            "content": json.dumps(packed.plain(self)),
        }
        data = packed.variables() | further
        table = self.to_dataframe().reset_index()
        for name, column in table.items() if len(table) else ():
            values = column.to_numpy()
            values = values if values.dtype.kind in "biuf" else values.astype(str)
            data[str(name)] = variable(self.ROWS, values, "", COLUMNS[self.ROWS][str(name)])
        return xr.Dataset(data, attrs=attributes)


class _Packed:
    """Parts of a result as JSON, and their arrays by the names of variables."""

    def __init__(self) -> None:
        self._arrays: dict[str, list[tuple[str, NDArray[Any]]]] = {}  # each with its run's name
        self._about: dict[str, list[str]] = {}
        self._seen: dict[int, Any] = {}  # parts with their numbers, so that no id is used twice

    def plain(  # noqa: C901 (a branch a type)
        self, value: Any, path: tuple[str, ...] = (), label: str = "", about: About | None = None
    ) -> Any:
        """Return a value for JSON; ``path`` are the names of its fields, ``label`` of its run."""
        if isinstance(value, np.generic):
            value = value.item()
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, np.ndarray):
            return self._array(value, path, label, about)
        if id(value) in self._seen:
            return {"is": "same", "of": self._seen[id(value)][0]}
        place = len(self._seen)
        self._seen[id(value)] = place, value
        of: Any = []
        if isinstance(value, Mapping):
            kind = "dict"
            for key, part in value.items():
                inner = (*path, str(key)) if about else path
                of.append([self.plain(key), self.plain(part, inner, str(key), about)])
        elif isinstance(value, list | tuple):
            kind = "list" if isinstance(value, list) else "tuple"
            for k, part in enumerate(value):
                name = getattr(part, "name", getattr(getattr(part, "run", None), "name", None))
                item = name if isinstance(name, str) else f"{label} {k}".strip()
                of.append(self.plain(part, path, item, about))
        elif isinstance(value, Path):
            kind, of = "Path", str(value)
        elif dataclasses.is_dataclass(value) and type(value).__module__.startswith(_PACKAGE):
            kind = f"{type(value).__module__}:{type(value).__qualname__}"
            for name, part in vars(value).items():
                described = _ARRAYS.get(f"{type(value).__name__}.{name}")
                of.append([name, self.plain(part, (*path, name), label, described)])
        else:
            raise InputError(f"a result with {short_repr(value)} cannot be saved")
        return {"is": kind, "of": of, "at": place}

    def _array(
        self, value: NDArray[Any], path: tuple[str, ...], label: str, about: About | None
    ) -> dict[str, Any]:
        """Return the place of an array in a variable, or its values if the table lacks it."""
        if isinstance(about, Mapping) and value.size:
            rows = zip(value, about.items(), strict=True)
            of = [self._array(row, (*path, name), label, one) for row, (name, one) in rows]
            return {"is": "rows", "of": of}
        node = {"is": "array", "shape": list(value.shape), "dtype": value.dtype.str}
        if not isinstance(about, list) or not value.size:
            return {**node, "of": value.ravel().tolist()}
        name = "_".join(part for part in path if part not in _LEFT_OUT)
        self._about[name] = about
        parts = self._arrays.setdefault(name, [])
        begin = sum(part.shape[-1] for _, part in parts)
        parts.append((label, value))
        return {**node, "of": name, "from": begin}

    def variables(self) -> dict[str, Any]:
        """Return the variables by name, and for those of several runs what tells them apart."""
        made: dict[str, Any] = {}
        dims: dict[tuple[str, tuple[int, ...]], str] = {}
        for name, parts in self._arrays.items():
            over, units, meaning = self._about[name]
            values = np.concatenate([part for _, part in parts], axis=-1)
            lengths = [*((n,) for n in values.shape[:-1]), tuple(p.shape[-1] for _, p in parts)]
            names: tuple[str, ...] = ()
            for key in zip(over.split(), lengths, strict=True):
                other = f"{name}_{key[0]}" if key[0] in dims.values() else key[0]
                names += (dims.setdefault(key, other),)
            if values.dtype.kind == "b":
                made[name] = flag(names, values, meaning)
            else:
                made[name] = variable(names, values, units, meaning)
            if len(parts) > 1:
                labels = {k: label for k, (label, _) in enumerate(parts)}
                owner = np.repeat(np.arange(len(parts), dtype=np.int16), lengths[-1])
                meaning = f"number of the run, method or statistic that a {names[-1]} belongs to"
                which = variable(names[-1], owner, "", meaning, flags=labels)
                made.setdefault(f"{names[-1]}_of", which)
        return made


def unpacked(content: str, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Return the result that was packed; only classes of the package are made, none is called."""
    seen: dict[int, Any] = {}

    def made(node: Any) -> Any:
        if not isinstance(node, dict):
            return [made(part) for part in node] if isinstance(node, list) else node
        kind, of = node["is"], node["of"]
        if kind == "same":
            return seen[of]
        if kind == "rows":
            return np.stack(made(of))
        if kind == "array":
            if "from" in node:
                of = arrays[of][..., node["from"] : node["from"] + node["shape"][-1]]
            values = np.asarray(of).astype(node["dtype"])
            return np.ascontiguousarray(values.reshape(node["shape"]))
        of = made(of)
        value = seen[node["at"]] = _PLAIN[kind](of) if kind in _PLAIN else _instance(kind, dict(of))
        return value

    return made(json.loads(content))


def _instance(name: str, state: dict[str, Any]) -> Any:
    """Return an instance of a dataclass of the package with this state."""
    module, _, short = name.partition(":")
    if not module.startswith(_PACKAGE):
        raise InputError(f"{short_repr(name)} is no class of pendmap")
    kind = getattr(importlib.import_module(module), short)
    if lacks := ", ".join({field.name for field in dataclasses.fields(kind)} - state.keys()):
        raise InputError(f"{short} lacks {lacks}: another version of pendmap wrote it")
    value = object.__new__(kind)
    value.__dict__.update(state)
    return value
