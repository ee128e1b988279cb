"""Local polynomial fits of a record: without outliers, and following quick motions."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.local_polynomial import LocalFit, local_fit
from pendmap.signal.robust import broad_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

FALSE: Final = 8.0
"""Standard deviations beyond which a residual is an outlier. White noise stays below 6; that of
real encoders has longer tails, which are part of it."""

FEWEST: Final = 40
"""Residuals that a standard deviation is taken from; half a dozen would be wrong by a third."""

KINDS: Final = 16
"""Kinds of speed, with equally many samples, that have outliers of their own."""

LESS: Final = 1.02
"""Ratio of two readings of the noise that counts as less: they aim at a few per cent."""


def clean(fit: LocalFit, bad: NDArray[np.bool_], speed: Floats) -> LocalFit:
    """Leave out windows with samples that are not trusted, then those with outliers."""
    fit = only(fit, ~_near(bad, fit.neighbours)[fit.middle])
    return only(fit, ~_outlying(fit, speed)[fit.middle])


def _outlying(fit: LocalFit, speed: Floats) -> NDArray[np.bool_]:
    """Return which samples share a window with an outlier among residuals of similar speed."""
    false = np.zeros(speed.size, bool)
    sizes = np.abs(fit.residual)
    whole = broad_scale(sizes)
    order = np.argsort(speed[fit.middle], kind="stable")
    for part in np.array_split(order, max(min(KINDS, order.size // (5 * FEWEST)), 1)):
        # Noise that grows with speed is many times stronger at the quickest.
        scale = max(whole, broad_scale(sizes[part]))
        false[fit.middle[part[sizes[part] > FALSE * scale]]] = scale > 0
    return _near(false, fit.neighbours)


def _near(marked: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return what is at most ``reach`` places from something marked."""
    sums = np.concatenate([[0], np.cumsum(marked)])
    place = np.arange(marked.size)
    low, high = np.maximum(place - reach, 0), np.minimum(place + reach + 1, marked.size)
    near: NDArray[np.bool_] = sums[high] > sums[low]
    return near


def less(fit: LocalFit, other: LocalFit) -> bool:
    """Return whether a fit leaves less than another beyond its error: it follows the motion."""
    enough = LESS + 2 * stderr(fit) / max(rms(fit), 1e-300)
    return fit.middle.size >= FEWEST and rms(other) > enough * rms(fit)


def only(fit: LocalFit, which: NDArray[np.bool_]) -> LocalFit:
    """Return a fit with some of its residuals only."""
    return dataclasses.replace(
        fit, middle=fit.middle[which], residual=fit.residual[which], slope=fit.slope[which]
    )


def rms(fit: LocalFit) -> float:
    """Return the root mean square of the residuals, rad."""
    return float(np.sqrt(np.mean(fit.residual**2)))


def stderr(fit: LocalFit) -> float:
    """Return the standard error of the root mean square of residuals that share samples."""
    return rms(fit) * math.sqrt(fit.sum_of_squares / (2 * fit.middle.size))


DEGREES: Final = ((4, 9), (6, 11), (8, 13), (10, 15))
"""Degree and samples of the polynomials that are tried in turn."""

FARTHEST: Final = 0.25
"""Radians of phase between samples that are taken further apart because of coarse counts."""

FURTHER: Final = 4
"""Strides beyond the shortest that are read too. From sample to sample a steady motion may pass
almost whole counts: errors are then alike for long, but not at all strides."""

STIFF: Final = 2.0
"""So many times as far apart may samples be through which the highest degree goes."""


def followed(
    time: Floats, theta: Floats, bad: NDArray[np.bool_], speed: Floats, first: LocalFit
) -> LocalFit:
    """Return the fit of the lowest degree above which no degree leaves less."""
    chosen = first
    for degree, points in DEGREES[1:]:
        higher = clean(local_fit(time, theta, degree=degree, points=points), bad, speed)
        if higher.middle.size < FEWEST:
            break
        if not less(higher, chosen):
            break
        chosen = higher
    return chosen


def apart(  # noqa: PLR0913, PLR0917 (what is known of the record)
    time: Floats,
    theta: Floats,
    bad: NDArray[np.bool_],
    speed: Floats,
    count: float,
    interval: float,
    swing: float,
    nearest: LocalFit | None,
) -> tuple[LocalFit, float] | None:
    """Return a fit of samples at least a count apart, and the slowest speed where they are.

    Where sampling is slow against the motion, ``nearest`` is the fit of neighbours that follows it.
    """
    most = max(int(FARTHEST / (swing * interval)), 1)
    stride = 1
    while True:
        # Even slower motion keeps neighbours within a count, whose errors are alike.
        slowest = count / (stride * interval)
        fit = clean(local_fit(time, theta, degree=6, points=11, stride=stride), bad, speed)
        if stride == 1 and nearest is not None and less(nearest, fit):
            fit = nearest
        quick = np.abs(fit.slope) >= slowest
        if np.count_nonzero(quick) >= max(FEWEST, quick.size // 3) or stride >= most:
            break
        stride = min(2 * stride, most)
    if np.count_nonzero(quick) < FEWEST:
        return None
    found = [only(fit, quick)]
    farthest = max(int(STIFF * FARTHEST / (swing * interval)), 1)
    for longer in range(stride + 1, min(stride + FURTHER, farthest) + 1):
        degree, points = DEGREES[1] if fit is not nearest and longer <= most else DEGREES[-1]
        more = local_fit(time, theta, degree=degree, points=points, stride=longer)
        more = clean(more, bad, speed)
        found.append(only(more, np.abs(more.slope) >= slowest))
    return _pooled(found), slowest


def _pooled(fits: list[LocalFit]) -> LocalFit:
    """Return all residuals of several fits to the same samples, worth no more than those of one."""
    middle, residual, slope = (
        np.concatenate([getattr(fit, name) for fit in fits])
        for name in ("middle", "residual", "slope")
    )
    worth = fits[0].sum_of_squares * middle.size / fits[0].middle.size
    return dataclasses.replace(
        fits[0], middle=middle, residual=residual, slope=slope, sum_of_squares=worth
    )
