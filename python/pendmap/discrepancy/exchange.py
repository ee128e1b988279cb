"""Effects that a later one made idle are dropped, those that another one beats exchanged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.attempts import attempt_of
from pendmap.discrepancy.held import tried
from pendmap.discrepancy.refit import Found
from pendmap.discrepancy.rivals import margin_of
from pendmap.discrepancy.trial import ALIKE
from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.discrepancy.candidates import Candidate
    from pendmap.discrepancy.scores import Scores
    from pendmap.discrepancy.select import Search
    from pendmap.discrepancy.trial import Trial

__all__ = ["LOSS", "pruned"]

NEARLY: Final = (5.0, 0.3)
"""A candidate whose score promises so much less than another has gained, or less by this part of
it, is still fitted in its place: to first order it gains less than it may."""

SIMPLER: Final = 0.5
"""A rival with fewer parameters that does less by up to this part is fitted from the other's motion
too: where a window was lost on its own way it does less than it could."""

RIVALS: Final = 2
"""So many others are fitted in an effect's place, those that promise most."""

LOSS: Final = 4.0
"""By so much a model may be worse on what was held back and still be accepted: two standard
errors of what a parameter that is right, but not exact, does there."""


def pruned(search: Search, best: Found) -> Found:
    """Return the best model without effects that are idle or beaten.

    Parameters
    ----------
    search : Search
        With the fits that were made.
    best : Found
        What it found.
    """
    level = search.level()
    for candidate in best.trial.chosen:
        try:
            rest = search.rests.less(best.trial, candidate)
        except InputError:
            continue  # without it there is no motion to speak of: it is not idle
        if not search.gains(rest, best.trial):
            shorter = Found(rest, tried(search.evidence, rest))
            return pruned(search, shorter) if len(rest.chosen) > 1 else shorter
        scores = search.scores(rest)
        for k in _rivals(scores, rest, best.trial, candidate, level):
            other = _with_rival(search, scores, k, rest, best, candidate)
            if other is None or other.held.chi2 > best.held.chi2 + LOSS * level:
                continue  # not better, or where it was fitted alone
            without = Found(rest, best.held)
            search.attempts.append(
                attempt_of(without, other, scores, [k], level=level, accepted=True)
            )
            return pruned(search, other)
    return best


def _rivals(
    scores: Scores, rest: Trial, best: Trial, candidate: Candidate, level: float
) -> Iterator[int]:
    """Yield the candidates that promise nearly as much as an effect gains, or more."""
    penalty = level * math.log(max(rest.fit.samples / level, 2.0))
    gained = rest.chi2 - best.chi2
    # What does as much with fewer parameters is better.
    promised = {
        k: scores.scores[k].gain - penalty * scores.scores[k].candidate.count
        for k in scores.best()
        if scores.scores[k].candidate.name != candidate.name
    }
    least = gained - penalty * candidate.count - max(NEARLY[0] * level, NEARLY[1] * gained)
    for k in sorted(promised, key=lambda k: -promised[k])[:RIVALS]:
        if promised[k] < least:
            break
        yield k


def _with_rival(  # noqa: PLR0913, PLR0917 (which one, and in which place)
    search: Search, scores: Scores, k: int, rest: Trial, best: Found, candidate: Candidate
) -> Found | None:
    """Return the model with a rival in an effect's place; none where that is not better."""
    score = scores.scores[k]
    level = search.level()
    target = search.target(best.trial, rest.adapted + score.candidate.count)
    found = search.fitted(rest, scores, [k], target)
    near = SIMPLER * (rest.chi2 - best.trial.chi2)
    fewer = score.candidate.count < candidate.count
    if found is not None and fewer and found.chi2 - best.trial.chi2 < near:
        other = search.rests.instead(best.trial, candidate, score, target)
        found = min((t for t in (found, other) if t), key=lambda t: t.chi2)
    # Where something is left, that much moves the effects' gains against each other.
    gain = (rest.chi2 - best.trial.chi2) / level
    least = 1.0 + margin_of(best.trial, gain) - ALIKE
    if found is None or found.bic(level) >= best.trial.bic(level) - least:
        return None
    try:
        return Found(found, tried(search.evidence, found))
    except InputError:
        return None  # what was held back leads out of the range of numbers
