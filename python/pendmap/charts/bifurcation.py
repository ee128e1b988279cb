"""Bifurcation diagrams as they are drawn: points, exponents and sweeps, coloured by attractor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pendmap.charts import basins, palette, plane
from pendmap.charts.legend import typeset

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr


MOST = 16
"""Families that a legend names; the rest are drawn in the grey of what has no name."""


@dataclass(frozen=True, eq=False)
class Family:
    """All attractors of a kind, period and winding.

    Attributes
    ----------
    name : str
        ``"rotation 1:+1"``.
    colour : str
        ``"#rrggbb"``.
    points : ndarray, shape (m, 3)
        Value, angle, velocity.
    exponents : ndarray, shape (k, 2)
        Value, largest exponent.
    up, down : ndarray of bool
        The values at which the sweeps are on one of them.
    """

    name: str
    colour: str
    points: npt.NDArray[np.float64]
    exponents: npt.NDArray[np.float64]
    up: npt.NDArray[np.bool_]
    down: npt.NDArray[np.bool_]

    @property
    def shade(self) -> str:
        """The colour in words."""
        return palette.describe(self.name) if self.colour != palette.UNNAMED else "grey"

    @property
    def rgb(self) -> tuple[int, int, int]:
        """The colour as red, green and blue."""
        return palette.parts(self.colour)

    @property
    def text(self) -> str:
        """Its line in a legend."""
        return typeset(self.name)


def families(dataset: xr.Dataset) -> list[Family]:
    """Return the families, those that occur at most values first.

    Chaos is among the :data:`MOST` that are named, however rare.
    """
    kind, n, w, value = (dataset[f"entry_{key}"].values for key in ("kind", "n", "w", "value"))
    keys = np.stack([kind, n, w], axis=1)
    every, which, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    which = which.reshape(-1)
    owner = dataset["point_entry"].values
    points = np.stack(
        [dataset[f"point_{key}"].values for key in ("value", "theta", "velocity")], axis=1
    )
    sweeps = {key: np.append(which, -1)[dataset[key].values] for key in ("up", "down")}
    found: list[Family] = []
    rare = np.array(["chaos" not in str(dataset["kind"].values[word]) for word in every[:, 0]])
    first = np.lexsort((-count, rare))[:MOST]
    for k in np.lexsort((-count, ~np.isin(np.arange(count.size), first))):
        word, period, turns = every[k]
        called = _name(str(dataset["kind"].values[word]), int(period), int(turns))
        mine = which == k
        exponents = np.stack([value[mine], dataset["entry_exponent"].values[mine]], axis=1)
        shade = palette.colour(called) if len(found) < MOST else palette.UNNAMED
        found.append(
            Family(
                called,
                shade,
                points[mine[owner]],
                exponents,
                sweeps["up"] == k,
                sweeps["down"] == k,
            )
        )
    return found


def _name(kind: str, n: int, w: int) -> str:
    """Return an attractor's name from that of its kind."""
    family = kind.rpartition(" ")[0]
    if kind.startswith("oscillation"):
        return f"oscillation {n}:0"
    if family == "rotation":
        return f"rotation {n}:{w:+d}"
    return f"{kind} {'+' if w > 0 else '-'}" if w and n == 0 else kind


def name(dataset: xr.Dataset) -> str:
    """Return the name of the parameter with its unit."""
    own = str(dataset.attrs["varied"])
    return basins.symbol(own, str(dataset[own].attrs.get("units", "1")))


def across(dataset: xr.Dataset) -> tuple[float, float]:
    """Return the outer edges of the parameter's values."""
    return plane.outer_edges(dataset, str(dataset.attrs["varied"]))


def title(dataset: xr.Dataset) -> str:
    """Return the title of a figure."""
    return f"Bifurcations over {name(dataset).split(' (')[0]}"


def subtitle(dataset: xr.Dataset) -> str:
    """Return what does not vary."""
    own = str(dataset.attrs["varied"])
    count, starts = dataset.sizes[own], int(dataset.attrs["starts"])
    fixed = basins.parameters(dataset.attrs, [own])
    return f"{fixed};   {count} values, {starts} starts each"
