"""The planes in which critical curves are drawn, and what a picture of each shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["PLANES", "in_picture", "in_plane", "window"]

PLANES = ("omega-p", "e-alpha2")
"""Eq. 1.2's ``(omega, p)``, and eq. 1.4's ``(alpha^2, e) = (1/omega^2, p/omega^2)``."""

_HIGHEST = 2.6
"""Largest ``e`` of a picture in the plane of eq. 1.4, if so much was computed."""


def in_plane(omega: Floats, p: Floats, plane: str) -> tuple[Floats, Floats]:
    """Return points given by frequency and amplitude in one of :data:`PLANES`."""
    if plane == PLANES[0]:
        return omega, p
    square = 1 / np.asarray(omega) ** 2
    return square, p * square


def window(omega: Floats, p_max: float, plane: str) -> tuple[tuple[float, float], float]:
    """Return from where to where a picture is wide, and up to where it is high from 0.

    A single frequency stands in the middle.
    """
    low, high = float(omega[0]), float(omega[-1])
    if plane == PLANES[0]:
        aside = 0.0 if low < high else 0.05 * low
        return (low - aside, high + aside), p_max
    return (0.0, 1 / low**2), min(_HIGHEST, p_max / low**2)


def in_picture(
    omega: Floats, p_max: float, plane: str
) -> Callable[[Floats, Floats], tuple[Floats, Floats]]:
    """Return the map from frequency and amplitude into a picture that is [0, 1] wide and high."""
    (left, right), top = window(omega, p_max, plane)

    def to(at: Floats, p: Floats) -> tuple[Floats, Floats]:
        x, y = in_plane(at, p, plane)
        return (x - left) / (right - left), y / top

    return to
