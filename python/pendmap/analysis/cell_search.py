"""Search for attractors in each of many models: what it is asked, and what it found."""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import find_objects, label

from pendmap.analysis import result
from pendmap.analysis.along import DRIVE
from pendmap.analysis.grid import Grid
from pendmap.analysis.orbit_table import DESCRIBED, described
from pendmap.analysis.result import Field, Found, point
from pendmap.errors import (
    MOST_CELLS,
    check_type,
    check_whole,
)
from pendmap.files.variables import variable
from pendmap.formatting import counted, percent
from pendmap.units import RATE, VELOCITY

if TYPE_CHECKING:
    from collections.abc import Hashable, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap import _core
    from pendmap.analysis.numerics import Numerics
    from pendmap.signal import Floats
    from pendmap.units import Units

CHAOS_PERIODS = ("time for which the chaos was not captured", "0: no chaos")  # Name, comment
_SPREAD = 1000  # Cells on each side of the default box, without effect
_PLASTIC = 1.324717957244746
"""Plastic number, whose powers give an even additive recurrence in two dimensions."""
_CELLS = 61  # Cells after which initial conditions repeat: a prime, so that columns differ too
UNDECIDED = "undecided"  # Kind of a cell in which no attractor was found


def spread(grid: Grid, count: int, seed: int = 0) -> tuple[Floats, ...]:
    """Return angles and velocities that cover a box evenly; no two are mirror images."""
    shift = 0.5 + (seed * 0.6180339887498949) % 1.0
    # k = 0 may be the centre, where a pendulum at rest stays even if that is unstable.
    k = 1 + np.arange(count)
    parts = [(shift + k / _PLASTIC**power) % 1.0 for power in (1, 2)]
    ends = [(axis.low, axis.high - axis.low) for axis in (grid.theta, grid.velocity)]
    theta, velocity = (low + width * part for (low, width), part in zip(ends, parts, strict=True))
    return theta, velocity


@dataclasses.dataclass(frozen=True)
class CellSearch:
    """Starts of the search for attractors in each of many pendulums, checked."""

    starts: int
    box: Grid | None
    numerics: Numerics

    def __post_init__(self) -> None:
        check_whole("starts", self.starts, 1, MOST_CELLS)
        if self.box is not None:
            check_type("box", self.box, Grid, "Grid.square(100)")

    @property
    def request(self) -> dict[str, Any]:
        """The arguments that determine the search."""
        return {"starts": self.starts, "box": self.box, **self.numerics.request}

    def within(self, units: Units) -> Grid:
        """Return the box, in these units; by default that of :func:`pendmap.basins`."""
        return self.box or Grid.square(_SPREAD, units.given(1.0, VELOCITY))

    def initial(self, units: Units) -> tuple[Floats, Floats, int]:
        """Return initial conditions without dimensions, and how many of them each cell takes."""
        theta, velocity = spread(self.within(units), _CELLS * self.starts, self.numerics.run.seed)
        return theta, units.bare(velocity, VELOCITY), self.starts

    def attributes(self, raw: _core.ParameterMap, units: Units) -> dict[str, Any]:
        """Return the attributes of the search whose result is ``raw``."""
        return {
            **self.numerics.provenance(),
            **self.within(units).attributes,
            "starts": self.starts,
            "missed": result.missed(self.starts),
            "undecided": float(raw.undecided.mean()),
            "chaos_periods": min((int(n) for n in raw.chaos_periods if n), default=0),
            "failed": float(raw.failed.mean()),
        }


def undecided_cells(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return groups of touching cells with undecided starts, the largest first."""
    share = dataset["undecided"]
    groups, _ = label(share.values > 0, structure=np.ones((3,) * share.ndim))
    regions = []
    for number, box in enumerate(find_objects(groups), 1):
        mine = groups == number
        ranges = {
            str(name): (float(dataset[name].values[at][0]), float(dataset[name].values[at][-1]))
            for name, at in zip(reversed(share.dims), reversed(box), strict=True)
        }
        mean = float(share.values[mine].mean())
        regions.append({"ranges": ranges, "cells": int(mine.sum()), "undecided": mean})
    return sorted(regions, key=lambda one: -one["cells"])


def regimes(
    raw: _core.ParameterMap, cells: int
) -> tuple[list[tuple[int, ...]], NDArray[np.int16], Floats]:
    """Return the sets of kinds, the most frequent first; the set of each cell; their shares."""
    bounds = np.searchsorted(raw.cell, np.arange(cells + 1))
    of_cell = [
        tuple(np.unique(raw.kind[low:high]).tolist()) for low, high in itertools.pairwise(bounds)
    ]
    count = Counter(of_cell)
    # Those without any attractor are the last of equally frequent ones.
    sets = sorted(count, key=lambda one: (-count[one], one or (len(raw.kinds),)))
    place = {one: k for k, one in enumerate(sets)}
    share = np.array([count[one] / cells for one in sets])
    return sets, np.array([place[one] for one in of_cell], dtype=np.int16), share


def names(raw: _core.ParameterMap) -> list[str]:
    """Return the names of all kinds of attractor, rest first, chaos last."""
    return [one.name for one in raw.kinds]


def entries(raw: _core.ParameterMap, units: Units) -> dict[str, Any]:
    """Return all attractors, each with the index of its kind, over ``entry``."""
    one, rate, speed = "entry", units.of_rate, units.of_velocity
    velocity = units.given(raw.velocity, VELOCITY)
    growth, error = (units.given(values, RATE) for values in (raw.exponent, raw.exponent_stderr))
    place, meanings = "cell of the whole result, row by row", dict(enumerate(names(raw)))
    return {
        **described(raw.kinds, "kind", "kind_"),
        "entry_cell": variable(one, raw.cell, "1", place),
        "entry_kind": variable(one, raw.kind, "", "kind of attractor", flags=meanings),
        "entry_n": variable(one, raw.n, *DESCRIBED["n"]),
        "entry_w": variable(one, raw.w, *DESCRIBED["w"]),
        **point(one, raw.theta, velocity, speed, "entry_{}"),
        "entry_exponent": variable(one, growth, rate, "largest Lyapunov exponent"),
        "entry_exponent_stderr": variable(one, error, rate, "standard error of the exponent"),
        "entry_share": variable(one, raw.share, "1", "share of the starts"),
    }


def shares(
    raw: _core.ParameterMap, dims: tuple[Hashable, ...], shape: tuple[int, ...]
) -> dict[str, Any]:
    """Return the shares of undecided and failed starts, and how long chaos was followed."""
    lost, failed, watched = (
        values.reshape(shape) for values in (raw.undecided, raw.failed, raw.chaos_periods)
    )
    return {
        "undecided": variable(dims, lost, "1", "share of the starts that no attractor captured"),
        "failed": variable(dims, failed, "1", "share of the starts that failed or diverged"),
        "chaos_periods": variable(dims, watched, "periods", *CHAOS_PERIODS),
    }


def missed(attributes: Mapping[str, Any], cells: int, cell: str) -> str:
    """Return a summary line on the attractors that the starts may have missed."""
    starts = attributes["starts"]
    one, every = (percent(100 * result.missed(count)) for count in (starts, starts * cells))
    return (
        f"{counted(starts, 'start')} a {cell} may miss attractors with {one} of the box, those of "
        f"all, which exchange what they find, with {every} (95 %)."
    )


def chaos(attributes: Mapping[str, Any]) -> list[str]:
    """Return a summary line on how long chaos was followed, if there is any."""
    periods = attributes["least_chaos_periods"]
    if not periods:
        return []
    line = (
        f"Chaos: not captured within {counted(periods, 'period')} (the smallest of all cells; "
        "chaos_periods contains each); a longer transient looks the same."
    )
    return [line]


def undecided(attributes: Mapping[str, Any]) -> list[str]:
    """Return summary lines on the shares of undecided and failed starts."""
    return [
        f"{100 * attributes[f'{key}_share']:.3g} % of the starts {word}."
        for key, word in (("undecided", "undecided"), ("failed", "failed or diverged"))
        if attributes[f"{key}_share"] > 0
    ]


SEARCH = (
    Field("starts", "1", "initial conditions of each pendulum"),
    Found("missed", "1", "share of the box that all starts of a cell miss at a chance of 5 %"),
    Found(
        "undecided",
        "1",
        "share of the starts that no attractor captured",
        variable="undecided_share",
    ),
    Found("failed", "1", "share of the starts that failed or diverged", variable="failed_share"),
    Found(
        "chaos_periods",
        "periods",
        "least time for which chaos was not captured; 0: no chaos",
        variable="least_chaos_periods",
    ),
    *DRIVE,
    *result.TIMED,
    result.REACHED,
    Field("undecided_at", "", "groups of cells with undecided starts", read=undecided_cells),
    *result.END,
    result.SECTION,
    *result.BOX,
    result.TOL.hidden,
    Found("searched_again", "1", "cells searched again for attractors of a neighbour", json=False),
    result.SEED.hidden,
    *result.VERSIONS,
)
"""Fields of a search for attractors in many pendulums."""
