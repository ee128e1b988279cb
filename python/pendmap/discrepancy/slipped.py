"""Fits that have slipped: that follow all but a stretch of the records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.discrepancy.trial import FEW_STEPS, GENTLE, LITTLE, QUICK, Trial, fitted

if TYPE_CHECKING:
    from pendmap.discrepancy.evidence import Evidence

__all__ = ["from_short_windows", "slipped"]

MOST: Final = 0.8
"""Part of all that is left beyond noise that stands in one window where it was lost."""

MUCH: Final = 20.0
"""Of a window's sum of squares, beyond its degrees of freedom, over their root of two: less may be
noise."""


def slipped(trial: Trial) -> bool:
    """Return whether most of what a fit leaves stands in one of its windows.

    What a model lacks shows in many of them. A window whose motion near the top went another way,
    or a turn more, stays so: no small step leads back.

    Parameters
    ----------
    trial : Trial
        The fit.
    """
    beyond = []
    for run, first, last, *_ in trial.fit.windows:
        white = trial.fit.white[run][first:last]
        counted = white[np.isfinite(white) & (white != 0)]
        beyond.append((float(counted @ counted) - counted.size, counted.size))
    if len(beyond) < 2:  # noqa: PLR2004 (one window is no few of them)
        return False
    over = np.array([max(excess, 0.0) for excess, _ in beyond])
    most = int(np.argmax(over))
    clear = over[most] > MUCH * np.sqrt(2 * max(beyond[most][1], 1))
    return bool(clear and over[most] > MOST * over.sum())


def from_short_windows(evidence: Evidence, trial: Trial, *, gently: bool = False) -> Trial:
    """Fit a trial's model again from short windows on; return the better of both.

    Parameters
    ----------
    evidence : Evidence
        The records.
    trial : Trial
        A fit that may have slipped.
    gently : bool
        Whether windows grow slowly. It takes up to three times as long and mostly leads to the same
        place, at times to a better one.
    """
    again = fitted(
        evidence,
        trial.fit.model,
        trial.free,
        trial.chosen,
        start=trial.start,
        steps=FEW_STEPS,
        least_gain=LITTLE,
        growth=GENTLE if gently else QUICK,
    )
    return min((trial, again), key=lambda t: t.chi2)
