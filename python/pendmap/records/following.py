"""Local fits that follow quick motions, and that see past coarse counts."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.clean_fit import FEWEST, clean, less, only
from pendmap.records.local_fit import LocalFit, local_fit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["DEGREES", "FARTHEST", "apart", "followed"]

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
