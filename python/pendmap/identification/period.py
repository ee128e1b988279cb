"""The natural frequency from the times of peaks, amplitudes taken into account."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ellipk

from pendmap.identification.uncertainty import least_squares_line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.peaks import Peaks

    Floats = NDArray[np.float64]

__all__ = ["Frequency", "frequency", "mean_period", "phases"]


@dataclasses.dataclass(frozen=True)
class Frequency:
    """A natural frequency ``w0`` (rad/s), its standard error and what the line leaves.

    ``misfit`` is chi^2 per degree of freedom; where it is above 1 the error is widened by it.
    """

    w0: float
    stderr: float
    misfit: float


def mean_period(time: Floats) -> float:
    """Return the mean of all overlapping ``t[i + 2] - t[i]``, s: the paper's average period."""
    return float(np.mean(time[2:] - time[:-2]))


def phases(amplitude: Floats) -> Floats:
    """Return ``w0 t`` at the peaks of a pendulum without dissipation, from the first one on.

    A half cycle between the peaks ``A`` and ``B`` takes a quarter period of each,
    ``w0 t = K(sin^2(A/2)) + K(sin^2(B/2))``. For viscous damping and friction this is right to
    first order; at ``zeta = 0.004`` it misses 5e-4 of a half cycle near 2.6 rad, and less than
    1e-4 below 2 rad.

    Parameters
    ----------
    amplitude : array, shape (P,)
        Peaks that follow one another, either sign, rad.
    """
    size = np.minimum(np.abs(amplitude), math.pi - 1e-6)
    quarter = ellipk(np.sin(size / 2) ** 2)
    return np.concatenate(([0.0], np.cumsum(quarter[1:] + quarter[:-1])))


def frequency(peaks: Peaks, *, zeta: float = 0.0, offset: float = 0.0) -> Frequency:
    """Fit ``t_k = t_0 + Phi_k / (w0 sqrt(1 - zeta^2))`` to the times of all peaks.

    ``Phi`` is :func:`phases`: this is the amplitude-corrected period ``T = 4 K(m) / w0``,
    ``m = sin^2(A/2)``, of every cycle at once. Where peaks are missing the gap is left out: what
    follows begins anew, at a time of its own.

    Parameters
    ----------
    peaks : Peaks
        Three or more.
    zeta : float
        Damping ratio, which makes small swings slower.
    offset : float
        Zero error of the angle, rad.
    """
    amplitude = peaks.amplitude - offset
    error = np.maximum(peaks.stderr_time, 1e-12)
    gaps = np.flatnonzero(np.diff(peaks.index) != 1) + 1
    if gaps.size == 0:
        line, covariance, misfit = least_squares_line(phases(amplitude), peaks.time, error)
        slope, variance = float(line[1]), float(covariance[1, 1])
    else:
        parts = [p for p in np.split(np.arange(len(peaks)), gaps) if p.size > 1]
        lines = [
            least_squares_line(phases(amplitude[p]), peaks.time[p], error[p]) for p in parts
        ]
        weights = np.array([1 / fit[1][1, 1] for fit in lines])
        slope = float(np.average([fit[0][1] for fit in lines], weights=weights))
        variance = 1 / float(weights.sum())
        misfit = float(np.average([fit[2] for fit in lines], weights=weights))
    damped = 1 / slope
    root = math.sqrt(1 - zeta**2)
    return Frequency(damped / root, math.sqrt(variance) * damped**2 / root, misfit)
