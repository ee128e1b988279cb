"""What the axes of pictures are called, in the units of the dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.charts.chart import Axis

if TYPE_CHECKING:
    from pendmap.charts.chart import Ends
    from pendmap.units import Units


_TAU: Final = "\N{GREEK SMALL LETTER TAU}"
_THETA: Final = "\N{GREEK SMALL LETTER THETA}"

ANGLE: Final = f"{_THETA} (rad)"
"""The angle, with its unit."""


def velocity(units: Units) -> str:
    """Return the symbol of the velocity."""
    return f"d{_THETA}/dt" if units.si else f"d{_THETA}/d{_TAU}"


def speed(units: Units) -> str:
    """Return the symbol of the velocity with its unit, a blank between them."""
    return velocity(units) + (" (rad/s)" if units.si else "")


def clock(units: Units) -> str:
    """Return the symbol of time with its unit, a blank between them."""
    return "t (s)" if units.si else _TAU


def per_time(units: Units) -> str:
    """Return what an exponent counts."""
    return "per second" if units.si else f"per unit {_TAU}"


def phase_plane(theta: Ends, velocity: Ends, units: Units) -> tuple[Axis, Axis]:
    """Return the axes of the phase plane."""
    return Axis(ANGLE, theta, "angle"), Axis(speed(units), velocity)
