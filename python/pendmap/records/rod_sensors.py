"""Accelerometers and gyroscopes on the rod, and what they read there.

An accelerometer measures acceleration less gravity. At the distance r from the pivot that is

    tangential, toward positive theta    r th'' + g sin(th)
    radial, toward the pivot             r th'^2 + g cos(th)

and without g if the phone removes gravity ("linear acceleration"). An angular acceleration th''
needs no place. A gyroscope reads th' and a bias; white noise of the rate is a random walk of its
integral, so that a fit compares the rate.
"""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.errors import InputError, check_flag, check_number, short_repr
from pendmap.records.units import ANGULAR_ACCELERATIONS, plain, spelling
from pendmap.signal.half_cycles import Swings, swings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


PLACE_EXAMPLE: Final = 'acceleration = { direction = "tangential", distance_m = 0.25 }'
"""Example of a place in [columns]."""

DIRECTIONS: Final = ("tangential", "radial", "angular")
_FARTHEST: Final = 100.0
"""Distance of a sensor from the pivot at most, m."""

Direction = Literal["tangential", "radial", "angular"]

OVER_THE_TOP: Final = 4 * math.pi
"""Radians from the middle from which a record turns over the top."""

FEWEST_PEAKS: Final = 4
"""Turning points from which a drift is taken."""


@dataclasses.dataclass(frozen=True)
class Place:
    """Place of an accelerometer as [columns] gives it."""

    direction: Direction | None = None
    distance_m: float | None = None
    gravity_removed: bool | None = None


@dataclasses.dataclass(frozen=True)
class Accelerometer:
    """An accelerometer on the rod whose place is known."""

    direction: Direction  # toward positive theta, toward the pivot, or about it
    distance_m: float  # from the pivot; 1 of an angular acceleration
    gravity: float  # m/s^2; 0 where the readings are without it
    w0: float = math.nan  # rad/s, from crossings; NaN where no angle was made

    @property
    def gain(self) -> float:
        """Reading of a small free swing over its angle, ``g - r w0**2``; m/s^2 or rad/s^2."""
        return self.gravity - self.distance_m * self.w0**2

    @property
    def unit(self) -> str:
        """Unit of the readings."""
        return "rad/s2" if self.direction == "angular" else "m/s2"


def place_of(table: Mapping[str, object], where: str) -> Place:
    """Return the place in a table of [columns]; raise InputError for values not allowed."""
    direction, distance = table.get("direction"), table.get("distance_m")
    removed = table.get("gravity_removed")
    if direction is not None and direction not in DIRECTIONS:
        known = ", ".join(f'"{name}"' for name in DIRECTIONS)
        shown = short_repr(direction)
        raise InputError(f"{where}: direction must be one of {known}, got {shown}")
    if distance is not None:
        distance = check_number(f"{where}: distance_m", distance)
        if not 0 < distance <= _FARTHEST:
            raise InputError(
                f"{where}: distance_m must be more than 0, up to {_FARTHEST:g}, from the pivot to"
                f" the sensor in m, got {distance:g}"
            )
    if removed is not None:
        removed = check_flag(f"{where}: gravity_removed", removed)
    unit = table.get("unit")
    if isinstance(unit, str) and "scale" not in table:
        angular = spelling(unit) in ANGULAR_ACCELERATIONS
        if angular and direction in {"tangential", "radial"}:
            raise InputError(
                f"{where}: unit must be m/s2 or g with direction {direction!r}, got {unit!r}, which"
                ' needs direction = "angular"'
            )
        if direction == "angular" and not angular:
            raise InputError(
                f"{where}: unit must be rad/s2 or deg/s2 with direction 'angular', got {unit!r}"
            )
    return Place(direction, distance, removed)


def accelerometer_of(
    place: Place, unit: str | None, heading: str, gravity: float, *, scaled: bool
) -> tuple[Accelerometer | None, str]:
    """Return the accelerometer of a column, or the keys that its place lacks.

    ``heading`` may say "linear acceleration", without gravity; ``gravity`` is in m/s^2.
    """
    direction = place.direction
    if direction is None and not scaled and unit and spelling(unit) in ANGULAR_ACCELERATIONS:
        direction = "angular"
    if direction == "angular":
        return Accelerometer("angular", 1.0, 0.0), ""
    keys = {"direction": direction, "distance_m": place.distance_m}
    missing = [key for key, value in keys.items() if value is None]
    if direction is None or place.distance_m is None:
        return None, " and ".join(missing)
    removed = place.gravity_removed
    if removed is None:
        removed = re.match("linear", plain(heading)) is not None
    return Accelerometer(direction, place.distance_m, 0.0 if removed else gravity), ""


@dataclasses.dataclass(frozen=True)
class Gyroscope:
    """A gyroscope from whose readings alone the angle was made."""

    w0: float  # rad/s, from speeds in the middle of swings
    bias: float = math.nan  # rad/s, from the drift of the angle; NaN without one

    @property
    def gain(self) -> float:
        """Reading of a small free swing over its angle, ``w0``; rad/s."""
        return self.w0

    @property
    def unit(self) -> str:
        """Unit of the readings."""
        return "rad/s"


def angle_of_rate(time: Floats, rate: Floats, good: NDArray[np.bool_] | None = None) -> Floats:
    """Return the integral of a rate, rad, shape (N,); 0 is the middle of the swing.

    The line that the bias adds is removed. Of a record over the top the last angle is 0. A spline
    replaces readings that are not ``good``.
    """
    theta = _integral(time, rate, good)
    if np.ptp(theta - np.median(theta)) > OVER_THE_TOP:
        return np.asarray(theta - theta[-1])
    middle = _middles(time, theta)
    if middle is None:
        return np.asarray(theta - np.median(theta))
    line = np.polyfit(*middle, 1)
    return np.asarray(theta - np.polyval(line, time))


def gyroscope_of(time: Floats, theta: Floats, rate: Floats) -> Gyroscope:
    """Return the gyroscope that a rate and the angle of :func:`angle_of_rate` show."""
    found = swings(time, theta)
    bias = math.nan
    if np.ptp(theta - np.median(theta)) <= OVER_THE_TOP and found.peak_time.size >= FEWEST_PEAKS:
        # The removed line has the slope of the bias; the median ignores false readings.
        bias = float(np.median((rate[1:] + rate[:-1]) / 2 - np.diff(theta) / np.diff(time)))
    return Gyroscope(_frequency(found, time, np.abs(rate - np.nan_to_num(bias))), bias)


def _integral(time: Floats, rate: Floats, good: NDArray[np.bool_] | None) -> Floats:
    """Return the integral of a rate by a cubic spline."""
    from scipy.interpolate import CubicSpline

    if good is not None and np.count_nonzero(good) > 1:
        spline = CubicSpline(time[good], rate[good])
        inside = np.clip(time, time[good][0], time[good][-1])
        return np.asarray(spline.antiderivative()(inside))
    return np.asarray(CubicSpline(time, rate).antiderivative()(time))


def _middles(time: Floats, theta: Floats) -> tuple[Floats, Floats] | None:
    """Return times and values halfway between turning points of either side."""
    trend = np.polyval(np.polyfit(time, theta, 1), time)
    found = swings(time, theta - trend)
    if found.peak_time.size < FEWEST_PEAKS:
        return None
    peaks = found.peak + np.interp(found.peak_time, time, trend)
    # Weights (1, 2, 1) cancel the bias that the decay gives to a mean of two turns.
    value = (peaks[:-2] + 2 * peaks[1:-1] + peaks[2:]) / 4
    return found.peak_time[1:-1], value


def _frequency(found: Swings, time: Floats, speed: Floats) -> float:
    """Return ``w0`` from the energy of swings: th' = 2 w0 sin(A/2) in the middle."""
    size = np.abs(found.peak)
    middle = (size[:-1] + size[1:]) / 2
    swung = (size[:-1] < math.pi) & (size[1:] < math.pi)
    if np.any(swung):
        passing = np.interp(found.crossing[1:-1], time, speed)[swung]
        return float(np.sum(passing) / np.sum(2 * np.sin(middle[swung] / 2)))
    fastest = float(np.max(speed))  # it turns over the top from 2 w0 on
    return fastest / 2 if fastest > 0 else 1.0
