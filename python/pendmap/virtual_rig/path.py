"""The clean motion of one run, continuous in time."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from pendmap.virtual_rig.collocation import NODES, basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Event", "Path"]


@dataclasses.dataclass(frozen=True)
class Event:
    """A velocity zero, or the end of a stick.

    Parameters
    ----------
    time : float
        Time since the run began, s.
    what : str
        ``turn``, ``stick`` or ``release``.
    theta : float
        Angle, rad.
    """

    time: float
    what: str
    theta: float


class Path:
    """Angle and velocity of one run at any time; a polynomial for each step of the integrator.

    ``lab`` is the time in the laboratory at which the run begins, s.
    """

    def __init__(self) -> None:
        self.lab = 0.0
        self.events: list[Event] = []
        self._begins: list[float] = []
        self._lengths: list[float] = []
        self._theta: list[Floats] = []
        self._velocity: list[Floats] = []

    def add(self, begin: float, length: float, theta: Floats, velocity: Floats) -> None:
        """Append a step: Legendre coefficients over ``begin`` to ``begin + length``."""
        self._begins.append(begin)
        self._lengths.append(length)
        self._theta.append(theta)
        self._velocity.append(velocity)

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self._begins)

    def angle(self, time: Floats) -> Floats:
        """Angle in rad, not wrapped, at times in s, shape (N,)."""
        return self._at(time, self._theta, NODES + 2)

    def velocity(self, time: Floats) -> Floats:
        """Angular velocity in rad/s at times in s, shape (N,)."""
        return self._at(time, self._velocity, NODES + 1)

    def _at(self, time: Floats, coefficients: list[Floats], count: int) -> Floats:
        begins = np.array(self._begins)
        step = np.clip(np.searchsorted(begins, time, side="right") - 1, 0, begins.size - 1)
        s = (time - begins[step]) / np.array(self._lengths)[step]
        # The step that holds both ends is clipped, so that rounding never extrapolates.
        polynomials = basis(np.clip(s, 0.0, 1.0), count)
        return np.asarray(np.einsum("nk,nk->n", polynomials, np.array(coefficients)[step]))
