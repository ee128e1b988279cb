"""Natural frequency from times and amplitudes of peaks; work of viscous damping."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ellipe, ellipkm1

from pendmap.identification.uncertainty import chain_covariance, chain_least_squares

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


@dataclasses.dataclass(frozen=True)
class Frequency:
    """Natural frequency ``w0`` (rad/s), its standard error, and chi^2 per degree of freedom.

    The error is multiplied by the square root of the misfit if that is above 1.
    """

    w0: float
    stderr: float
    misfit: float


def mean_period(time: Floats) -> float:
    """Return the mean of all overlapping ``t[i + 2] - t[i]``, s, the paper's average period."""
    return float(np.mean(time[2:] - time[:-2]))


def quarters(amplitude: Floats) -> tuple[Floats, Floats]:
    """Return the phase ``w0 t = K(sin^2(A/2))`` of a quarter swing, and its derivative by ``A``."""
    size = np.clip(np.abs(amplitude), 1e-6, math.pi - 1e-6)
    m, rest = np.sin(size / 2) ** 2, np.cos(size / 2) ** 2
    quarter = ellipkm1(rest)
    return quarter, (ellipe(m) - rest * quarter) / (2 * m * rest) * np.sin(size) / 2


def frequency(peaks: Peaks, *, zeta: float = 0.0, offset: float = 0.0) -> Frequency:
    """Fit the amplitude-corrected period ``T = 4 K(m) / w0``, ``m = sin^2(A/2)``, to all peaks.

    A half cycle between the peaks ``A`` and ``B`` takes a quarter period of each, ``w0 t =
    [K(sin^2(A/2)) + K(sin^2(B/2))] / sqrt(1 - zeta^2)``. For viscous damping and friction this is
    correct to first order; at ``zeta = 0.004`` its error is 3e-4 of the half cycle near 2.6 rad and
    5e-5 near 2 rad. Weights include errors of times and amplitudes and their correlation between
    neighbouring half cycles. Half cycles next to a missing peak are excluded. ``offset`` is the
    zero error, rad.
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
    # An error of a time changes two half cycles oppositely, one of an amplitude alike.
    late = chain_covariance(pairs, -one, one, np.maximum(peaks.stderr_time, 1e-12) ** 2)
    wide = chain_covariance(
        pairs, slope[pairs] * rough, slope[pairs + 1] * rough, peaks.stderr_amplitude**2
    )
    values, covariance, misfit = chain_least_squares(both[:, None], lasts, late + wide)
    root = math.sqrt(1 - zeta**2)
    w0 = 1 / (float(values[0]) * root)
    return Frequency(w0, math.sqrt(float(covariance[0, 0])) * w0**2 * root, misfit)


def viscous_work(amplitude: Floats) -> Floats:
    """Return ``int th'^2 dt / w0`` over a half cycle of a pendulum of this amplitude, rad^2.

    ``8 (E(m) - (1 - m) K(m))``, ``m = sin^2(A/2)``; ``pi A^2 / 2`` for small swings.
    """
    half = np.minimum(np.abs(amplitude), math.pi - 1e-9) / 2
    m, rest = np.sin(half) ** 2, np.cos(half) ** 2
    return np.asarray(8 * (ellipe(m) - rest * ellipkm1(rest)))
