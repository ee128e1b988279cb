"""Orbits of the pendulum without losses that leave its upright rest and come back to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Orbit", "loop", "separatrix"]

_REACH, _SPACING = 42.0, 0.1
"""Times along the separatrix: the trapezoidal rule on an analytic integrand without ends errs by
``exp(-pi^2/spacing)``; friction's integrand falls as ``exp(-|t|)`` alone."""

_NODES = 16
"""Gauss's nodes on a panel of the loop."""

_HALVED, _WIDTH, _END = 12, 0.5, 20.0
"""Panels of the loop's parameter: halved so often toward the turning point, beside which a small
torque leaves the other upright rest; then of this width; to where the angle is rounding."""


@dataclass(frozen=True)
class Orbit:
    """Places along an orbit of ``th'' + sin th = torque``, with weights that integrate over time.

    Attributes
    ----------
    time, theta, speed, weight : ndarray
        One value a place.
    torque : float
        Of the equation that the orbit solves.
    rate : float
        At which deviations from upright rest grow there.
    """

    time: Floats
    theta: Floats
    speed: Floats
    weight: Floats
    torque: float = 0.0
    rate: float = 1.0

    def mirrored(self) -> Orbit:
        """Return the image under ``th -> -th``, an orbit of the opposite torque."""
        return Orbit(self.time, -self.theta, -self.speed, self.weight, -self.torque, self.rate)


def separatrix() -> Orbit:
    """Return the orbit ``th = 2 atan(sinh t)`` from one upright rest forward to the next."""
    t = np.arange(-_REACH, _REACH + _SPACING / 2, _SPACING)
    return Orbit(t, 2 * np.arctan(np.sinh(t)), 2 / np.cosh(t), np.full_like(t, _SPACING))


def loop(torque: float) -> Orbit:
    """Return the orbit that leaves upright rest ``pi - asin(torque)`` and comes back to it.

    At a distance ``u`` from there ``th'^2 / 2 = G(u) = c (1 - cos u) - torque (u - sin u)``,
    ``c = sqrt(1 - torque^2)``, up to its zero ``u_t``, where the orbit turns. With ``u = u_t /
    cosh(y)^2`` time is ``dt / dy = 2 / sqrt(2 h)``, ``h = G / (u tanh y)^2``, which is smooth and
    positive from the turning point, ``y = 0``, on to upright rest.

    Parameters
    ----------
    torque : float
        Above -1 and below 1, not 0.

    Returns
    -------
    Orbit
        The way there, at negative times, and the way back.
    """
    if torque < 0:
        return loop(-torque).mirrored()
    c = math.sqrt((1 - torque) * (1 + torque))
    turn = _turning_point(torque, c)
    ends = np.concatenate(
        [[0.0], 0.5 ** np.arange(_HALVED, 1, -1), np.arange(_WIDTH, _END + _WIDTH / 2, _WIDTH)]
    )
    x, weight = legendre.leggauss(_NODES)
    half = np.diff(ends)[:, None] / 2
    y = ends[:-1, None] + half * (1 + x)
    u, beyond = turn / np.cosh(y) ** 2, turn * np.tanh(y) ** 2
    # G from its zero at u = 0 on, or from that at the turning point, whichever is nearer.
    middle = turn - beyond / 2
    from_rest = 2 * c * np.sin(u / 2) ** 2 - torque * _less_sine(u)
    from_turn = torque * (
        2 * _less_sine(beyond / 2) + 4 * np.sin(beyond / 2) * np.sin(middle / 2) ** 2
    ) - 2 * c * np.sin(beyond / 2) * np.sin(middle)
    energy = np.where(u < beyond, from_rest, from_turn)
    rate = 2 * u * np.tanh(y) / np.sqrt(2 * energy)
    whole = (half * rate) @ weight
    time = (np.cumsum(whole) - whole)[:, None] + half * rate @ _integrals(x).T
    time, theta = time.ravel(), (math.atan2(torque, -c) - u).ravel()
    speed, weights = np.sqrt(2 * energy).ravel(), (half * rate * weight).ravel()
    return Orbit(
        np.concatenate([-time, time]),
        np.tile(theta, 2),
        np.concatenate([-speed, speed]),
        np.tile(weights, 2),
        torque,
        math.sqrt(c),
    )


def _turning_point(torque: float, c: float) -> float:
    """Return the distance from upright rest at which the loop turns."""
    from scipy.optimize import brentq  # noqa: PLC0415 (heavy; only a torque needs it)

    def energy(u: float) -> float:
        return 2 * c * math.sin(u / 2) ** 2 - torque * float(_less_sine(np.array(u)))

    # Beyond the bottom of the well, where G is greatest, it falls.
    return float(brentq(energy, 2 * math.atan2(c, torque), math.tau, xtol=1e-300))


def _less_sine(x: Floats) -> Floats:
    """Return ``x - sin x`` without loss of digits where ``x`` is small."""
    square = x * x
    series = x * square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))
    return np.where(x < 0.1, series, x - np.sin(x))  # noqa: PLR2004 (the series errs by 1e-15)


def _integrals(x: Floats) -> Floats:
    """Return the matrix that takes values at Gauss's nodes to integrals from -1 to each node."""
    p = legendre.legvander(x, x.size)
    k = np.arange(1, x.size)
    of_each = np.concatenate([p[:, :1] + p[:, 1:2], (p[:, 2:] - p[:, :-2]) / (2 * k + 1)], axis=1)
    return np.asarray(of_each @ np.linalg.inv(p[:, :-1]))
