"""Eqs. 2.4 to 2.10 of Horton, Wiercigroch & Xu (2008): peaks from damping, damping from peaks."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from pendmap.identification.period import mean_period

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


Reading = Literal["all", "odd_ends", "odd_triplets"]
"""Peaks that the printed method uses; see ``methods.combined``."""


@dataclasses.dataclass(frozen=True)
class Decrement:
    """Result of the combined method for a small decay."""

    delta: float  # zeta / sqrt(1 - zeta^2), eq. 2.7
    theta_r: float  # Tr / w0^2, rad, eq. 2.10
    mean_period: float  # of all overlapping full cycles, s

    @property
    def zeta(self) -> float:
        """Damping ratio."""
        return self.delta / math.sqrt(1 + self.delta**2)

    @property
    def w0(self) -> float:
        """Natural frequency ``2 pi / (mean_period sqrt(1 - zeta^2))``, rad/s."""
        return 2 * math.pi / (self.mean_period * math.sqrt(1 - self.zeta**2))

    @property
    def Tr(self) -> float:  # noqa: N802 (the paper's name)
        """Coulomb friction over inertia, rad/s^2."""
        return self.w0**2 * self.theta_r

    @property
    def si(self) -> Floats:
        """``w0, c_over_m, Tr``."""
        return np.array([self.w0, 2 * self.zeta * self.w0, self.Tr])


def recursion(first: float, delta: float, theta_r: float, count: int) -> Floats:
    """Return the absolute values of peaks by eqs. 2.4 to 2.6, shape (count,).

    ``abs(th_k) = -theta_r (E + 1) + E abs(th_{k-1})``, ``E = exp(-delta pi)``. Negative values,
    from the peak on that does not reach zero, mean nothing.
    """
    shrink = math.exp(-delta * math.pi)
    result = np.empty(count)
    result[0] = first
    for k in range(1, count):
        result[k] = -theta_r * (shrink + 1) + shrink * result[k - 1]
    return result


def decrement(peaks: Floats) -> float:
    """Return ``delta`` by eq. 2.7, from the first two and the last two absolute peaks.

    ``delta = ln[(th_0 - th_1) / (th_{k-1} - th_k)] / ((k - 1) pi)``; all peaks between cancel. NaN
    where the ratio is not above 0.
    """
    ratio = (peaks[0] - peaks[1]) / (peaks[-2] - peaks[-1])
    if not ratio > 0:
        return math.nan
    return float(math.log(ratio) / ((peaks.size - 2) * math.pi))


def coulomb(peaks: Floats) -> float:
    """Return ``theta_r = Tr / w0^2`` by eq. 2.10, from the same four absolute peaks, rad."""
    first, second, last_but_one, last = peaks[0], peaks[1], peaks[-2], peaks[-1]
    below = second + first - last_but_one - last
    return float((second * last_but_one - first * last) / below) if below else math.nan


def triplets(peaks: Floats) -> tuple[Floats, Floats]:
    """Return ``delta`` and ``theta_r`` of each three peaks in a row, shape (P - 2,): figure 5."""
    first, second, third = peaks[:-2], peaks[1:-1], peaks[2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        delta = np.log((first - second) / (second - third)) / math.pi
        theta_r = (second**2 - first * third) / (first - third)
    return delta, theta_r


def from_amplitudes(peaks: Floats, times: Floats, reading: Reading, parity: int) -> Decrement:
    """Apply eqs. 2.7 and 2.10 to absolute peaks; ``parity`` is that of the first one's number."""
    if reading == "odd_triplets":
        deltas, thetas = (each[1 - parity :: 2] for each in triplets(peaks))
        delta, theta_r = float(np.mean(deltas)), float(np.mean(thetas))
    else:
        used = peaks
        if reading == "odd_ends":
            # Both pairs of neighbours that 2.7 uses begin at an odd peak.
            used = used[1 - parity :]
            used = used[: used.size - used.size % 2]
        delta, theta_r = decrement(used), coulomb(used)
    return Decrement(delta, theta_r, mean_period(times))
