"""How small an effect could have been and still have been found."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.select import GAIN, GATE

if TYPE_CHECKING:
    from collections.abc import Collection

    from pendmap.discrepancy.candidates import Candidate
    from pendmap.discrepancy.scores import Scores

__all__ = ["SURELY", "detection_limits", "needed"]

SURELY: Final = 0.95
"""Probability with which an effect of the size of its limit is found."""


def detection_limits(
    scores: Scores, level: float, samples: int, found: Collection[str]
) -> dict[str, float]:
    """Return the smallest size of each effect that would have been found with 95 % probability.

    Of a size ``a`` the expected gain is ``a^2`` times the information ``x' x`` (what of the
    effect's own the fitted parameters and initial states cannot follow); the gain is then
    distributed as noncentral chi-squared, and has to pass the search's threshold.

    Parameters
    ----------
    scores : Scores
        Of all candidates, at the model beside which they were looked for.
    level : float
        Of the noise.
    samples : int
        That were fitted.
    found : collection of str
        Effects that have no limit, as they are there.

    Returns
    -------
    dict of str to float
        In SI, of the shape that shows it least; infinite where the records do not show it at all.
    """
    limits: dict[str, float] = {}
    for score in scores.scores:
        name = score.candidate.name
        if name in found:
            continue
        wanted = needed(_threshold(score.candidate, samples / level), len(score.candidate.free))
        shown = score.information / level
        limit = math.sqrt(wanted / shown) if shown > 0 else math.inf
        limits[name] = max(limits.get(name, 0.0), limit)
    return limits


def _threshold(candidate: Candidate, samples: float) -> float:
    """Return the gain from which an effect is taken: the gate, and the fall of the BIC wanted."""
    return max(GATE, GAIN + candidate.count * math.log(max(samples, 2.0)))


@functools.cache
def needed(threshold: float, count: int) -> float:
    """Return the expected gain with which a threshold is passed with 95 % probability.

    Parameters
    ----------
    threshold : float
        What the gain has to pass.
    count : int
        Of numbers that are fitted: degrees of freedom.
    """
    from scipy.optimize import brentq  # noqa: PLC0415 (where it is needed)
    from scipy.stats import ncx2  # noqa: PLC0415

    most = (math.sqrt(threshold) + 4.0) ** 2
    return float(
        brentq(lambda g: float(ncx2.sf(threshold, count, g)) - SURELY, threshold / 2, most)
    )
