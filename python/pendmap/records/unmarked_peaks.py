"""Turning points that nobody declared: a column of angles that holds amplitudes alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

FEWEST: Final = 6
"""Readings that show a pattern."""

MOST: Final = 0.9
"""Share of the readings that must keep to it: a few are misread."""

RISE: Final = 0.02
"""Share of the largest by which an amplitude may be above the one before, by errors of reading."""

SLOWLY: Final = 0.15
"""Share by which an interval may differ from the one before: periods change slowly."""

REGULAR: Final = 1e-4
"""Spread of intervals, over their mean, of a clock that runs by itself."""


def check(work: Work, columns: Mapping[str, str]) -> None:
    """Say so where a free record's angles look like turning points, and leave them out of fits.

    Two a swing have alternating signs and sizes that fall, one a swing have one sign and fall; both
    come in intervals that are nearly alike, and not quite.
    """
    if work.plan.kind != "free" or "angle" not in columns:
        return
    good = np.isfinite(work.theta)
    found = _pattern(work.time[good], work.theta[good])
    if found is None:
        return
    work.peaks_only = True
    work.trusted[:] = False
    named = f'peaks = "{columns["angle"]}"'
    text = (
        f"{found}: turning points alone? Then [columns] of experiment.toml says so, {named}, one"
        " for each half swing"
    )
    work.say("peaks-undeclared", text)


def _pattern(time: Floats, theta: Floats) -> str | None:
    """Return which turning points readings look like, in words; none if they are a motion's."""
    if theta.size < FEWEST:
        return None
    steps = np.diff(time)
    slowly = np.abs(np.diff(steps)) < SLOWLY * np.minimum(steps[1:], steps[:-1])
    size = np.abs(theta)
    falls = np.diff(size) < RISE * float(size.max())
    if np.mean(slowly) < MOST or np.mean(falls) < MOST or size[-1] > (1 - RISE) * size[0]:
        return None
    other_side = theta[1:] * theta[:-1] < 0
    if np.mean(other_side) >= MOST:
        return "readings on one side and the other, ever smaller"
    regular = float(np.ptp(steps)) < REGULAR * float(np.mean(steps))
    if np.any(other_side) or regular or np.mean(np.diff(theta) * np.sign(theta[0]) < 0) < MOST:
        return None
    return "slow readings on one side, ever smaller"
