"""Combined decrement of viscous damping and Coulomb friction.

Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, section 2, eqs. 2.4 to 2.10: as printed,
and corrected by least squares over all peaks, with the zero error of the angle.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import least_squares

from pendmap.identification.methods.base import (
    MISFIT,
    Identification,
    identified,
    inapplicable,
    too_few,
)
from pendmap.identification.peaks import frequency, mean_period
from pendmap.identification.uncertainty import bootstrap, jacobian, propagated

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


CUT: Final = math.radians(12.0)
"""Amplitude above which peaks are excluded, rad: the pendulum is nonlinear there."""

_FEWEST: Final = 4  # Fewest peaks below the cut


def recursion(first: float, delta: float, theta_r: float, count: int) -> Floats:
    """Return the absolute values of peaks by eqs. 2.4 to 2.6, shape (count,).

    ``abs(th_k) = -theta_r (E + 1) + E abs(th_{k-1})``, ``E = exp(-delta pi)``. Negative values,
    after the pendulum has stopped, are meaningless.
    """
    shrink = math.exp(-delta * math.pi)
    result = np.empty(count)
    result[0] = first
    for k in range(1, count):
        result[k] = -theta_r * (shrink + 1) + shrink * result[k - 1]
    return result


def decrement(peaks: Floats) -> float:
    """Return ``delta`` by eq. 2.7, from the first two and the last two absolute peaks.

    ``delta = ln[(th_0 - th_1) / (th_{k-1} - th_k)] / ((k - 1) pi)``; the peaks between them cancel.
    NaN if the ratio is not positive.
    """
    ratio = (peaks[0] - peaks[1]) / (peaks[-2] - peaks[-1])
    if not ratio > 0:
        return math.nan
    return float(math.log(ratio) / ((peaks.size - 2) * math.pi))


def coulomb(peaks: Floats) -> float:
    """Return ``theta_r = Tr / w0^2``, rad, by eq. 2.10, from the first and last two peaks."""
    first, second, last_but_one, last = peaks[0], peaks[1], peaks[-2], peaks[-1]
    below = second + first - last_but_one - last
    return float((second * last_but_one - first * last) / below) if below else math.nan


def triplets(peaks: Floats) -> tuple[Floats, Floats]:
    """Return ``delta`` and ``theta_r`` (figure 5) of each three consecutive peaks, (P - 2,)."""
    first, second, third = peaks[:-2], peaks[1:-1], peaks[2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        delta = np.log((first - second) / (second - third)) / math.pi
        theta_r = (second**2 - first * third) / (first - third)
    return delta, theta_r


def from_amplitudes(values: Floats) -> Floats:
    """Return ``w0, c_over_m, Tr``, SI, from absolute peaks and, behind them, their times.

    ``zeta = delta / sqrt(1 + delta^2)``, ``w0 = 2 pi / (mean_period sqrt(1 - zeta^2))``.
    """
    peaks, times = np.split(values, 2)
    delta = decrement(peaks)
    zeta = delta / math.sqrt(1 + delta**2)
    w0 = 2 * math.pi / (mean_period(times) * math.sqrt(1 - zeta**2))
    return np.array([w0, 2 * zeta * w0, w0**2 * coulomb(peaks)])


def small_peaks(peaks: Peaks, cut: float = CUT) -> tuple[Peaks, list[str]]:
    """Return the longest row of consecutive peaks below a cut, and warnings."""
    small = peaks.turned
    above = np.flatnonzero(np.abs(small.amplitude) >= cut)
    small = small.select(np.arange(len(small)) > (above[-1] if above.size else -1))
    gaps = np.flatnonzero(np.diff(small.index) != 1)
    warnings = []
    if gaps.size:
        parts = np.split(np.arange(len(small)), gaps + 1)
        longest = max(parts, key=len)
        warnings.append(f"peaks are missing: the longest sequence, of {longest.size}, is used")
        small = small.select(np.isin(np.arange(len(small)), longest))
    return small, warnings


def from_peaks(peaks: Peaks) -> Identification:
    """Identify viscous damping and Coulomb friction by the combined decrement as printed.

    Peaks above the cut (12 degrees) are excluded; eq. 2.7 gives ``delta``, eq. 2.10 ``theta_r``,
    the mean period ``w0 = 2 pi / (mean_period sqrt(1 - zeta^2))``; standard errors are by the delta
    method, intervals by a parametric bootstrap of the peaks. The method is biased by the
    nonlinearity (1.5 % in delta at 12 degrees) and by a zero error of the angle, and eq. 2.7 uses
    only four peaks; :func:`repaired` corrects that.
    """
    small, warnings = small_peaks(peaks)
    size = np.abs(small.amplitude)
    while size.size > _FEWEST and not size[-2] > size[-1]:
        size = size[:-1]
    if size.size < len(small):
        few = len(small) - size.size
        warnings.append(f"the last peaks ({few}) do not decrease and were dropped")
        small = small.select(np.arange(len(small)) < size.size)
    if size.size < _FEWEST:
        where = f"under {math.degrees(CUT):.3g} degrees"
        why = ": the record ends above it" if len(peaks) and not len(small) else ""
        return too_few(size.size, _FEWEST, len(peaks.turned), where, warnings, why)
    count = len(small)
    values = np.concatenate((size, small.time))
    stderr = np.concatenate((small.stderr_amplitude, small.stderr_time))
    estimates = from_amplitudes(values)
    if not np.isfinite(estimates).all():
        reason = "a difference of peaks has the wrong sign: no logarithm in eq. 2.7"
        return inapplicable(reason, warnings)
    covariance = propagated(from_amplitudes, values, stderr)
    draws = bootstrap(from_amplitudes, values, stderr)
    failed = float(np.mean(~np.isfinite(draws).all(axis=1)))
    names = ("w0", "c_over_m", "Tr")
    low, high = np.nanpercentile(draws, (2.5, 97.5), axis=0)
    intervals = {n: (float(low[j]), float(high[j])) for j, n in enumerate(names)}
    if failed > 0.01:  # noqa: PLR2004 (an interval at 95 % hardly notices fewer)
        warnings.append(
            f"noise reverses the sign of a difference of peaks in {failed:.0%} of simulated "
            "repetitions: the errors are too small"
        )
    return identified(
        names,
        estimates,
        covariance,
        intervals=intervals,
        used=(
            f"peaks {small.index[0]} to {small.index[-1]} ({count}, under {math.degrees(CUT):.3g} "
            f"degrees); of them the first two and the last two; the mean of {count - 2} "
            "overlapping periods"
        ),
        warnings=warnings,
    )


FEWEST_REPAIRED: Final = 6  # Fewest peaks below the cut


def repaired(peaks: Peaks) -> Identification:
    """Identify viscous damping and Coulomb friction by the corrected combined decrement.

    All peaks below 12 degrees are fitted by ``x_k = b + s (-1)^k a_k`` with ``a_k`` by eqs. 2.4
    to 2.6 of Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A. The unknowns are ``a_0``,
    ``delta``, ``theta_r`` and the angle's zero error ``b``; weights are from the peaks' standard
    errors. The final half cycle, in which the pendulum stops, is excluded. ``w0`` is from the
    amplitude-corrected period ``T = 4 K(m) / w0``, ``m = sin^2(A/2)``, fitted to the times of these
    peaks. The remaining bias is that of the linear recursion at 12 degrees.
    """
    small, warnings = small_peaks(peaks)
    count = len(small)
    if count < FEWEST_REPAIRED:
        under = f"under {math.degrees(CUT):.3g} degrees"
        return too_few(count, FEWEST_REPAIRED, len(peaks.turned), under, warnings)
    measured = small.amplitude
    sign = math.copysign(1.0, measured[0]) * (-1.0) ** np.arange(count)
    # Given peaks may have no standard errors: then all have equal weights.
    error = small.stderr_amplitude
    known = bool(np.all(error > 0))
    error = error if known else np.ones(count)

    def model(unknown: Floats) -> Floats:
        first, delta, theta_r, zero = unknown
        return np.asarray(zero + sign * recursion(first, delta, theta_r, count))

    size = np.abs(measured)
    slope = (size[0] - size[-1]) / (count - 1)
    start = np.array([size[0], 0.5 * slope / (size.mean() * math.pi), slope / 4, 0.0])
    fit = least_squares(
        lambda u: (model(u) - measured) / error,
        start,
        x_scale=np.maximum(np.abs(start), 1e-4),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    misfit = 2 * float(fit.cost) / (count - 4)
    covariance = np.linalg.inv(fit.jac.T @ fit.jac) * (max(misfit, 1.0) if known else misfit)
    if known and misfit > MISFIT:
        warnings.append(
            f"the recursion does not fit the peaks: chi^2 per degree of freedom is {misfit:.3g}; "
            "the errors are widened by it"
        )
    _, delta, theta_r, zero = fit.x
    zeta = delta / math.sqrt(1 + delta**2)
    # Errors of fitted peaks are negligible relative to those of measured ones.
    times = small.stderr_time
    smooth = dataclasses.replace(
        small,
        amplitude=model(fit.x) - zero,
        stderr_amplitude=np.zeros(count),
        stderr_time=times if np.all(times > 0) else np.ones(count),
    )
    period = frequency(smooth, zeta=zeta)
    period_error = period.stderr
    if not np.all(small.stderr_time > 0):
        period_error *= math.sqrt(min(period.misfit, 1.0))

    def si(unknown: Floats) -> Floats:
        w0, delta, theta_r, zero = unknown
        return np.array([w0, 2 * w0 * delta / math.sqrt(1 + delta**2), w0**2 * theta_r, zero])

    inner = np.zeros((4, 4))
    inner[0, 0] = period_error**2
    inner[1:, 1:] = covariance[1:, 1:]
    values = np.array([period.w0, delta, theta_r, zero])
    slopes = jacobian(si, values, np.sqrt(np.diag(inner)) / 10)
    return identified(
        ("w0", "c_over_m", "Tr", "offset"),
        si(values),
        slopes @ inner @ slopes.T,
        used=(
            f"peaks {small.index[0]} to {small.index[-1]} ({count}, under {math.degrees(CUT):.3g} "
            "degrees), all of them, and their times"
        ),
        warnings=warnings,
        misfit=misfit,
    )
