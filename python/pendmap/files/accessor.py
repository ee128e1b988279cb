"""``dataset.pendmap``: figures and the table of a result by an accessor of xarray."""

from __future__ import annotations

import itertools
from typing import Any, Final

import xarray as xr

import pendmap

_ROWS: Final = {"bifurcation": "entry", "lifetime": "start", "tongues": "critical"}
"""Dimension of the rows of a table, where it is not that of the first variable."""
_SPREAD: Final = {"bound": ("low", "high"), "eigenvalue": ("1", "2"), "part": ("re", "im")}
"""Dimensions whose places become columns, and the ends of their names."""


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

    def plot(self, ax: Any = None, **look: Any) -> Any:  # noqa: ANN401 (as pendmap.plot)
        """Draw one part of the result into Axes; arguments are those of ``pendmap.plot``."""
        return pendmap.plot(self._dataset, ax, **look)

    def to_dataframe(self) -> Any:  # noqa: ANN401 (a pandas.DataFrame)
        """Return the result as a table with one row a cell, start, orbit, point or time.

        Columns are the variables over the rows; pairs like ``ci95`` and ``multipliers`` have a
        column each: ``ci95_low``, ``multipliers_1_re``.
        """
        whole = self._dataset.reset_coords(drop=True)
        some = {one.dims for one in whole.data_vars.values() if one.dims and one.size}
        first = next(one.dims for one in whole.data_vars.values() if one.dims in some)
        other = (_ROWS.get(whole.attrs["kind"], ""),)
        rows = other if other in some else first
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
