"""Methods that fit straight lines to peaks: the logarithmic decrement, and de Paula's method.

De Paula, Savi & Pereira-Pinto (2006), "Chaos and transient chaos in an experimental nonlinear
pendulum", J. Sound Vib.; the windows of amplitudes are chosen here.
"""

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
from pendmap.identification.peaks import frequency
from pendmap.identification.uncertainty import least_squares_line, propagated

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


FAST: Final = (CUT, math.radians(90.0))
"""Range of amplitudes in which de Paula's decay is assumed to be exponential, rad."""
SLOW: Final = (0.0, CUT)  # Range of amplitudes in which it is assumed to be linear, rad
_FEWEST: Final = 3  # Fewest peaks of a line


def log_decrement(peaks: Peaks, *, cut: float = CUT) -> Identification:
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
        period = float(np.mean((times[2:] - times[:-2])[full]))
        zeta = delta / math.sqrt(1 + delta**2)
        w0 = 2 * math.pi / (period * math.sqrt(1 - zeta**2))
        return np.array([w0, 2 * zeta * w0])

    values = np.concatenate((size, small.time))
    stderr = np.concatenate((small.stderr_amplitude, small.stderr_time))
    if not small.known:
        misfit = math.nan
    if misfit > MISFIT:
        warnings.append(
            f"the decay is not exponential: chi^2 per degree of freedom is {misfit:.3g} about a "
            f"straight line of decrement {-decrements[1] / math.pi:.3g}; the errors do not "
            "include non-viscous damping"
        )
    return identified(
        ("w0", "c_over_m"),
        compute(values),
        propagated(compute, values, stderr),
        used=(
            f"the first and the last of peaks {small.index[0]} to {small.index[-1]} "
            f"({count}{under}); the mean of {full.size} overlapping periods"
        ),
        warnings=warnings,
        misfit=misfit if small.known else None,
    )


def de_paula(
    peaks: Peaks, *, fast: tuple[float, float] = FAST, slow: tuple[float, float] = SLOW
) -> Identification:
    """Identify viscous damping and Coulomb friction separately, each in its own window.

    ``abs(th) ~ exp(-c_over_m t / 2)`` is fitted to fast swings, ``abs(th) ~ -(2 Tr / (pi w0)) t``
    to slow ones, since friction reduces the amplitude by ``2 theta_r`` per half cycle. Each fit
    attributes all damping to its own law, so the result depends on the windows (rad).
    """
    turned = peaks.turned
    size = np.abs(turned.amplitude)
    quick, slack = (turned.select((size >= low) & (size < high)) for low, high in (fast, slow))
    for some, window in ((quick, fast), (slack, slow)):
        if len(some) < _FEWEST:
            return too_few(len(some), _FEWEST, len(turned), _between(window))
    warnings = []
    speed = frequency(
        turned.select((size < max(fast[1], slow[1])) & (size >= min(fast[0], slow[0])))
    )
    relative = np.maximum(quick.stderr_amplitude, 1e-12) / np.abs(quick.amplitude)
    rate, rate_cov, rate_misfit = least_squares_line(
        quick.time, np.log(np.abs(quick.amplitude)), relative
    )
    error = np.maximum(slack.stderr_amplitude, 1e-12)
    fall, fall_cov, fall_misfit = least_squares_line(slack.time, np.abs(slack.amplitude), error)
    for name, misfit in (("exponential", rate_misfit), ("linear", fall_misfit)):
        if misfit > MISFIT and turned.known:
            warnings.append(
                f"the decay is not {name} in the assumed range: chi^2 per degree of freedom "
                f"is {misfit:.3g}; the errors are widened accordingly, but still too small"
            )

    def compute(values: Floats) -> Floats:
        w0, slope, drop = values
        return np.array([w0, -2 * slope, -drop * math.pi * w0 / 2])

    inner = np.array([speed.w0, rate[1], fall[1]])
    errors = np.array([speed.stderr, rate_cov[1, 1] ** 0.5, fall_cov[1, 1] ** 0.5])
    return identified(
        ("w0", "c_over_m", "Tr"),
        compute(inner),
        propagated(compute, inner, errors),
        used=(
            f"exponential through the {len(quick)} peaks {_between(fast)}, straight line through "
            f"the {len(slack)} {_between(slow)}; times of all of these"
        ),
        warnings=warnings,
    )


def _between(window: tuple[float, float]) -> str:
    low, high = (math.degrees(edge) for edge in window)
    return f"between {low:.3g} and {high:.3g} degrees"
