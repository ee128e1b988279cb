"""Swings of a pendulum through given states: the form that few samples a period are fitted by."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["FORM", "Windows", "curves"]

FORM: Final = 4
"""Parameters of the form: ``w0^2``, ``c_over_m``, ``Tr`` and the rest position ``zero``."""

_STEPS: Final = 20
"""Steps of a window's half: over 2.5 rad of phase angles are then wrong by 1e-5 rad at most."""


@dataclasses.dataclass(frozen=True)
class Windows:
    """Samples around instants, in rows of equal length.

    Parameters
    ----------
    time, theta : array, shape (W, M)
        s and rad.
    used : array of bool, shape (W, M)
        Which of them there are: rows differ in length.
    crossing : array of bool, shape (W,)
        Whether the instant is that of a crossing of zero, or else that of a turn.
    held : array of bool, shape (W,)
        Whether the pendulum was held before the turn.
    side : array, shape (W,)
        Sign of the turn, or of the velocity at the crossing.
    """

    time: Floats
    theta: Floats
    used: NDArray[np.bool_]
    crossing: NDArray[np.bool_]
    held: NDArray[np.bool_]
    side: Floats

    @classmethod
    def around(
        cls,
        record: tuple[Floats, Floats],
        spans: Sequence[tuple[float, float]],
        side: Sequence[float],
        *,
        crossing: bool = False,
        held: bool = False,
    ) -> Windows:
        """Take the samples within spans of time; ``held`` is said of the first."""
        t, x = record
        edges = [np.searchsorted(t, (low, high + 1e-9 * (high - low))) for low, high in spans]
        first = np.array([e[0] for e in edges], np.intp)
        count = np.array([e[1] - e[0] for e in edges], np.intp)
        places = np.arange(max(int(count.max(initial=1)), 1))
        used = places < count[:, None]
        rows = np.minimum(first[:, None] + places, t.size - 1)
        was_held = np.zeros(len(spans), bool)
        was_held[:1] = held
        signs = np.asarray(side, float)
        return cls(t[rows], x[rows], used, np.full(len(spans), crossing), was_held, signs)


def curves(windows: Windows, instant: Floats, state: Floats, form: Floats) -> tuple[Floats, Floats]:
    """Return angle and velocity at the samples of windows.

    Each window's curve solves ``th'' + c_over_m th' + Tr sgn(th') + w0^2 sin(th - zero) = 0`` from
    its instant on to both sides; ``sgn(th')`` is that of the half cycle on each side, so windows
    must end before the next turn.

    Parameters
    ----------
    windows : Windows
        W of them.
    instant : array, shape (W,)
        s.
    state : array, shape (W,)
        The angle at a turn, rad, or the velocity at a crossing of zero, rad/s.
    form : array, shape (W, 4)
        ``w0^2``, ``c_over_m``, ``Tr`` and ``zero``.

    Returns
    -------
    angle, velocity : ndarray, shape (W, M)
        rad and rad/s.
    """
    lag = np.where(windows.used, windows.time - instant[:, None], 0.0)
    angle, speed = np.empty(lag.shape), np.empty(lag.shape)
    begin = np.where(windows.crossing, 0.0, state), np.where(windows.crossing, state, 0.0)
    for way in (1.0, -1.0):
        reach = np.maximum((way * lag).max(axis=1), 1e-12)
        sign = np.where(windows.crossing, windows.side, -way * windows.side)
        path = _integrated(begin, way * reach / _STEPS, sign, form)
        at = np.clip(way * lag / reach[:, None] * _STEPS, 0, _STEPS)
        here = way * lag >= 0
        x, v = _between(path, at, way * reach / _STEPS)
        angle, speed = np.where(here, x, angle), np.where(here, v, speed)
    before = windows.held[:, None] & (lag < 0)
    return np.where(before, state[:, None], angle), np.where(before, 0.0, speed)


def _acceleration(x: Floats, v: Floats, sign: Floats, form: Floats) -> Floats:
    return np.asarray(-form[:, 0] * np.sin(x - form[:, 3]) - form[:, 1] * v - form[:, 2] * sign)


def _integrated(
    begin: tuple[Floats, Floats], step: Floats, sign: Floats, form: Floats
) -> tuple[Floats, Floats, Floats]:
    """Angle, velocity and acceleration at the steps, each (W, steps + 1), by Runge and Kutta."""
    x, v = begin
    rows = [(x, v, _acceleration(x, v, sign, form))]
    for _ in range(_STEPS):
        a1 = rows[-1][2]
        v2 = v + step / 2 * a1
        a2 = _acceleration(x + step / 2 * v, v2, sign, form)
        v3 = v + step / 2 * a2
        a3 = _acceleration(x + step / 2 * v2, v3, sign, form)
        v4 = v + step * a3
        a4 = _acceleration(x + step * v3, v4, sign, form)
        x = x + step / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        rows.append((x, v, _acceleration(x, v, sign, form)))
    angle, speed, bend = (np.stack(part, axis=1) for part in zip(*rows, strict=True))
    return angle, speed, bend


def _between(
    path: tuple[Floats, Floats, Floats], at: Floats, step: Floats
) -> tuple[Floats, Floats]:
    """Angle and velocity at places between the steps, by cubics through values and slopes."""
    angle, speed, bend = path
    low = np.minimum(at.astype(np.intp), _STEPS - 1)
    s = at - low
    h = step[:, None]

    def cubic(value: Floats, slope: Floats) -> Floats:
        y0, y1 = (np.take_along_axis(value, low + k, 1) for k in (0, 1))
        d0, d1 = (h * np.take_along_axis(slope, low + k, 1) for k in (0, 1))
        rest = y1 - y0
        return np.asarray(y0 + s * (d0 + s * (3 * rest - 2 * d0 - d1 + s * (d0 + d1 - 2 * rest))))

    return cubic(angle, speed), cubic(speed, bend)
