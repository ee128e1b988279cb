"""Grids of initial conditions."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from pendmap.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Axis", "Grid"]

MOST_CELLS = 100_000


@dataclasses.dataclass(frozen=True)
class Axis:
    """``count`` equal cells between ``low`` and ``high``; values are the cells' centres.

    Raises
    ------
    InputError
        If the bounds are not finite and in order, or the count is not 1 to 100000.
    """

    low: float
    high: float
    count: int

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"bounds {self.low:g}:{self.high:g}: allowed are two finite bounds, the lower first"
            )
        if not 1 <= self.count <= MOST_CELLS:
            raise InputError(f"{self.count} cells: allowed are 1 to {MOST_CELLS}")

    @property
    def centres(self) -> NDArray[np.float64]:
        """Centres of the cells, shape (count,)."""
        index = np.arange(self.count, dtype=np.float64)
        return self.low + (index + 0.5) * ((self.high - self.low) / self.count)

    @property
    def bounds(self) -> dict[str, float]:
        """The outer edges, as attributes of a coordinate."""
        return {"low": float(self.low), "high": float(self.high)}

    @property
    def as_tuple(self) -> tuple[float, float, int]:
        """``(low, high, count)``."""
        return (float(self.low), float(self.high), int(self.count))


@dataclasses.dataclass(frozen=True)
class Grid:
    """Cells of the plane of initial conditions.

    Parameters
    ----------
    theta : Axis
        Angle, rad.
    velocity : Axis
        Velocity ``d theta / d tau``.
    """

    theta: Axis = Axis(-math.pi, math.pi, 1000)
    velocity: Axis = Axis(-3.0, 3.0, 1000)

    @classmethod
    def square(cls, count: int) -> Grid:
        """Return the default window with ``count`` cells on each side."""
        return cls(Axis(-math.pi, math.pi, count), Axis(-3.0, 3.0, count))

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.theta.count * self.velocity.count
