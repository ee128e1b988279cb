"""From a picture's coordinates to an angle: a circle through the places of the bob."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["CircleAngle", "circle_angle"]

ROUNDS: Final = 50
"""Steps of Gauss and Newton; from the algebraic circle five do."""

DOUBT: Final = 0.02
"""Relative standard error of the radius that is worth saying: every angle errs by as much."""


@dataclasses.dataclass(frozen=True)
class CircleAngle:
    """An angle and how it came about."""

    theta: Floats
    text: str
    doubt: str


def circle_angle(time: Floats, x: Floats, y: Floats, where: str) -> CircleAngle:
    """Return the angle of points on a circle, from downward, turning toward positive x.

    Down is along y, on the side where the bob is quickest: pictures count y from the top, other
    tools from the bottom.

    Raises
    ------
    InputError
        If the points lie on no circle.
    """
    middle = np.array([np.median(x), np.median(y)])
    size = float(np.hypot(np.ptp(x), np.ptp(y)))
    if not size or not math.isfinite(size):
        raise InputError(f"{where}: pixel_x and pixel_y must show a swing, they do not move")
    u, v = (x - middle[0]) / size, (y - middle[1]) / size
    a, b, radius = _algebraic(u, v)
    kept = np.ones(u.size, bool)
    for _ in range(2):
        a, b, radius, error, rms = _geometric(u[kept], v[kept], a, b, radius)
        away = np.abs(np.hypot(u - a, v - b) - radius)
        limit = 6 * max(1.4826 * float(np.median(away)), 1e-9)
        kept = away <= limit
    if not (math.isfinite(radius) and 0 < radius < 1e3):
        raise InputError(
            f"{where}: pixel_x and pixel_y must be places of a bob, they lie on no circle"
        )
    speed = np.hypot(np.gradient(u, time), np.gradient(v, time))
    quick = speed >= np.quantile(speed, 0.8)
    down = 1.0 if np.median((v - b)[quick]) > 0 else -1.0
    theta = np.unwrap(np.arctan2(u - a, down * (v - b)))
    centre = middle + size * np.array([a, b])
    text = (
        f"the angle is that on a circle around ({centre[0]:.5g}, {centre[1]:.5g}) of radius"
        f" {radius * size:.5g}, y counted {'down' if down > 0 else 'up'}ward; the places are"
        f" {rms * size:.2g} from it, rms"
    )
    doubt = ""
    if error > DOUBT * radius:
        doubt = (
            f"the radius is uncertain by {100 * error / radius:.0f} %, and so is every angle: the"
            " arc is short"
        )
    return CircleAngle(theta, text, doubt)


def _algebraic(u: Floats, v: Floats) -> tuple[float, float, float]:
    """Return centre and radius of Kasa's circle: least squares of u^2 + v^2."""
    columns = np.column_stack([u, v, np.ones(u.size)])
    solution = np.linalg.lstsq(columns, u**2 + v**2, rcond=None)[0]
    a, b = solution[0] / 2, solution[1] / 2
    return float(a), float(b), math.sqrt(max(float(solution[2]) + a * a + b * b, 1e-12))


def _geometric(
    u: Floats, v: Floats, a: float, b: float, radius: float
) -> tuple[float, float, float, float, float]:
    """Return the circle of least distances, the standard error of its radius, and the rms."""
    for _ in range(ROUNDS):
        distance = np.maximum(np.hypot(u - a, v - b), 1e-12)
        slope = np.column_stack([-(u - a) / distance, -(v - b) / distance, -np.ones(u.size)])
        step = np.linalg.lstsq(slope, -(distance - radius), rcond=None)[0]
        a, b, radius = a + float(step[0]), b + float(step[1]), radius + float(step[2])
        if not math.isfinite(radius) or np.max(np.abs(step)) < 1e-12:
            break
    distance = np.hypot(u - a, v - b) - radius
    rms = float(np.sqrt(np.mean(distance**2)))
    inverse = np.linalg.pinv(slope.T @ slope)
    error = rms * math.sqrt(max(float(inverse[2, 2]), 0.0))
    return a, b, radius, error, rms
