"""Outliers of an accelerometer and a gyroscope: readings far from their neighbours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendmap.records.false_samples import MOST_SPIKES, SIDE, SPIKE
from pendmap.records.local_fit import POINTS, local_fit
from pendmap.records.robust import broad_scale
from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

__all__ = ["find_spikes"]


def find_spikes(work: Work, values: Floats, unit: str, free: Sequence[tuple[int, int]]) -> None:
    """Mark readings of another kind that are far from their neighbours, and say so.

    An accelerometer may jump, where friction turns round; what does not come back is not looked
    into. It does jump where a hand lets go or takes hold, at the ends of the ``free`` swings
    (first place and the one after the last), and outside of them nothing is fitted.
    """
    from scipy.ndimage import maximum_filter1d

    if work.time.size < 2 * POINTS:
        return
    fit = local_fit(work.time, values)
    size = np.abs(fit.residual)
    if size.size < POINTS:
        return
    # What is false shows in every window that it is part of, most in its own.
    highest = maximum_filter1d(size, 2 * fit.neighbours + 1, mode="nearest")
    at = fit.middle[(size > 2 * SPIKE * broad_scale(size)) & (size >= highest)]
    inside = np.zeros(values.size, bool)
    for low, high in free:
        begin = low + POINTS if low else 0
        inside[begin : high if high == values.size else high - POINTS] = True
    at = at[inside[at]]
    if not at.size or at.size > MOST_SPIKES * values.size:
        return
    near = np.array([np.median(values[max(k - SIDE, 0) : k + SIDE + 1]) for k in at])
    worst = float(np.max(np.abs(values[at] - near)))
    work.trusted[at] = False
    text = f"{counted(at.size, 'outlier')}, the farthest by {worst:.3g} {unit}: not for fitting"
    work.say("outliers", text, at=at)
