"""Energy balance: the loss of each half cycle against the work of viscous damping and friction.

Liang & Feeny (2006), "Balancing energy to estimate damping parameters in forced oscillators",
J. Sound Vib.; here it is applied to the half cycles of a free decay.
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
from pendmap.identification.peaks import frequency, viscous_work
from pendmap.identification.uncertainty import chain_covariance, chain_least_squares
from pendmap.signal.local_polynomial import smoothed_velocity

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats, Indices


_FEWEST: Final = 5  # Fewest peaks
_LARGEST: Final = 2.0
"""Amplitude below which peaks determine w0, rad: above, damping affects the half period."""
_PHASE: Final = 0.5  # Half-width of the windows in which the velocity is fitted, rad of phase w0 t
_SAMPLES: Final = 25
"""Samples per period below which a warning is given: the quartic smooths the velocity."""


def from_peaks(peaks: Peaks, record: tuple[Floats, Floats]) -> Identification:
    """Identify viscous damping and Coulomb friction from the energy loss of each half cycle.

    ``w0^2 (cos(x_{k+1} - b) - cos(x_k - b)) = c_over_m int th'^2 dt + Tr abs(x_{k+1} - x_k)``
    between the peaks ``x_k``, with the angle's zero error ``b``, at any amplitude. The integral is
    over measured velocities from local quartics, less the noise's share; across a gap it is that of
    an undamped pendulum. Generalized least squares account for peaks shared by half cycles.
    """
    turned = peaks.turned
    if len(turned) < _FEWEST:
        return too_few(len(turned), _FEWEST, len(turned))
    pairs = np.flatnonzero(np.diff(turned.index) == 1)
    small = turned.select(np.abs(turned.amplitude) < _LARGEST)
    if len(small) < _FEWEST:
        return too_few(len(small), _FEWEST, len(turned), f"under {_LARGEST:g} rad")
    if pairs.size < _FEWEST - 1:
        return inapplicable(f"{pairs.size} whole half cycles, {_FEWEST - 1} are needed")
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
