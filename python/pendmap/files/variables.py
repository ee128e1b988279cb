"""Results by the CF conventions 1.11: their variables, and the form that they have in files.

Units are those of UDUNITS-2; what it does not have is the unit 1 with its meaning in the long name.
"""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

import pendmap

if TYPE_CHECKING:
    from collections.abc import Hashable, Mapping

    import pandas as pd

    Variable = tuple[Hashable, Any, dict[str, Any]]  # Dimensions, values and attributes

CONVENTIONS: Final = "CF-1.11"
FORMAT_VERSION: Final = 3  # Version of the layout, in the attribute ``format_version``
MARKS: Final = frozenset(("format_version", "kind"))  # Attributes that mark a dataset as a result
NO_YES: Final = {0: "no", 1: "yes"}  # Meanings of a flag
_TEXT: Final = "_name"
"""Suffix of coordinates of text in files: by CF the coordinate of a dimension has numbers."""
_UDUNITS: Final = re.compile(r"(1|rad|m|mm|s|Hz)(/(rad|s)\d?)?")  # Units that UDUNITS-2 has too
_ROWS: Final = {"bifurcation": "entry", "lifetime": "start", "tongues": "critical"}
"""Dimension of the rows of a table, where it is not that of the first variable."""
_SPREAD: Final = {"bound": ("low", "high"), "eigenvalue": ("1", "2"), "part": ("re", "im")}
"""Dimensions whose places become columns, and the ends of their names."""
_NOT_IN_FLAGS: Final = re.compile(r"[^\w@.+-]", re.ASCII)  # Not allowed in ``flag_meanings``


def variable(  # noqa: PLR0913 (attributes of CF)
    dims: Hashable,
    values: Any,
    units: str = "",
    long_name: str = "",
    comment: str = "",
    *,
    flags: Mapping[int, str] | None = None,
    missing: int | None = None,
) -> Variable:
    """Return a variable with attributes of CF; ``flags`` are meanings, ``missing`` means none."""
    units = units.replace("^", "")
    if units and not _UDUNITS.fullmatch(units):
        units, long_name = "1", f"{long_name}, in {units}"
    texts = {"units": units, "long_name": long_name, "comment": comment}
    attributes: dict[str, Any] = {key: text for key, text in texts.items() if text}
    dtype = getattr(values, "dtype", None) or np.asarray(values).dtype  # reads no lazy array
    if flags is not None:
        attributes["flag_values"] = np.array([*flags], dtype=dtype)
        meanings = (_NOT_IN_FLAGS.sub("_", meaning) for meaning in flags.values())
        attributes["flag_meanings"] = " ".join(meanings)
    if missing is not None:
        attributes["_FillValue"] = dtype.type(missing)
    return dims, values, attributes


def flag(dims: Any, values: Any, long_name: str, flags: Mapping[int, str] = NO_YES) -> Variable:
    """Return a variable that is 0 or 1, or another small number with a meaning."""
    return variable(dims, np.asarray(values, dtype=np.int8), "", long_name, flags=flags)


def stored_form(dataset: xr.Dataset) -> tuple[xr.Dataset, dict[Hashable, dict[str, Any]]]:
    """Return a result as files have it by CF, and the encoding of its variables."""
    texts = [name for name in dataset.indexes if dataset[name].dtype.kind not in "iuf"]
    dataset = dataset.reset_index(texts).rename_vars({name: f"{name}{_TEXT}" for name in texts})
    # Coordinates have no missing values.
    floats = (name for name, one in dataset.coords.items() if one.dtype.kind == "f")
    return dataset, {name: {"_FillValue": None} for name in floats}


def restored(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset read as it is stored with the types and names that it had."""
    numbers = {name: one for name, one in dataset.attrs.items() if isinstance(one, np.generic)}
    dataset.attrs |= {name: one.item() for name, one in numbers.items()}
    for one in dataset.variables.values():
        if one.dtype.kind in "OT":
            one.data = np.array(one.to_numpy().tolist(), dtype=str)
        missing = one.attrs.pop("_FillValue", None)
        if missing is not None and one.dtype.kind in "iu":
            one.attrs["_FillValue"] = one.dtype.type(missing)
        if "flag_values" in one.attrs:  # one alone, or a list, became another type
            one.attrs["flag_values"] = np.atleast_1d(one.attrs["flag_values"]).astype(one.dtype)
        if "bounds" in one.encoding:
            one.attrs["bounds"] = one.encoding.pop("bounds")
    texts = {f"{name}{_TEXT}": name for name in dataset.dims if f"{name}{_TEXT}" in dataset}
    named = {name: dataset[text].variable for text, name in texts.items()}
    return dataset.drop_vars([*texts]).assign_coords(named)


@xr.register_dataset_accessor("pendmap")  # type: ignore[no-untyped-call]
class Accessor:
    """Accessor of a dataset that is a result of pendmap.

    >>> import pendmap
    >>> run = pendmap.simulate(pendmap.Pendulum(), 1.0, 0.0, 20.0)
    >>> run.pendmap.plot(layer="phase").get_xlabel()
    '$θ$ (rad)'
    >>> list(run.pendmap.to_dataframe().columns)
    ['theta', 'velocity', 'energy']
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def plot(self, ax: Any = None, **look: Any) -> Any:
        """Draw one part of the result into Axes; arguments are those of ``pendmap.plot``."""
        return pendmap.plot(self._dataset, ax, **look)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the result as a table with one row a cell, start, orbit, point or time.

        Columns are the variables over the rows; pairs like ``ci95`` and ``multipliers`` have a
        column each: ``ci95_low``, ``multipliers_1_re``.
        """
        whole = self._dataset.reset_coords(drop=True)
        some = [one.dims for one in whole.data_vars.values() if one.dims and one.size]
        other = (_ROWS.get(whole.attrs["kind"], ""),)
        rows = other if other in some else some[0]
        columns = {}
        for name, values in whole.data_vars.items():
            further = [dim for dim in values.dims if dim not in rows]
            if not (set(rows) <= set(values.dims) and set(further) <= _SPREAD.keys()):
                continue
            for ends in itertools.product(*(enumerate(_SPREAD[str(dim)]) for dim in further)):
                at = {dim: k for dim, (k, _) in zip(further, ends, strict=True)}
                columns["_".join([str(name), *(end for _, end in ends)])] = values.isel(at)
        table = xr.Dataset(columns).to_dataframe([*rows])
        texts = [name for name, values in columns.items() if values.dtype.kind not in "biuf"]
        return table.astype(dict.fromkeys(texts, "string"))
