"""Grids of initial conditions."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import MOST_CELLS, InputError, check_number, check_type, check_whole, short_repr
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.signal import Floats
    from pendmap.units import Units


FASTEST: Final = 3.0  # Largest velocity of the default window, in units of ``w0`` with a rig


@dataclasses.dataclass(frozen=True)
class Axis:
    """``count`` equal cells between ``low`` and ``high``; values are the cells' centres.

    Raises
    ------
    InputError
        If the bounds are not finite and in order, or the count is no whole number from 1 to 100000.
    """

    low: float
    high: float
    count: int

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            object.__setattr__(self, name, check_number(name, getattr(self, name)))
        if not 0 < self.high - self.low < math.inf:
            raise InputError(
                "bounds must be two finite numbers, the lower first, and a finite distance apart, "
                f"got {self.low:g}:{self.high:g}"
            )
        object.__setattr__(self, "count", check_whole("count", self.count, 1, MOST_CELLS))

    @classmethod
    def around(cls, name: str, values: ArrayLike) -> Axis:
        """Return the axis whose cells have these centres: ascending, evenly spaced, 2 or more."""
        centres = ascending(name, values)
        if centres.size < 2 or not evenly(centres):  # noqa: PLR2004 (one has no width)
            raise InputError(
                f"{name} must be 2 or more evenly spaced values, the centres of cells of one size, "
                f"or (low, high, count), got {short_repr(values)}: basins_of takes any starts"
            )
        half = 0.5 * float(centres[-1] - centres[0]) / (centres.size - 1)
        return cls(float(centres[0]) - half, float(centres[-1]) + half, centres.size)

    @property
    def centres(self) -> Floats:
        """Centres of the cells, shape (count,)."""
        index = np.arange(self.count, dtype=np.float64)
        return self.low + (index + 0.5) * ((self.high - self.low) / self.count)

    @property
    def edges(self) -> Floats:
        """Edges of the cells, shape (count + 1,)."""
        return np.linspace(self.low, self.high, self.count + 1)

    @property
    def as_tuple(self) -> tuple[float, float, int]:
        """``(low, high, count)``."""
        return (self.low, self.high, self.count)


@dataclasses.dataclass(frozen=True)
class Grid:
    """Cells of the plane of initial conditions.

    Parameters
    ----------
    theta : Axis, (low, high, count) or array_like, shape (N,)
        Angle, rad. ``low`` and ``high`` are the outer ends of the cells; an array or a list holds
        their centres, ascending and evenly spaced.
    velocity : Axis, (low, high, count) or array_like, shape (M,)
        Velocity ``d theta / d tau``, in rad/s for a :class:`pendmap.Rig`; likewise.

    Raises
    ------
    InputError
        If one is no axis, or values are not evenly spaced.

    Examples
    --------
    >>> import numpy as np
    >>> Grid(theta=np.linspace(-1, 1, 5), velocity=(0, 2, 4)).theta
    Axis(low=-1.25, high=1.25, count=5)
    """

    theta: Axis = Axis(-math.pi, math.pi, 1000)
    velocity: Axis = Axis(-3.0, 3.0, 1000)

    def __post_init__(self) -> None:
        for name in ("theta", "velocity"):
            axis = getattr(self, name)
            if isinstance(axis, tuple) and len(axis) == 3:  # noqa: PLR2004
                object.__setattr__(self, name, Axis(*axis))
            elif isinstance(axis, np.ndarray | Sequence) and not isinstance(axis, str):
                object.__setattr__(self, name, Axis.around(name, axis))
            else:
                check_type(name, axis, Axis, "Axis(-3, 3, 100) or np.linspace(-3, 3, 100)")

    @classmethod
    def square(cls, count: int, w0: float = 1.0) -> Grid:
        """Return the default window with ``count`` cells on each side.

        Velocities reach from ``-3 w0`` to ``3 w0``: with the ``w0`` of a :class:`pendmap.Rig` the
        window is the same as without dimensions.
        """
        fastest = FASTEST * check_number("w0", w0)
        return cls(Axis(-math.pi, math.pi, count), Axis(-fastest, fastest, count))

    @classmethod
    def of(cls, given: object, count: int, w0: float) -> Grid:
        """Return a grid as given, or the default window with ``count`` cells on each side."""
        if given is None or (isinstance(given, numbers.Integral) and not isinstance(given, bool)):
            side = count if given is None else check_whole("grid", given, 1, MOST_CELLS)
            return cls.square(side, w0)
        example = "100, Grid.square(100) or Grid(Axis(-pi, pi, 100), Axis(-3, 3, 100))"
        check_type("grid", given, cls, example)
        return given  # type: ignore[return-value]

    def coordinates(self, units: Units) -> dict[str, Any]:
        """Return coordinates of a dataset with a value for each cell."""
        angle, speed, named = self.theta, self.velocity, f"initial velocity {units.derivative}"
        return {
            **coordinate("theta", angle.centres, angle.edges, "rad", "initial angle"),
            **coordinate("velocity", speed.centres, speed.edges, units.of_velocity, named),
        }

    def bare(self, units: Units) -> tuple[tuple[float, float, int], tuple[float, float, int]]:
        """Return both axes as tuples, velocities without dimensions."""
        low, high = (units.bare(end, VELOCITY) for end in (self.velocity.low, self.velocity.high))
        return self.theta.as_tuple, (low, high, self.velocity.count)

    @property
    def attributes(self) -> dict[str, float]:
        """Bounds of the box as attributes of a dataset."""
        axes, ends = ("theta", "velocity"), ("low", "high")
        return {f"{end}_{axis}": getattr(getattr(self, axis), end) for axis in axes for end in ends}

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.theta.count * self.velocity.count


def coordinate(
    name: str, centres: Floats, edges: Floats, units: str, long_name: str
) -> dict[str, Any]:
    """Return a coordinate of cells and, by the CF conventions, the bounds of each cell."""
    bounds = f"{name}_bounds"
    pairs = np.stack([edges[:-1], edges[1:]], axis=1)
    return {
        name: (name, centres, {"units": units, "long_name": long_name, "bounds": bounds}),
        bounds: ((name, "bound"), pairs),
    }


def frequencies(values: ArrayLike) -> Floats:
    """Return frequencies ``Omega/w0`` of the drive, above 0 and ascending, as an array."""
    array = _numbers(values)
    if array is None or array.size > MOST_CELLS or array[0] <= 0 or not (np.diff(array) > 0).all():
        raise InputError(
            f"omega must be numbers above 0 in ascending order, got {short_repr(values)}"
        )
    return array


def evenly(values: Floats) -> bool:
    """Return whether ascending values are evenly spaced."""
    steps = np.diff(values)
    return not steps.size or bool(np.allclose(steps, steps.mean(), atol=0))


def ascending(name: str, given: ArrayLike, *, any_order: bool = False) -> Floats:
    """Return values as an array; each must be greater than the one before, unless in any order."""
    values = _numbers(given)
    if values is None:
        raise InputError(
            f"{name} must be an array (N,) of finite numbers, one or more, got {short_repr(given)}"
        )
    if not any_order and not (np.diff(values) > 0).all():
        raise InputError(f"{name} must be ascending values, got {short_repr(given)}")
    return values


def starts(theta: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
    """Return angles and velocities of a list of starts as two arrays of one length."""
    arrays = []
    for name, given in (("theta", theta), ("velocity", velocity)):
        array = _numbers(given, least=0)
        if array is None or np.ndim(given) != 1:
            raise InputError(
                f"{name} must be an array (N,) of finite numbers, got {short_repr(given)}"
            )
        arrays.append(array)
    angles, speeds = arrays
    if angles.size != speeds.size:
        raise InputError(
            f"theta has {angles.size} values and velocity has {speeds.size}: they must be as many"
        )
    return angles, speeds


def _numbers(given: ArrayLike, least: int = 1) -> Floats | None:
    """Return finite numbers as a new array of one dimension; None if they are not."""
    try:
        values: Floats = np.atleast_1d(np.array(given, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        return None
    fine = values.ndim == 1 and values.size >= least and np.isfinite(values).all()
    return values if fine else None
