"""Registry of all methods by name, and their application to one record."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import Estimate
from pendmap.identification.methods import (
    combined,
    de_paula,
    energy_balance,
    log_decrement,
    repaired,
    trajectory,
)
from pendmap.identification.methods.base import NEEDS_SAMPLES, Identification, inapplicable
from pendmap.identification.peaks import find_peaks, samples
from pendmap.signal.robust import from_first, normal_scale

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from numpy.typing import ArrayLike

    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


BEST: Final = "trajectory"  # The default method

_OF_PEAKS: Final[Mapping[str, Callable[[Peaks, tuple[Floats, Floats] | None], Identification]]] = {
    "combined": combined.from_peaks,
    "combined_odd_ends": functools.partial(combined.from_peaks, reading="odd_ends"),
    "combined_odd_triplets": functools.partial(combined.from_peaks, reading="odd_triplets"),
    "combined_repaired": lambda peaks, _: repaired.from_peaks(peaks),
    "log_decrement": lambda peaks, _: log_decrement.from_peaks(peaks),
    "de_paula": lambda peaks, _: de_paula.from_peaks(peaks),
    "energy_balance": energy_balance.from_peaks,
}
"""Methods of peaks by name, which also read the samples (s, rad) of the record if it has them."""

METHODS: Final = (BEST, *_OF_PEAKS)
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


def identify_record(  # noqa: PLR0913 (the record, and what is known of it)
    time: ArrayLike,
    theta: ArrayLike,
    *,
    sigma: float | None = None,
    trusted: ArrayLike | None = None,
    methods: Iterable[str] | None = None,
    peaks: Peaks | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, Identification]:
    """Return the results of several methods for one free decay (s, rad), also inapplicable ones.

    ``sigma`` (rad), ``trusted`` and ``peaks`` are by default found from the record.
    """
    names = check_names(methods)
    elapsed, first = from_first(time)
    record = samples(elapsed, theta, trusted)
    if record[0].size == 0:
        raise InputError("time must have samples of a decay, got none that may be used")
    known: dict[str, Any] = {"sigma": sigma, "trusted": trusted}
    if peaks is None and names != [BEST]:
        peaks = find_peaks(time, theta, **known)
    results = {}
    for name in names:
        if peaks is None or name == BEST:
            one = trajectory.identify(time, theta, **known)
        else:
            one = _OF_PEAKS[name](peaks.later(-first), record)
        results[name] = dataclasses.replace(one, method=name)
        if progress is not None:
            progress(len(results), len(names))
    return results


def identify_peaks(peaks: Peaks, methods: Iterable[str] | None = None) -> dict[str, Identification]:
    """Identify damping from measured peaks alone.

    Standard errors of peaks are estimated from their scatter unless given; with too few peaks there
    are none, and no intervals.
    """
    peaks = peaks.later(-float(peaks.time[0])) if len(peaks) else peaks
    if not peaks.known:
        size = peaks.time.shape
        peaks = dataclasses.replace(
            peaks,
            stderr_time=np.full(size, scatter(peaks.time)),
            stderr_amplitude=np.full(size, scatter(np.abs(peaks.amplitude))),
        )
    results = {}
    for name in check_names(methods):
        one = inapplicable(NEEDS_SAMPLES) if name == BEST else _OF_PEAKS[name](peaks, None)
        results[name] = one = dataclasses.replace(one, method=name)
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
