"""Classic logarithmic decrement, for viscous damping alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.identification.methods.base import (
    MISFIT,
    Identification,
    identified,
    inapplicable,
    too_few,
)
from pendmap.identification.methods.combined import CUT
from pendmap.identification.period import mean_period
from pendmap.identification.uncertainty import least_squares_line, propagated

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


_FEWEST: Final = 3  # Fewest peaks below the cut


def from_peaks(peaks: Peaks, *, cut: float = CUT) -> Identification:
    """Identify ``w0`` and ``c_over_m`` by the logarithmic decrement of peaks below ``cut`` (rad).

    ``delta = ln(abs(th_0) / abs(th_n)) / (n pi)`` over ``n`` half cycles between the first and the
    last peak (the mean of all decrements is equal); ``zeta = delta / sqrt(1 + delta^2)``, ``w0``
    from the mean period.
    Coulomb friction is attributed to viscous damping: the decrement increases as the swing decays.
    """
    small = peaks.turned
    small = small.select(np.abs(small.amplitude) < cut)
    under = "" if math.isinf(cut) else f" under {math.degrees(cut):.3g} degrees"
    if len(small) < _FEWEST:
        return too_few(len(small), _FEWEST, len(peaks.turned), under.strip())
    count, warnings = len(small), []
    half_cycles = (small.index - small.index[0]).astype(float)
    size = np.abs(small.amplitude)
    relative = np.maximum(small.stderr_amplitude, 1e-12) / size
    decrements, _, misfit = least_squares_line(half_cycles, np.log(size), relative)
    full = np.flatnonzero(small.index[2:] - small.index[:-2] == 2)  # noqa: PLR2004 (one cycle)
    if full.size == 0:
        return inapplicable(f"no two peaks{under} are one cycle apart")

    def compute(values: Floats) -> Floats:
        logs, times = np.log(values[:count]), values[count:]
        delta = (logs[0] - logs[-1]) / (half_cycles[-1] * math.pi)
        period = (
            mean_period(times)
            if full.size == count - 2
            else float(np.mean((times[2:] - times[:-2])[full]))
        )
        zeta = delta / math.sqrt(1 + delta**2)
        w0 = 2 * math.pi / (period * math.sqrt(1 - zeta**2))
        return np.array([w0, 2 * zeta * w0])

    values = np.concatenate((size, small.time))
    estimates = compute(values)
    stderr = np.concatenate((small.stderr_amplitude, small.stderr_time))
    covariance = propagated(compute, values, stderr)
    if not small.known:
        misfit = math.nan
    if misfit > MISFIT:
        warnings.append(
            f"the decay is not exponential: chi^2 per degree of freedom is {misfit:.3g} about a "
            f"straight line of decrement {-decrements[1] / math.pi:.3g}; the errors do not "
            "include non-viscous damping"
        )
    names = ("w0", "c_over_m")
    return identified(
        names,
        estimates,
        covariance,
        used=(
            f"the first and the last of peaks {small.index[0]} to {small.index[-1]} "
            f"({count}{under}); the mean of {full.size} overlapping periods"
        ),
        warnings=warnings,
        misfit=misfit if small.known else None,
    )
