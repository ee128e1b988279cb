"""Where a search may start: natural frequency and damping to some percent, from half swings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ellipe, ellipk

from pendmap.records.swings import swings

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["rough_damping", "rough_start"]

FEWEST_SWINGS: Final = 2
"""Half swings that a start needs."""
QUIET: Final = 10.0
"""Readings at rest lie within so many standard errors."""


def rough_start(
    time: NDArray[np.float64], theta: NDArray[np.float64], sigma: float
) -> dict[str, float] | None:
    """Return starting values of ``w0``, ``c_over_m`` and ``Tr`` of a free decay.

    A half swing of amplitude ``A`` takes ``2 K(m) / w0`` with ``m = sin(A/2)**2``; from one to the
    next the energy ``w0**2 (1 - cos A)`` falls by ``c_over_m w0 8 (E(m) - (1 - m) K(m))`` (the
    integral of the velocity over the angle) and ``2 A Tr``.

    Parameters
    ----------
    time, theta : ndarray of float, shape (n,)
        In s and rad.
    sigma : float
        Standard error of the readings, rad: smaller swings are left out.

    Returns
    -------
    dict or None
        None where there are fewer than three swings.
    """
    tail = theta[-max(len(theta) // 10, 1) :]
    # Of a motion that goes on at the end the mean says little.
    centre = float(np.mean(tail)) if np.ptp(tail) < QUIET * sigma else 0.0
    half = swings(time, theta - centre, least=4.0 * sigma)
    peaks = np.minimum(np.abs(half.peak), math.pi - 1e-3)
    if len(peaks) < FEWEST_SWINGS:
        return None
    m = np.sin(np.minimum(peaks, 3.1) / 2) ** 2
    w0 = float(np.median(2 * ellipk(m) / np.diff(half.crossing)))
    if len(peaks) < FEWEST_SWINGS + 1:
        return {"w0": w0, "c_over_m": 0.02 * w0, "Tr": 1e-3 * w0**2}
    viscous, friction = rough_damping(peaks)
    # Neither begins at 0, where a step may be too large.
    return {"w0": w0, "c_over_m": max(viscous, 1e-4) * w0, "Tr": max(friction, 1e-5) * w0**2}


def rough_damping(peaks: NDArray[np.float64]) -> tuple[float, float]:
    """Return ``c_over_m / w0`` and ``Tr / w0^2`` (rad), 0 or more, from peaks in a row.

    Parameters
    ----------
    peaks : ndarray of float, shape (n,)
        Three or more, rad, in (0, pi).
    """
    from scipy.optimize import nnls  # noqa: PLC0415 (heavy)

    m = np.sin(np.minimum(peaks, 3.1) / 2) ** 2
    action = 8 * (ellipe(m) - (1 - m) * ellipk(m))
    columns = np.stack([0.5 * (action[1:] + action[:-1]), peaks[1:] + peaks[:-1]], axis=1)
    lost = np.diff(np.cos(peaks))
    # Energies of small swings are known better: their error is about A sigma.
    weight = 1 / (peaks[1:] + peaks[:-1])
    (viscous, friction), _ = nnls(columns * weight[:, None], lost * weight)
    return float(viscous), float(friction)
