"""Registry of all methods by name, and the application of those of peaks."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.identification.methods import combined, lines
from pendmap.identification.methods.base import NEEDS_SAMPLES, Identification, inapplicable
from pendmap.signal.robust import normal_scale

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


BEST: Final = "trajectory"  # The default method

_OF_PEAKS: Final[Mapping[str, Callable[[Peaks], Identification]]] = {
    "combined": combined.from_peaks,
    "combined_repaired": combined.repaired,
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
        result = lines.energy_balance(peaks, record)
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
    return {name: apply_method(name, peaks) for name in names}


FEWEST: Final = 16  # Fewest values from which a scatter is estimated: eight differences, to a third


def scatter(values: Floats) -> float:
    """Return the standard deviation of the noise of successive values; 0 if there are too few.

    It is estimated from the median of fourth differences of every second value, since a zero error
    separates odd and even peaks; for white noise these have 70 times its variance.
    """
    if values.size < FEWEST:
        return 0.0
    differences = np.concatenate([np.diff(values[k::2], n=4) for k in (0, 1)])
    return normal_scale(differences) / math.sqrt(70)
