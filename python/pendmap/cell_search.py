"""How each of many pendulums is searched for attractors: from which starts, how long, how well."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap import _core, checks
from pendmap.grid import FASTEST, Axis, Grid
from pendmap.model.units import VELOCITY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.model.units import Units

__all__ = ["STARTS", "CellSearch", "spread"]

STARTS = 9
"""Initial conditions of a cell where nothing is said."""
_SPREAD = 1000
_PLASTIC = 1.324717957244746
_CELLS = 61
"""After so many cells initial conditions come again: a prime, so that columns differ too."""


def spread(grid: Grid, count: int, seed: int = 0) -> tuple[NDArray[np.float64], ...]:
    """Return initial conditions that cover a box evenly: an additive recurrence.

    No two of them are mirror images of one another, so that none is wasted on a symmetric pendulum.

    Parameters
    ----------
    grid : Grid
        The box; its cells do not matter.
    count : int
        How many.
    seed : int
        Shifts them.

    Returns
    -------
    theta, velocity : ndarray, shape (count,)
    """
    shift = 0.5 + (seed * 0.6180339887498949) % 1.0
    # Not the box's centre, where a pendulum hangs at rest and stays however unstable that is.
    k = 1 + np.arange(count)
    parts = [(shift + k / _PLASTIC**power) % 1.0 for power in (1, 2)]
    ends = [(axis.low, axis.high - axis.low) for axis in (grid.theta, grid.velocity)]
    theta, velocity = (low + width * part for (low, width), part in zip(ends, parts, strict=True))
    return theta, velocity


@dataclasses.dataclass(frozen=True)
class CellSearch:
    """What a user chose, checked.

    Parameters
    ----------
    starts : int
        Initial conditions of each pendulum.
    box : Grid or None
        Where they lie; None: the box of :func:`pendmap.basins`.
    tol, max_periods, threads, seed
        As of :func:`pendmap.parameter_map`.

    Raises
    ------
    InputError
        If a value is outside its range.
    """

    starts: int
    box: Grid | None
    tol: float
    max_periods: int | None
    threads: int | None
    seed: int

    def __post_init__(self) -> None:
        checks.whole("starts", self.starts, 1, checks.MOST_CELLS)
        checks.whole("seed", self.seed, 0, checks.MOST_SEED)
        checks.number("tol", self.tol)
        if self.threads is not None:
            checks.whole("threads", self.threads, 1, checks.MOST_THREADS)
        if self.max_periods is not None:
            checks.whole("max_periods", self.max_periods, 1, checks.MOST_PERIODS)
        if self.box is not None:
            checks.of_type("box", self.box, Grid, "Grid.square(100)")

    def within(self, units: Units) -> Grid:
        """Return the box, in these units."""
        if self.box is not None:
            return self.box
        reach = units.given(FASTEST, VELOCITY)
        return Grid(Axis(-math.pi, math.pi, _SPREAD), Axis(-reach, reach, _SPREAD))

    def initial(self, units: Units) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return initial conditions without dimensions; each cell takes those after the last's."""
        theta, velocity = spread(self.within(units), _CELLS * self.starts, self.seed)
        return theta, units.bare(velocity, VELOCITY)

    @property
    def workers(self) -> int:
        """Number of threads as the core takes it."""
        return self.threads or 0

    def attributes(self, raw: dict[str, Any], units: Units) -> dict[str, Any]:
        """Return what a dataset says of the search whose result is ``raw``."""
        box = self.within(units)
        return {
            "starts": self.starts,
            "low_theta": box.theta.low,
            "high_theta": box.theta.high,
            "low_velocity": box.velocity.low,
            "high_velocity": box.velocity.high,
            "tol": self.tol,
            "reached_error": raw["reached_error"],
            "searched_again": raw["searched_again"],
            "undecided": float(raw["undecided"].mean()),
            "chaos_periods": min((int(n) for n in raw["chaos_periods"] if n), default=0),
            "failed": float(raw["failed"].mean()),
            "seed": self.seed,
            "threads": self.workers or _core.default_threads(),
            "simd": raw["simd"],
        }
