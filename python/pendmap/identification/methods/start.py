"""Starting values for a fit to a whole record, from methods of peaks or a global search."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import differential_evolution
from scipy.special import ellipk

from pendmap.errors import InputError
from pendmap.identification.methods import energy_balance, repaired
from pendmap.identification.peaks import Peaks, find_peaks, samples
from pendmap.identification.period import envelope

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.identification.methods.base import Identification
    from pendmap.signal import Floats

_DAMPING: Final = (1e-5, 0.5)  # Searched range of ``c_over_m / w0``
_FRICTION: Final = (1e-6, 0.3)  # Searched range of ``Tr / w0^2``, rad
_ZERO: Final = 0.2  # Largest zero error in the search, rad
_MISFIT: Final = 25.0
"""chi^2 per degree of freedom above which a method's values are not used as a start."""
_MOST_PEAKS: Final = 80  # Most peaks compared in the global search


@dataclasses.dataclass(frozen=True)
class StartingValues:
    """Starting values of a fit."""

    w0: float  # rad/s
    c_over_m: float  # 1/s, 0 or more
    Tr: float  # rad/s^2, 0 or more
    offset: float  # zero error of the angle, rad
    source: str  # name of a method, ``global`` or ``guess``


def starting_values(
    time: ArrayLike,
    theta: ArrayLike,
    *,
    sigma: float | None = None,
    trusted: ArrayLike | None = None,
) -> StartingValues:
    """Return starting values by energy balance, else repaired decrement, else global search.

    A method is used if it is applicable, its damping is not significantly negative, and its misfit
    is not large. With at most three peaks a guess is returned; a record without a swing raises
    InputError.
    """
    peaks = find_peaks(time, theta, sigma=sigma, trusted=trusted)
    record = samples(time, theta, trusted)
    start = _start_of(energy_balance.from_peaks(peaks, record), "energy_balance")
    if start is None:
        start = _start_of(repaired.from_peaks(peaks), "combined_repaired")
    if start is not None:
        return start
    if len(peaks.turned) > 3:  # noqa: PLR2004 (four unknowns)
        return global_start(peaks)
    return _guess(*record, peaks)


def global_start(peaks: Peaks, *, seed: int = 0) -> StartingValues:
    """Return starting values by a global search over plausible damping, from at least four peaks.

    Differential evolution over ``c_over_m / w0``, ``Tr / w0^2``, the first peak and the zero error
    of :func:`pendmap.identification.period.envelope`, with the loss ``2 (sqrt(1 + r^2) - 1)``,
    which is robust to outliers. ``w0`` is the median over half cycles of their amplitude-corrected
    frequencies.
    """
    turned = peaks.turned
    if len(turned) < 4:  # noqa: PLR2004
        raise InputError(f"peaks must be 4 or more for a global search, got {len(turned)}")
    numbers = turned.index - turned.index[0]
    count = int(numbers[-1]) + 1
    some = np.unique(np.linspace(0, len(turned) - 1, _MOST_PEAKS).round().astype(int))
    measured = turned.amplitude
    sign = math.copysign(1.0, measured[0]) * (-1.0) ** numbers
    size = np.abs(measured)
    error = np.hypot(np.maximum(turned.stderr_amplitude, 1e-12), 1e-3 * size.max())

    def cost(unknown: Floats) -> Floats:
        gamma, theta_r, scale, zero = unknown.reshape(4, -1)
        made = envelope(scale * size[0], 10.0**gamma, 10.0**theta_r, count)[numbers[some]]
        off = (zero + sign[some, None] * made - measured[some, None]) / error[some, None]
        return np.asarray(np.sum(2 * (np.sqrt(1 + off**2) - 1), axis=0))

    bounds = [
        tuple(math.log10(edge) for edge in _DAMPING),
        tuple(math.log10(edge) for edge in _FRICTION),
        (0.8, 1.2 if 1.2 * size[0] < math.pi else math.pi / size[0]),
        (-_ZERO, _ZERO),
    ]
    best = differential_evolution(
        cost, bounds, seed=seed, vectorized=True, updating="deferred", polish=False, maxiter=120
    ).x
    gamma, theta_r, zero = 10.0 ** best[0], 10.0 ** best[1], float(best[3])
    w0 = _frequency(turned, zero)
    return StartingValues(w0, float(gamma * w0), float(theta_r * w0**2), zero, "global")


def _frequency(peaks: Peaks, zero: float) -> float:
    """Return the median over half cycles of the amplitude-corrected frequency, rad/s."""
    size = np.minimum(np.abs(peaks.amplitude - zero), math.pi - 1e-3)
    quarter = ellipk(np.sin(size / 2) ** 2)
    steps = np.diff(peaks.index)
    return float(np.median(steps * (quarter[1:] + quarter[:-1]) / np.diff(peaks.time)))


def _start_of(found: Identification, source: str) -> StartingValues | None:
    """Return starting values from a method's result; None if they are implausible."""
    if not found.applicable:
        return None
    for name in ("c_over_m", "Tr"):
        estimate = found.estimates[name]
        if not math.isfinite(estimate.value) or estimate.value < -3 * (estimate.stderr or 0.0):
            return None
    if not found["w0"] > 0 or (found.misfit is not None and found.misfit > _MISFIT):
        return None
    damping = max(found["c_over_m"], 0.0), max(found["Tr"], 0.0)
    return StartingValues(found["w0"], *damping, found["offset"], source)


def _guess(time: Floats, theta: Floats, peaks: Peaks) -> StartingValues:
    """Return w0 from half or quarter periods, and a typical damping."""
    if len(peaks) > 1:
        w0 = _frequency(peaks, 0.0)
    else:
        # One quarter period, from the largest angle to the first zero.
        far = int(np.argmax(np.abs(theta)))
        passed = np.flatnonzero(theta[far:] * theta[far] < 0)
        if passed.size == 0:
            raise InputError("the record must be a decay with a zero crossing, it does not swing")
        amplitude = min(abs(float(theta[far])), 3.1)
        quarter = float(time[far + passed[0]] - time[far])
        w0 = float(ellipk(math.sin(amplitude / 2) ** 2)) / quarter
    return StartingValues(w0, 0.01 * w0, 1e-3 * w0**2, 0.0, "guess")
