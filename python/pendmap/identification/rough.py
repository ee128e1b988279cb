"""Where a search may start: natural frequency and damping to some percent, from half swings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["rough_start"]

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
    from scipy.optimize import nnls  # noqa: PLC0415 (heavy)
    from scipy.special import ellipe, ellipk  # noqa: PLC0415 (heavy)

    tail = theta[-max(len(theta) // 10, 1) :]
    # Of a motion that goes on at the end the mean says little.
    centre = float(np.mean(tail)) if np.ptp(tail) < QUIET * sigma else 0.0
    times, peaks = _half_swings(time, theta - centre, 4.0 * sigma)
    if len(peaks) < FEWEST_SWINGS:
        return None
    m = np.sin(np.minimum(peaks, 3.1) / 2) ** 2
    w0 = float(np.median(2 * ellipk(m) / np.diff(times)))
    if len(peaks) < FEWEST_SWINGS + 1:
        return {"w0": w0, "c_over_m": 0.02 * w0, "Tr": 1e-3 * w0**2}
    action = 8 * (ellipe(m) - (1 - m) * ellipk(m))
    lost = w0**2 * -np.diff(1 - np.cos(peaks))
    columns = np.stack([0.5 * w0 * (action[1:] + action[:-1]), peaks[1:] + peaks[:-1]], axis=1)
    # Energies of small swings are known better: their error is about A sigma.
    weight = 1 / (peaks[1:] + peaks[:-1])
    (c_over_m, friction), _ = nnls(columns * weight[:, None], lost * weight)
    # Neither begins at 0, where a step may be too large.
    return {
        "w0": w0,
        "c_over_m": max(float(c_over_m), 1e-4 * w0),
        "Tr": max(float(friction), 1e-5 * w0**2),
    }


def _half_swings(
    time: NDArray[np.float64], theta: NDArray[np.float64], least: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times of the zero crossings and the peak between each pair of them."""
    clear = np.flatnonzero(np.abs(theta) >= least)
    after = 1 + np.flatnonzero(np.diff(theta[clear] > 0))
    if after.size < FEWEST_SWINGS:
        return np.array([]), np.array([])
    a, b = clear[after - 1], clear[after]
    # What came before the first crossing is no half swing, nor is what follows the last.
    crossings = time[a] + theta[a] / (theta[a] - theta[b]) * (time[b] - time[a])
    peaks = np.maximum.reduceat(np.abs(theta[clear]), after)[:-1]
    return crossings, np.minimum(peaks, math.pi - 1e-3)
