"""The noise-free motion of one run, continuous in time, by Gauss collocation.

Within a step of length ``h`` from ``t0``, ``s = (t - t0) / h`` in [0, 1], the acceleration is the
polynomial of degree ``NODES - 1`` through its values at the Gauss-Legendre points. Velocity and
angle are its exact integrals: the Gauss method, of order ``2 NODES`` at the end of a step, of order
``NODES + 2`` in the angle inside it (Hairer, Norsett & Wanner 1993, Solving Ordinary Differential
Equations I, section II.7). Polynomials are rows of coefficients of the Legendre polynomials
``P_k(2 s - 1)``.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Floats = NDArray[np.float64]

NODES: Final = 10  # Gauss points per step

_X, _WEIGHTS = legendre.leggauss(NODES)

POINTS: Final[Floats] = (_X + 1) / 2  # Gauss-Legendre points in (0, 1), shape (NODES,)

COEFFICIENTS: Final[Floats] = (
    legendre.legvander(_X, NODES - 1).T * _WEIGHTS * (np.arange(NODES)[:, np.newaxis] + 0.5)
)
"""Coefficients of a polynomial from its values at ``POINTS``, shape (NODES, NODES)."""


def _integral(count: int) -> Floats:
    """Return the coefficients of the integral over s from 0, shape (count + 1, count)."""
    # d s = d x / 2 in the variable x = 2 s - 1 of the Legendre polynomials.
    return np.asarray(legendre.legint(np.eye(count), lbnd=-1, axis=0)) / 2


INTEGRAL: Final[Floats] = _integral(NODES)
"""Coefficients of the integral from those of a polynomial, shape (NODES + 1, NODES)."""


def basis(s: Floats, count: int) -> Floats:
    """Return the Legendre polynomials at ``s``, shape (..., count)."""
    return np.asarray(legendre.legvander(2 * s - 1, count - 1))


FIRST: Final[Floats] = basis(POINTS, NODES + 1) @ INTEGRAL @ COEFFICIENTS
"""Values of a polynomial's integral at ``POINTS``, from the polynomial's values there."""

SECOND_INTEGRAL: Final[Floats] = _integral(NODES + 1)
"""Coefficients of the integral of NODES + 1 coefficients, shape (NODES + 2, NODES + 1)."""

SECOND: Final[Floats] = basis(POINTS, NODES + 2) @ SECOND_INTEGRAL @ INTEGRAL @ COEFFICIENTS
"""Values of a polynomial's second integral at ``POINTS``, from the polynomial's values there."""


def value(coefficients: Sequence[float], s: float) -> float:
    """Return the value of one polynomial at one ``s`` (Clenshaw's recurrence)."""
    x = 2 * s - 1
    last, before = 0.0, 0.0
    for k in range(len(coefficients) - 1, 0, -1):
        last, before = (
            coefficients[k] + (2 * k + 1) / (k + 1) * x * last - (k + 1) / (k + 2) * before,
            last,
        )
    return coefficients[0] + x * last - before / 2


@dataclasses.dataclass(frozen=True)
class Event:
    """A zero of the velocity, or the end of a sticking interval."""

    time: float  # since the run began, s
    what: str  # turn, stick or release
    theta: float  # rad


class Path:
    """Angle and velocity of a run begun at ``lab``, s, at any time: a polynomial for each step."""

    def __init__(self, lab: float = 0.0) -> None:
        self.lab = lab
        self.events: list[Event] = []
        # Begin and length, s; Legendre coefficients of angle and velocity over the step.
        self.steps: list[tuple[float, float, Floats, Floats]] = []

    def angle(self, time: Floats) -> Floats:
        """Angle in rad, not wrapped, at times in s, shape (N,)."""
        return self._at(time, 2, NODES + 2)

    def velocity(self, time: Floats) -> Floats:
        """Angular velocity in rad/s at times in s, shape (N,)."""
        return self._at(time, 3, NODES + 1)

    def _at(self, time: Floats, which: int, count: int) -> Floats:
        begins, lengths, coefficients = (
            np.array([step[k] for step in self.steps]) for k in (0, 1, which)
        )
        step = np.clip(np.searchsorted(begins, time, side="right") - 1, 0, begins.size - 1)
        s = (time - begins[step]) / lengths[step]
        # Places are clipped to their step, so that rounding never extrapolates.
        polynomials = basis(np.clip(s, 0.0, 1.0), count)
        return np.asarray(np.einsum("nk,nk->n", polynomials, coefficients[step]))
