"""``dataset.pendmap``: figures of a result by an accessor of xarray."""

from __future__ import annotations

from typing import Any

import xarray as xr

import pendmap


@xr.register_dataset_accessor("pendmap")  # type: ignore[no-untyped-call]
class Accessor:
    """Accessor of a dataset that is a result of pendmap.

    >>> import pendmap
    >>> run = pendmap.simulate(pendmap.Pendulum(), 1.0, 0.0, 20.0)
    >>> run.pendmap.plot(layer="phase").get_xlabel()
    '$θ$ (rad)'
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def plot(self, ax: Any = None, **look: Any) -> Any:  # noqa: ANN401 (as pendmap.plot)
        """Draw one part of the result into Axes; arguments are those of ``pendmap.plot``."""
        return pendmap.plot(self._dataset, ax, **look)

    def to_dataframe(self) -> Any:  # noqa: ANN401 (a pandas.DataFrame)
        """Return the first variable with values, and all of its dimensions, as a table."""
        whole = self._dataset.reset_coords(drop=True)
        dims = next(one.dims for one in whole.data_vars.values() if one.dims and one.size)
        return whole[[name for name in whole.data_vars if whole[name].dims == dims]].to_dataframe()
