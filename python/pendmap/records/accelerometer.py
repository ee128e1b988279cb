"""Where an accelerometer sits on the rod, and what it reads there.

It measures the specific force, acceleration less gravity. At the distance r from the pivot that is

    tangential, toward positive theta    r th'' + g sin(th)
    radial, toward the pivot             r th'^2 + g cos(th)

and where the phone has taken gravity out ("linear acceleration") the same without g. An angular
acceleration th'' (two sensors, or a differentiated gyroscope) needs no place.
"""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Final, Literal

from pendmap import checks
from pendmap.errors import InputError
from pendmap.records.units import ANGULAR_ACCELERATIONS, plain, spelling

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.records.description import Column

__all__ = ["LIKE", "Accelerometer", "Place", "accelerometer_of", "place_of"]

LIKE: Final = 'acceleration = { direction = "tangential", distance_m = 0.25 }'
"""What a place looks like in [columns]."""

DIRECTIONS: Final = ("tangential", "radial", "angular")
_LONGEST: Final = 100.0

Direction = Literal["tangential", "radial", "angular"]


@dataclasses.dataclass(frozen=True)
class Place:
    """What [columns] says of an accelerometer, as far as it says it."""

    direction: Direction | None = None
    distance_m: float | None = None
    gravity_removed: bool | None = None


@dataclasses.dataclass(frozen=True)
class Accelerometer:
    """An accelerometer on the rod whose place is known.

    Parameters
    ----------
    direction : str
        ``"tangential"`` (toward positive theta), ``"radial"`` (toward the pivot) or ``"angular"``.
    distance_m : float
        From the pivot, m; 1 of an angular acceleration, whose readings are rad/s^2.
    gravity : float
        m/s^2; 0 where the readings are without it.
    w0 : float
        Natural frequency as the zero crossings of the readings show it, rad/s: it makes angles of
        small readings. Not a number where no angle was made.
    """

    direction: Direction
    distance_m: float
    gravity: float
    w0: float = math.nan

    @property
    def gain(self) -> float:
        """Reading of a small free swing over its angle, ``g - r w0**2``; m/s^2 (or rad/s^2)."""
        return self.gravity - self.distance_m * self.w0**2

    @property
    def unit(self) -> str:
        """Of the readings."""
        return "rad/s2" if self.direction == "angular" else "m/s2"


def place_of(table: Mapping[str, object], where: str) -> Place:
    """Return what a table of [columns] says of the place.

    Raises
    ------
    InputError
        If a value is none that it may be, or two exclude each other.
    """
    direction, distance = table.get("direction"), table.get("distance_m")
    removed = table.get("gravity_removed")
    if direction is not None and direction not in DIRECTIONS:
        known = ", ".join(f'"{name}"' for name in DIRECTIONS)
        shown = checks.shown(direction)
        raise InputError(f"{where}: direction must be one of {known}, got {shown}")
    if distance is not None:
        distance = checks.number(f"{where}: distance_m", distance)
        if not 0 < distance <= _LONGEST:
            raise InputError(
                f"{where}: distance_m must be more than 0, up to {_LONGEST:g}, from the pivot to"
                f" the sensor in m, got {distance:g}"
            )
    if removed is not None:
        removed = checks.flag(f"{where}: gravity_removed", removed)
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
    column: Column | None, unit: str | None, heading: str, gravity: float
) -> tuple[Accelerometer | None, str]:
    """Return the accelerometer of a column, or why its place is not known.

    Parameters
    ----------
    column : Column or None
        What [columns] says.
    unit : str or None
        Of the readings, as [columns] or the heading has it.
    heading : str
        Of the column: a "linear acceleration" is one without gravity.
    gravity : float
        m/s^2.
    """
    place = column.place if column else Place()
    direction = place.direction
    scaled = column is not None and column.scale is not None
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
