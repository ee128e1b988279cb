"""Methods that fit straight lines to peaks, and the balance of energy between them.

The logarithmic decrement; de Paula, Savi & Pereira-Pinto (2006), "Chaos and transient chaos in an
experimental nonlinear pendulum", J. Sound Vib. (the windows of amplitudes are chosen here); and the
loss of each half cycle against the work of viscous damping and friction: Liang & Feeny (2006),
"Balancing energy to estimate damping parameters in forced oscillators", J. Sound Vib., applied to
the half cycles of a free decay.
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
from pendmap.identification.peaks import frequency, viscous_work
from pendmap.identification.uncertainty import (
    chain_covariance,
    chain_least_squares,
    least_squares_line,
    propagated,
)
from pendmap.signal.local_polynomial import smoothed_velocity

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats, Indices


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


_FEWEST_CYCLES: Final = 5  # Fewest peaks
_LARGEST: Final = 2.0
"""Amplitude below which peaks determine w0, rad: above, damping affects the half period."""
_PHASE: Final = 0.5  # Half-width of the windows in which the velocity is fitted, rad of phase w0 t
_SAMPLES: Final = 25
"""Samples per period below which a warning is given: the quartic smooths the velocity."""


def energy_balance(peaks: Peaks, record: tuple[Floats, Floats]) -> Identification:
    """Identify viscous damping and Coulomb friction from the energy loss of each half cycle.

    ``w0^2 (cos(x_{k+1} - b) - cos(x_k - b)) = c_over_m int th'^2 dt + Tr abs(x_{k+1} - x_k)``
    between the peaks ``x_k``, with the angle's zero error ``b``, at any amplitude. The integral is
    over measured velocities from local quartics, less the noise's share; across a gap it is that of
    an undamped pendulum. Generalized least squares account for peaks shared by half cycles.
    """
    turned = peaks.turned
    if len(turned) < _FEWEST_CYCLES:
        return too_few(len(turned), _FEWEST_CYCLES, len(turned))
    pairs = np.flatnonzero(np.diff(turned.index) == 1)
    small = turned.select(np.abs(turned.amplitude) < _LARGEST)
    if len(small) < _FEWEST_CYCLES:
        return too_few(len(small), _FEWEST_CYCLES, len(turned), f"under {_LARGEST:g} rad")
    if pairs.size < _FEWEST_CYCLES - 1:
        return inapplicable(f"{pairs.size} whole half cycles, {_FEWEST_CYCLES - 1} are needed")
    w0 = frequency(small).w0
    work = _measured_work(record, turned, pairs, w0)
    zero, values, covariance, misfit = 0.0, np.empty(0), np.empty((0, 0)), 1.0
    for _ in range(5):
        w0 = frequency(small, offset=zero).w0
        values, covariance, misfit = _balance(turned, pairs, work, w0, zero)
        zero += float(values[2])
    zeta = float(values[0]) / (2 * w0)
    period = frequency(small, zeta=min(abs(zeta), 0.9), offset=zero)
    estimates = np.array([period.w0, values[0], values[1], zero])
    # Energies are in units of w0^2: its error propagates to both dampings.
    full = np.zeros((4, 4))
    full[1:, 1:] = covariance
    lever = np.array([1.0, 2 * estimates[1] / period.w0, 2 * estimates[2] / period.w0, 0.0])
    full += np.outer(lever, lever) * period.stderr**2
    warnings = []
    period_samples = 2 * math.pi / w0 / float(np.median(np.diff(record[0])))
    if period_samples < _SAMPLES:
        warnings.append(
            f"{period_samples:.3g} samples a period: below {_SAMPLES} velocities are smoothed, and "
            "the errors are too small"
        )
    if misfit > MISFIT:
        warnings.append(
            f"the balance does not close: chi^2 per degree of freedom is {misfit:.3g}; the errors "
            "are widened by it"
        )
    return identified(
        ("w0", "c_over_m", "Tr", "offset"),
        estimates,
        full,
        used=(
            f"{pairs.size} half cycles between peaks {turned.index[0]} and {turned.index[-1]}; w0 "
            f"from the {len(small)} peaks under {math.degrees(_LARGEST):.3g} degrees"
        ),
        warnings=warnings,
        misfit=misfit,
    )


def _balance(
    peaks: Peaks, pairs: Indices, work: Floats, w0: float, zero: float
) -> tuple[Floats, Floats, float]:
    """Return ``c_over_m``, ``Tr``, change of the zero; covariance; chi^2 per degree of freedom."""
    x = peaks.amplitude - zero
    later = pairs + 1
    lost = w0**2 * (np.cos(x[later]) - np.cos(x[pairs]))
    way = np.abs(x[later] - x[pairs])
    tilt = w0**2 * (np.sin(x[pairs]) - np.sin(x[later]))
    # d lost / d zero = w0^2 (sin x_later - sin x_before).
    rows = np.column_stack((work, way, tilt))
    variance = np.maximum(peaks.stderr_amplitude, 1e-12) ** 2
    noise = chain_covariance(pairs, w0**2 * np.sin(x[pairs]), -(w0**2) * np.sin(x[later]), variance)
    # The second-order effect of noise matters for the energy of small peaks.
    second = w0**4 * variance**2 / 2
    noise[0] += second[pairs] + second[later]
    return chain_least_squares(rows, lost, noise)


def _measured_work(
    record: tuple[Floats, Floats], peaks: Peaks, pairs: Indices, w0: float
) -> Floats:
    """Return ``int th'^2 dt`` over each half cycle, rad^2/s."""
    time, theta = record
    speed, gain = smoothed_velocity(time, theta, _PHASE / w0)
    power = speed**2 - (peaks.sigma * gain) ** 2
    total = np.concatenate(([0.0], np.cumsum(np.diff(time) * (power[1:] + power[:-1]) / 2)))
    ends = np.interp(peaks.time, time, total)
    measured = ends[pairs + 1] - ends[pairs]
    mean = (np.abs(peaks.amplitude[pairs]) + np.abs(peaks.amplitude[pairs + 1])) / 2
    expected = w0 * viscous_work(mean)
    first = np.searchsorted(time, peaks.time)
    widest = np.array(
        [np.diff(time[first[k] : first[k + 1]], prepend=peaks.time[k]).max() for k in pairs]
    )
    return np.where(widest > 0.1 * 2 * math.pi / w0, expected, measured)
