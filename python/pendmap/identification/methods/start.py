"""Starting values for a fit to a whole record, from methods of peaks or a global search."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import differential_evolution
from scipy.special import ellipk

from pendmap.errors import InputError
from pendmap.identification.methods import energy_balance, repaired
from pendmap.identification.parameters import OPPOSING
from pendmap.identification.peaks import find_peaks, samples
from pendmap.identification.period import envelope

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.identification.methods.base import Identification
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats

_DAMPING: Final = (1e-5, 0.5)  # Searched range of ``c_over_m / w0``
_FRICTION: Final = (1e-6, 0.3)  # Searched range of ``Tr / w0^2``, rad
_ZERO: Final = 0.2  # Largest zero error in the search, rad
_MISFIT: Final = 25.0
"""chi^2 per degree of freedom above which a method's values are not used as a start."""
_MOST_PEAKS: Final = 80  # Most peaks compared in the global search


class TooShortError(InputError):
    """Error raised for a record with too few decaying half swings for starting values."""


def starting_values(
    time: ArrayLike, theta: ArrayLike, *, sigma: float | None = None
) -> dict[str, float]:
    """Return w0, c_over_m, Tr by energy balance, else repaired decrement, else global search.

    A method is used if it is applicable, its damping is not significantly negative, and its misfit
    is not large. TooShortError is raised for fewer than four peaks.
    """
    peaks = find_peaks(time, theta, sigma=sigma)
    return (
        _start_of(energy_balance.from_peaks(peaks, samples(time, theta)))
        or _start_of(repaired.from_peaks(peaks))
        or global_start(peaks)
    )


def global_start(peaks: Peaks, *, seed: int = 0) -> dict[str, float]:
    """Return starting values by a global search over plausible damping, from at least four peaks.

    Differential evolution over ``c_over_m / w0``, ``Tr / w0^2``, the first peak and the zero error
    of :func:`pendmap.identification.period.envelope`, with the loss ``2 (sqrt(1 + r^2) - 1)``,
    which is robust to outliers. ``w0`` is the median over half cycles of their amplitude-corrected
    frequencies.
    """
    turned = peaks.turned
    if len(turned) < 4:  # noqa: PLR2004 (four unknowns)
        raise TooShortError(
            "the record must show three half swings or more of a free decay, or a natural frequency"
            " must be given: w0 = 6.2 under [rig] in experiment.toml"
        )
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
    # The frequency is corrected for the amplitudes.
    size = np.minimum(np.abs(turned.amplitude - zero), math.pi - 1e-3)
    quarter = ellipk(np.sin(size / 2) ** 2)
    steps = np.diff(turned.index)
    w0 = float(np.median(steps * (quarter[1:] + quarter[:-1]) / np.diff(turned.time)))
    return {"w0": w0, "c_over_m": float(gamma * w0), "Tr": float(theta_r * w0**2)}


def _start_of(result: Identification) -> dict[str, float] | None:
    """Return starting values from a method's result; None if they are implausible."""
    if not result.applicable:
        return None
    for name in OPPOSING:
        estimate = result.estimates[name]
        if not math.isfinite(estimate.value) or estimate.value < -3 * (estimate.stderr or 0.0):
            return None
    if not result["w0"] > 0 or (result.misfit is not None and result.misfit > _MISFIT):
        return None
    return {
        "w0": result["w0"],
        "c_over_m": max(result["c_over_m"], 0.0),
        "Tr": max(result["Tr"], 0.0),
    }
