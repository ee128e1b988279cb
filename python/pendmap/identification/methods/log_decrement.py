"""The classic logarithmic decrement: viscous damping alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from pendmap.identification.methods.base import Identification, too_few
from pendmap.identification.methods.combined import CUT, unphysical
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.period import mean_period
from pendmap.identification.uncertainty import estimates, jacobian, least_squares_line

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]


Reading = Literal["ends", "line"]
_NAME = "log_decrement"
_FEWEST = 3
_MISFIT = 2.0


def identify(  # noqa: PLR0913 (record, then what may be chosen)
    time: ArrayLike,
    theta: ArrayLike,
    *,
    sigma: float | None = None,
    trusted: ArrayLike | None = None,
    peaks: Peaks | None = None,
    reading: Reading = "ends",
    cut: float = CUT,
) -> Identification:
    """Identify viscous damping by the logarithmic decrement.

    ``delta = ln(abs(th_0) / abs(th_n)) / (n pi)`` over ``n`` half cycles,
    ``zeta = delta / sqrt(1 + delta^2)``, ``w0`` from the mean period. Coulomb friction is taken for
    viscous damping: the decrement grows as the swing falls, so the result says as much about the
    window as about the pendulum.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, and rad from the downward rest, unwrapped.
    sigma : float, optional
        Noise of a sample, rad; by default estimated.
    trusted : array of bool, shape (N,), optional
        Samples that may be used.
    peaks : Peaks, optional
        Those of the record, where they are known; by default found.
    reading : {"ends", "line"}
        Between the first and the last peak, as in the textbooks (the mean of all decrements is the
        same), or the slope of a straight line through all ``ln abs(th_k)``.
    cut : float
        Peaks above are dropped, rad; ``math.inf`` keeps all.

    Returns
    -------
    Identification
        ``w0`` and ``c_over_m``; there is no ``Tr``.
    """
    if peaks is None:
        peaks = find_peaks(time, theta, sigma=sigma, trusted=trusted)
    return from_peaks(peaks, reading=reading, cut=cut)


def from_peaks(peaks: Peaks, *, reading: Reading = "ends", cut: float = CUT) -> Identification:
    """Identify damping from peaks; see :func:`identify`."""
    small = peaks.turned
    small = small.select(np.abs(small.amplitude) < cut)
    under = "" if math.isinf(cut) else f" under {math.degrees(cut):.3g} degrees"
    if len(small) < _FEWEST:
        total = len(peaks.turned)
        return too_few(_NAME, len(small), _FEWEST, of=total, where=under.strip())
    count, warnings = len(small), []
    half_cycles = (small.index - small.index[0]).astype(float)
    size = np.abs(small.amplitude)
    relative = np.maximum(small.stderr_amplitude, 1e-12) / size
    decrements, _, misfit = least_squares_line(half_cycles, np.log(size), relative)
    full = np.flatnonzero(small.index[2:] - small.index[:-2] == 2)  # noqa: PLR2004 (one cycle)
    if full.size == 0:
        text = f"not applicable: no two peaks{under} are one cycle apart"
        return Identification(_NAME, warnings=(text,), applicable=False)

    def compute(values: Floats) -> Floats:
        logs, times = np.log(values[:count]), values[count:]
        if reading == "ends":
            delta = (logs[0] - logs[-1]) / (half_cycles[-1] * math.pi)
        else:
            weights = relative**-2
            centred = half_cycles - np.average(half_cycles, weights=weights)
            delta = -(weights * centred) @ logs / ((weights * centred) @ centred) / math.pi
        period = (
            mean_period(times)
            if full.size == count - 2
            else float(np.mean((times[2:] - times[:-2])[full]))
        )
        zeta = delta / math.sqrt(1 + delta**2)
        w0 = 2 * math.pi / (period * math.sqrt(1 - zeta**2))
        return np.array([w0, 2 * zeta * w0])

    values = np.concatenate((size, small.time))
    stderr = np.concatenate((small.stderr_amplitude, small.stderr_time))
    found = compute(values)
    slopes = jacobian(compute, values, stderr / 10)
    covariance = slopes * stderr**2 @ slopes.T
    if not small.known:
        misfit = math.nan
    if misfit > _MISFIT and reading == "line":
        covariance = covariance * np.array([[1.0, misfit**0.5], [misfit**0.5, misfit]])
    if misfit > _MISFIT:
        warnings.append(
            f"the decay is not exponential: chi^2 per degree of freedom is {misfit:.3g} about a "
            f"straight line of decrement {-decrements[1] / math.pi:.3g}; what is not viscous is "
            "not in the errors"
        )
    names = ("w0", "c_over_m")
    warnings += unphysical(dict(zip(names, found, strict=True)))
    way = "the first and the last of" if reading == "ends" else "a line through the logarithms of"
    used = (
        f"{way} peaks {small.index[0]} to {small.index[-1]} ({count}{under}); the mean of "
        f"{full.size} overlapping periods"
    )
    return Identification(
        _NAME,
        estimates(names, found, covariance),
        used,
        tuple(warnings),
        covariance=(names, np.asarray(covariance)),
        misfit=misfit if small.known else None,
    )
