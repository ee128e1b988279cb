"""``dataset.pendmap``: figures of a result by an accessor of xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import xarray as xr

import pendmap

if TYPE_CHECKING:
    import pandas as pd


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

    def plot(self, ax: Any = None, **look: Any) -> Any:  # noqa: ANN401 (as plot.draw)
        """Draw one part of the result into Axes; arguments are those of ``pendmap.plot.draw``."""
        return pendmap.plot.draw(self._dataset, ax, **look)

    def to_dataframe(self, variable: str = "") -> pd.DataFrame:
        """Return a variable, by default the first with values, and others of its dimensions.

        >>> import pendmap
        >>> run = pendmap.orbit(pendmap.Pendulum(p=0.6), 1, 1)
        >>> run.pendmap.to_dataframe().kind.iloc[0]
        'rotation'
        """
        whole = self._dataset
        first = next((name for name, one in whole.data_vars.items() if one.dims and one.size), "")
        dims = whole[variable or first].dims
        return (
            whole[[n for n, one in whole.data_vars.items() if one.dims == dims]]
            .reset_coords(drop=True)
            .to_dataframe()
        )

    def figure(self, **look: Any) -> Any:  # noqa: ANN401 (as plot.figure)
        """Return the figure of the result; arguments are those of ``pendmap.plot.figure``."""
        return pendmap.plot.figure(self._dataset, **look)
