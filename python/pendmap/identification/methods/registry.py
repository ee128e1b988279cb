"""Registry of all methods by name, and the application of those of peaks."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import Estimate
from pendmap.identification.methods import combined, energy_balance, lines, repaired
from pendmap.identification.methods.base import NEEDS_SAMPLES, Identification, inapplicable
from pendmap.signal.robust import normal_scale

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


BEST: Final = "trajectory"  # The default method

_OF_PEAKS: Final[Mapping[str, Callable[[Peaks], Identification]]] = {
    "combined": combined.from_peaks,
    "combined_repaired": repaired.from_peaks,
    "log_decrement": lines.log_decrement,
    "de_paula": lines.de_paula,
}

METHODS: Final = (BEST, *_OF_PEAKS, "energy_balance")
"""Names of all methods, the default first, then in the order of the paper's tables."""


def check_names(methods: Iterable[str] | None) -> list[str]:
    """Return the names of methods, all by default; raise InputError for unknown names."""
    if isinstance(methods, str):
        raise InputError(f"methods must be a list of names, like [{methods!r}], got {methods!r}")
    names = list(METHODS) if methods is None else list(dict.fromkeys(methods))
    unknown = [name for name in names if name not in METHODS]
    if unknown:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {unknown[0]!r}")
    return names


def apply_method(
    name: str, peaks: Peaks, record: tuple[Floats, Floats] | None = None
) -> Identification:
    """Return the result of a method for the peaks of a free decay, also an inapplicable one.

    ``record`` are the samples of the decay, s and rad, if there are any.
    """
    if peaks.lacking:
        result = inapplicable(peaks.lacking)
    elif name == "energy_balance" and record is not None:
        result = energy_balance.from_peaks(peaks, record)
    else:
        result = _OF_PEAKS[name](peaks) if name in _OF_PEAKS else inapplicable(NEEDS_SAMPLES)
    return dataclasses.replace(result, method=name)


def identify_peaks(peaks: Peaks, names: Iterable[str]) -> dict[str, Identification]:
    """Identify damping from measured peaks alone.

    Standard errors of peaks are estimated from their scatter; with too few peaks there are none,
    and no intervals.
    """
    size = peaks.time.shape
    peaks = dataclasses.replace(
        peaks.later(-float(peaks.time[0])) if len(peaks) else peaks,
        stderr_time=np.full(size, scatter(peaks.time)),
        stderr_amplitude=np.full(size, scatter(np.abs(peaks.amplitude))),
    )
    results = {name: apply_method(name, peaks) for name in names}
    for name, one in results.items():
        # Errors of 0 are unknown errors; a fit estimates errors from its residuals.
        if not peaks.known and not any(estimate.stderr for estimate in one.estimates.values()):
            bare = {n: Estimate(estimate.value) for n, estimate in one.estimates.items()}
            results[name] = dataclasses.replace(one, estimates=bare, covariance=None)
    return results


FEWEST: Final = 16  # Fewest values from which a scatter is estimated: eight differences, to a third

_DIFFERENCE: Final = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Coefficients of the fourth difference, which vanishes for a cubic."""


def scatter(values: Floats) -> float:
    """Return the standard deviation of the noise of successive values; 0 if there are too few.

    It is estimated from the median of fourth differences of every second value, since a zero error
    separates odd and even peaks; for white noise these have 70 times its variance.
    """
    if values.size < FEWEST:
        return 0.0
    size = values.size - 8
    differences: Floats = sum(
        weight * values[2 * k : 2 * k + size] for k, weight in enumerate(_DIFFERENCE)
    )
    return normal_scale(np.asarray(differences)) / float(np.sqrt(np.sum(_DIFFERENCE**2)))
