"""All methods by their names, run on one record."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Final

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
from pendmap.identification.methods.base import Identification
from pendmap.identification.peaks import find_peaks, samples
from pendmap.signal.robust import from_first, normal_scale

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import ArrayLike, NDArray

    from pendmap.identification.peaks import Peaks


@dataclasses.dataclass(frozen=True)
class Method:
    """A method: a record in, an identification out.

    Parameters
    ----------
    identify : callable
        Of ``time``, ``theta``, ``sigma=`` and ``trusted=``, as :func:`identify` has them, and of
        ``peaks=`` where it reads peaks.
    from_peaks : callable or None
        Of :class:`Peaks`, for records of peaks alone; none where it needs every sample.
    reads_peaks : bool
        Whether it takes the peaks of the record, which are then found once for all methods.
    """

    identify: Callable[..., Identification]
    from_peaks: Callable[[Peaks], Identification] | None = None
    reads_peaks: bool = True


METHODS: Final[dict[str, Method]] = {
    "trajectory": Method(trajectory.identify, reads_peaks=False),
    "combined": Method(combined.identify, combined.from_peaks),
    "combined_odd_ends": Method(
        combined.identify_odd_ends, functools.partial(combined.from_peaks, reading="odd_ends")
    ),
    "combined_odd_triplets": Method(
        combined.identify_odd_triplets,
        functools.partial(combined.from_peaks, reading="odd_triplets"),
    ),
    "combined_repaired": Method(repaired.identify, repaired.from_peaks),
    "log_decrement": Method(log_decrement.identify, log_decrement.from_peaks),
    "de_paula": Method(de_paula.identify, de_paula.from_peaks),
    "energy_balance": Method(energy_balance.identify),
}
"""Every method by its name, the default first, then in the order of the paper's tables."""


def check_names(methods: Iterable[str] | None) -> list[str]:
    """Return the names of methods, all by default.

    Raises
    ------
    InputError
        If one is not known.
    """
    if isinstance(methods, str):
        raise InputError(f"methods must be a list of names, like [{methods!r}], got {methods!r}")
    names = list(METHODS) if methods is None else list(dict.fromkeys(methods))
    unknown = [name for name in names if name not in METHODS]
    if unknown:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {unknown[0]!r}")
    return names


def identify(  # noqa: PLR0913 (the record, and what is known of it)
    time: ArrayLike,
    theta: ArrayLike,
    *,
    sigma: float | None = None,
    trusted: ArrayLike | None = None,
    methods: Iterable[str] | None = None,
    peaks: Peaks | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, Identification]:
    """Identify the damping of a pendulum from one free decay by several methods.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, increasing, and rad from the downward rest, unwrapped.
    sigma : float, optional
        Noise of a sample, rad; by default estimated from the record.
    trusted : array of bool, shape (N,), optional
        Samples that may be used; by default all.
    methods : iterable of str, optional
        Names of :data:`METHODS`; by default all.
    peaks : Peaks, optional
        Those of the record, where they are known; by default found.
    progress : callable, optional
        Called with the methods done and those to do.

    Returns
    -------
    dict of str to Identification
        By method. One that is not applicable is there too, and says why.

    Raises
    ------
    InputError
        If a method is not known or the arrays are not a record.
    """
    names = check_names(methods)
    if samples(time, theta, trusted)[0].size == 0:
        raise InputError("time must have samples of a decay, got none that may be used")
    elapsed, first = from_first(time)
    if any(METHODS[name].reads_peaks for name in names):
        if peaks is None:
            peaks = find_peaks(time, theta, sigma=sigma, trusted=trusted)
        peaks = peaks.later(-first)
    found = {}
    for name in names:
        # The trajectory method names the times that it used, and counts from the first one itself.
        own, known = (elapsed, {"peaks": peaks}) if METHODS[name].reads_peaks else (time, {})
        found[name] = METHODS[name].identify(own, theta, sigma=sigma, trusted=trusted, **known)
        if progress is not None:
            progress(len(found), len(names))
    return found


def identify_peaks(peaks: Peaks, methods: Iterable[str] | None = None) -> dict[str, Identification]:
    """Do the same where nothing but peaks was measured.

    Methods that need every sample say that they are not applicable. Where the peaks have no
    standard errors their own scatter tells them; too few for that, and there are no intervals.
    """
    found = {}
    peaks = with_scatter(peaks.later(-float(peaks.time[0])) if len(peaks) else peaks)
    for name in check_names(methods):
        from_peaks = METHODS[name].from_peaks
        text = "not applicable: the record holds peaks alone, and this method needs every sample"
        found[name] = (
            Identification(name, warnings=(text,), applicable=False)
            if from_peaks is None
            else from_peaks(peaks)
        )
    return found if peaks.known else {n: _without_errors(one) for n, one in found.items()}


def _without_errors(found: Identification) -> Identification:
    """Return it without errors of 0, which nobody has; a fit tells its own from what it leaves."""
    if any(each.stderr for each in found.estimates.values()):
        return found
    bare = {name: Estimate(each.value) for name, each in found.estimates.items()}
    return dataclasses.replace(found, estimates=bare, covariance=None)


# The noise of peaks that somebody else has measured: what a smooth course does not explain.


FEWEST: Final = 16
"""Values from which a scatter is told: eight differences, to about a third."""

_DIFFERENCE: Final = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Fourth difference, which a cubic leaves 0."""


def scatter(values: NDArray[np.float64]) -> float:
    """Return the standard deviation of the noise of values in a row; 0 where there are few.

    Fourth differences of every second value, since a zero error moves odd and even peaks apart;
    of white noise they have 70 times its variance. Robust: the median counts.

    Parameters
    ----------
    values : ndarray of float, shape (P,)
        Of a course that a cubic through nine of them follows.
    """
    if values.size < FEWEST:
        return 0.0
    size = values.size - 8
    differences: NDArray[np.float64] = sum(
        weight * values[2 * k : 2 * k + size] for k, weight in enumerate(_DIFFERENCE)
    )
    return normal_scale(np.asarray(differences)) / float(np.sqrt(np.sum(_DIFFERENCE**2)))


def with_scatter(peaks: Peaks) -> Peaks:
    """Return peaks without standard errors with those that their own scatter shows."""
    if peaks.known:
        return peaks
    size = peaks.time.shape
    return dataclasses.replace(
        peaks,
        stderr_time=np.full(size, scatter(peaks.time)),
        stderr_amplitude=np.full(size, scatter(np.abs(peaks.amplitude))),
    )
