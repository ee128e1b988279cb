"""Corrected combined decrement: least squares over all peaks, with the angle's zero error."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import least_squares

from pendmap.identification.methods.base import MISFIT, Identification, identified, too_few
from pendmap.identification.methods.combined import CUT, recursion, small_peaks
from pendmap.identification.peaks import frequency
from pendmap.identification.uncertainty import jacobian

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


_FEWEST: Final = 6  # Fewest peaks below the cut


def from_peaks(peaks: Peaks) -> Identification:
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
    if count < _FEWEST:
        under = f"under {math.degrees(CUT):.3g} degrees"
        return too_few(count, _FEWEST, len(peaks.turned), under, warnings)
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
