"""How small an effect could have been and still have been found."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

from pendmap.diagnosis.candidates import choices_of
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.model.effects import Effect

if TYPE_CHECKING:
    from collections.abc import Collection

    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.scores import Scores
    from pendmap.model.units import Units

__all__ = ["SURELY", "Limit", "detection_limits", "needed"]

SURELY: Final = 0.95
"""Probability with which an effect of the size of its limit is found."""

HUGE: Final = 10.0
"""What would have to be greater than so many times the greatest usual size is not visible."""


@dataclasses.dataclass(frozen=True)
class Limit:
    """The smallest size of an effect that would have been found with 95 % probability."""

    # In SI, in the shape that shows it least of those that show it; infinite where none does.
    size: float
    candidate: Candidate  # The effect in that shape
    # Shapes that the records do not show at all, where there are others that they do.
    unseen: tuple[Candidate, ...] = ()


def detection_limits(
    scores: Scores, level: float, found: Collection[str], units: Units
) -> dict[str, Limit]:
    """Return the smallest size of each effect that would have been found with 95 % probability.

    Of a size ``a`` the expected gain is ``a^2`` times the information ``x' x`` (what of the
    effect's own the fitted parameters and initial states cannot follow); the gain is then
    distributed as noncentral chi-squared, and has to pass the search's threshold.
    """
    choices = choices_of([score.candidate for score in scores.scores])
    shapes: dict[str, list[tuple[float, Candidate]]] = {}
    for score in scores.scores:
        candidate = score.candidate
        if candidate.name in found:
            continue
        wanted = needed(
            _threshold(candidate, len(choices) * choices[candidate.name]), len(candidate.free)
        )
        shown = score.information / level
        size = math.sqrt(wanted / shown) if shown > 0 else math.inf
        if size > HUGE * _greatest(candidate, units):
            size = math.inf
        shapes.setdefault(candidate.name, []).append((size, candidate))
    limits = {}
    for name, sizes in shapes.items():
        seen = [pair for pair in sizes if math.isfinite(pair[0])]
        size, candidate = max(seen or sizes, key=lambda pair: pair[0])
        unseen = tuple(c for s, c in sizes if seen and not math.isfinite(s))
        limits[name] = Limit(size, candidate, unseen)
    return limits


def _threshold(candidate: Candidate, among: int) -> float:
    """Return the gain from which an effect is accepted that is chosen among several shapes."""
    from scipy.special import chdtri  # noqa: PLC0415 (where it is needed)

    return float(chdtri(candidate.count, Thresholds().chance / among))


def _greatest(candidate: Candidate, units: Units) -> float:
    """Return the greatest usual size of an effect, SI."""
    entry = candidate.definition["parameters"][0]
    bare = dict(candidate.shape) | {candidate.size: max(map(abs, entry["typical"]))}
    if candidate.phase is not None:
        bare[candidate.phase] = 0.0
    effect = Effect(candidate.name, bare, formula=candidate.formula).given(units)
    return abs(effect.parameters[candidate.size])


@functools.cache
def needed(threshold: float, count: int) -> float:
    """Return the expected gain with which a threshold is passed with 95 % probability.

    ``count`` are the degrees of freedom: how many numbers are fitted.
    """
    from scipy.optimize import brentq  # noqa: PLC0415 (where it is needed)
    from scipy.stats import ncx2  # noqa: PLC0415

    most = (math.sqrt(threshold) + 4.0) ** 2
    return float(
        brentq(lambda g: float(ncx2.sf(threshold, count, g)) - SURELY, threshold / 2, most)
    )
