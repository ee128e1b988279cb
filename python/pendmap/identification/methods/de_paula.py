"""De Paula's split: viscous damping where the swing is fast, friction where it is slow."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.identification.methods.base import Identification, too_few
from pendmap.identification.methods.combined import CUT, unphysical
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.period import frequency
from pendmap.identification.uncertainty import estimates, jacobian, least_squares_line

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]


FAST: Final = (CUT, math.radians(90.0))
"""Amplitudes between which the decay is taken for exponential, rad."""
SLOW: Final = (0.0, CUT)
"""Amplitudes between which it is taken for linear, rad."""

_NAME = "de_paula"
_FEWEST = 3
_MISFIT = 2.0


def identify(  # noqa: PLR0913 (record, then what may be chosen)
    time: ArrayLike,
    theta: ArrayLike,
    *,
    sigma: float | None = None,
    trusted: ArrayLike | None = None,
    peaks: Peaks | None = None,
    fast: tuple[float, float] = FAST,
    slow: tuple[float, float] = SLOW,
) -> Identification:
    """Identify viscous damping and Coulomb friction apart, each where it is thought to rule.

    Where the swing is fast ``abs(th) ~ exp(-c_over_m t / 2)`` is fitted, where it is slow
    ``abs(th) ~ -(2 Tr / (pi w0)) t``: friction takes ``2 theta_r`` of a half cycle's amplitude.
    Each takes the other's damping for its own. Where the windows lie decides the result; they are
    stated in ``used``.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, and rad from the downward rest, unwrapped.
    sigma : float, optional
        Noise of a sample, rad; by default estimated.
    trusted : array of bool, shape (N,), optional
        Samples that may be used.
    peaks : Peaks, optional
        Those of the record, where they are known; by default found.
    fast, slow : (float, float)
        Amplitudes of the two windows, rad: 12 to 90 degrees and 0 to 12 degrees.

    Returns
    -------
    Identification
        ``w0`` (amplitude-corrected, from both windows), ``c_over_m``, ``Tr``. The errors are those
        of straight lines, widened by what these leave.

    References
    ----------
    De Paula, Savi & Pereira-Pinto (2006), "Chaos and transient chaos in an experimental nonlinear
    pendulum", J. Sound Vib.; the windows are ours.
    """
    if peaks is None:
        peaks = find_peaks(time, theta, sigma=sigma, trusted=trusted)
    return from_peaks(peaks, fast=fast, slow=slow)


def from_peaks(
    peaks: Peaks, *, fast: tuple[float, float] = FAST, slow: tuple[float, float] = SLOW
) -> Identification:
    """Identify damping from peaks; see :func:`identify`."""
    turned = peaks.turned
    size = np.abs(turned.amplitude)
    windows = {"fast": fast, "slow": slow}
    chosen = {n: turned.select((size >= low) & (size < high)) for n, (low, high) in windows.items()}
    lacking = [
        too_few(_NAME, len(some), _FEWEST, of=len(turned), where=_between(windows[name]))
        for name, some in chosen.items()
        if len(some) < _FEWEST
    ]
    if lacking:  # both windows are said where both are wanting
        texts = tuple(text for each in lacking for text in each.warnings)
        return Identification(_NAME, warnings=texts, applicable=False)
    quick, slack = chosen["fast"], chosen["slow"]
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
        if misfit > _MISFIT and turned.known:
            warnings.append(
                f"the decay is not {name} where it is taken for it: chi^2 per degree of freedom "
                f"is {misfit:.3g}; the errors are widened by it, and yet too small"
            )

    def compute(values: Floats) -> Floats:
        w0, slope, drop = values
        return np.array([w0, -2 * slope, -drop * math.pi * w0 / 2])

    inner = np.array([speed.w0, rate[1], fall[1]])
    errors = np.array([speed.stderr, rate_cov[1, 1] ** 0.5, fall_cov[1, 1] ** 0.5])
    slopes = jacobian(compute, inner, errors / 10)
    covariance = slopes * errors**2 @ slopes.T
    found = compute(inner)
    names = ("w0", "c_over_m", "Tr")
    warnings += unphysical(dict(zip(names, found, strict=True)))
    used = (
        f"exponential through the {len(quick)} peaks {_between(fast)}, straight line through the "
        f"{len(slack)} {_between(slow)}; times of all of these"
    )
    return Identification(
        _NAME,
        estimates(names, found, covariance),
        used,
        tuple(warnings),
        covariance=(names, np.asarray(covariance)),
    )


def _between(window: tuple[float, float]) -> str:
    low, high = (math.degrees(edge) for edge in window)
    return f"between {low:.3g} and {high:.3g} degrees"
