"""The natural frequency from the times of peaks, amplitudes taken into account."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ellipe, ellipkm1

from pendmap.identification.chain import chain_covariance, chain_least_squares

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.peaks import Peaks

    Floats = NDArray[np.float64]

__all__ = ["Frequency", "frequency", "mean_period", "quarters"]


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


def quarters(amplitude: Floats) -> tuple[Floats, Floats]:
    """Return ``w0 t`` of a quarter swing, ``K(sin^2(A/2))``, and its derivative by ``A``."""
    size = np.clip(np.abs(amplitude), 1e-6, math.pi - 1e-6)
    m, rest = np.sin(size / 2) ** 2, np.cos(size / 2) ** 2
    quarter = ellipkm1(rest)
    return quarter, (ellipe(m) - rest * quarter) / (2 * m * rest) * np.sin(size) / 2


def frequency(peaks: Peaks, *, zeta: float = 0.0, offset: float = 0.0) -> Frequency:
    """Fit the amplitude-corrected period ``T = 4 K(m) / w0``, ``m = sin^2(A/2)``, to all peaks.

    A half cycle between the peaks ``A`` and ``B`` takes a quarter period of each,
    ``w0 t = [K(sin^2(A/2)) + K(sin^2(B/2))] / sqrt(1 - zeta^2)``. For viscous damping and friction
    this is right to first order; at ``zeta = 0.004`` it misses 3e-4 of the half cycle near 2.6 rad
    and 5e-5 near 2 rad. Errors of times and amplitudes both count, and that neighbouring half
    cycles share a peak. Half cycles beside a missing peak are left out.

    Parameters
    ----------
    peaks : Peaks
        Three or more.
    zeta : float
        Damping ratio, which makes small swings slower.
    offset : float
        Zero error of the angle, rad.

    Raises
    ------
    ValueError
        If no two peaks follow one another.
    """
    amplitude = peaks.amplitude - offset
    quarter, slope = quarters(amplitude)
    time = peaks.time
    pairs = np.flatnonzero(np.diff(peaks.index) == 1)
    if pairs.size == 0:
        raise ValueError("no two peaks follow one another")
    lasts, both = time[pairs + 1] - time[pairs], quarter[pairs + 1] + quarter[pairs]
    rough = float(np.median(lasts / both))
    one = np.ones(pairs.size)
    # A time that is too late makes one half cycle longer and the next one shorter, an amplitude
    # that is too large makes both longer.
    late = chain_covariance(pairs, -one, one, np.maximum(peaks.stderr_time, 1e-12) ** 2)
    wide = chain_covariance(
        pairs, slope[pairs] * rough, slope[pairs + 1] * rough, peaks.stderr_amplitude**2
    )
    values, covariance, misfit = chain_least_squares(both[:, None], lasts, late + wide)
    root = math.sqrt(1 - zeta**2)
    w0 = 1 / (float(values[0]) * root)
    return Frequency(w0, math.sqrt(float(covariance[0, 0])) * w0**2 * root, misfit)
