"""The best further effect: candidates refitted, each against the best one before it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.attempts import attempt_of
from pendmap.discrepancy.refit import WORTH
from pendmap.discrepancy.trial import ALIKE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.discrepancy.refit import Found
    from pendmap.discrepancy.scores import Scores
    from pendmap.discrepancy.select import Search

__all__ = ["GATE", "LEFT", "beginnings", "best_following", "better"]

GATE: Final = 12.0
"""The least score of a candidate that is refitted: of all candidates together none passes 8.5
where nothing is missing."""

REFITTED: Final = 4
"""So many candidates are refitted, those with the greatest scores."""

PAIRED: Final = 8
"""Pairs are looked for that have one of so many candidates: alone, what hides behind another shows
little."""

BEGINNINGS: Final = 1
"""So many more beginnings are followed where the best one does not lead to the end."""

LEFT: Final = 1e-3
"""Chance of what is left above which the end is reached."""

Runner = tuple["Found", list[int]]


def best_following(search: Search, current: Found) -> Found | None:
    """Return the model with the best further effect, or pair of them, that is accepted.

    Parameters
    ----------
    search : Search
        With the fits that were made; it is told of all attempts.
    current : Found
        The model without.
    """
    scores = search.scores(current.trial)
    if search.first is None:
        search.first = scores
    ranked = scores.best()
    least = GATE * search.level()
    if ranked:
        least = max(least, WORTH * scores.scores[ranked[0]].gain)
    strong = [k for k in ranked[:REFITTED] if scores.scores[k].gain >= least]
    wanted = [[k] for n, k in enumerate(strong) if not any(scores.same(j, k) for j in strong[:n])]
    runners = _raced(search, current, scores, wanted, [])
    gained, explained = 0.0, False
    if runners:
        # Whether it explains all shows at its end.
        best, places = runners[0]
        best = search.regained(search.settled(best))
        runners[0] = best, places
        gained = current.trial.chi2 - best.trial.chi2
        explained = best.trial.remainder.chance > LEFT
    if search.room(current.trial) > 1 and not explained:
        pairs = _promising_pairs(search, scores, ranked, gained)
        runners = _raced(search, current, scores, pairs, runners)
    accepted = None
    for place, (one, places) in enumerate(runners):
        found = one
        if place > 0 and accepted is None:
            # Against those before it, it may not have been fitted to the end.
            found = search.refit(current.trial, scores, places) or one
        good = accepted is None and search.accepts(current, found)
        accepted = found if good else accepted
        search.attempts.append(
            attempt_of(current, found, scores, places, level=search.level(), accepted=good)
        )
    return accepted


def beginnings(search: Search, best: Found) -> list[Found]:
    """Return other beginnings than the one that led to a model: the best pair and effects."""
    scores = search.scores(search.base.trial)
    ranked = scores.best()
    pairs = [scores.best_pair(ranked[:PAIRED], PAIRED)[1:]] if len(ranked) > 1 else []
    begun = set(best.trial.names)
    found = []
    for places in [*pairs, *((k,) for k in ranked[:REFITTED])]:
        names = {scores.scores[k].candidate.name for k in places}
        if names <= begun or len(search.counted(names)) > search.most:
            continue
        other = search.refit(search.base.trial, scores, places)
        if other and search.gains(search.base.trial, other.trial):
            found.append(other)
    found = [other for other in found if search.holds(search.base, other)]
    return sorted(found, key=lambda other: other.trial.bic(search.level()))[:BEGINNINGS]


def better(search: Search, further: Found, best: Found) -> bool:
    """Whether a model found from another beginning is better than the first one.

    With more effects, and something left all the same, it has to be so beyond doubt.
    """
    counts = [len(search.counted(found.trial.names)) for found in (further, best)]
    least = ALIKE if counts[0] > counts[1] and not search.at_end(further) else 0.0
    return best.trial.bic(search.level()) - further.trial.bic(search.level()) > least


def _raced(
    search: Search,
    current: Found,
    scores: Scores,
    wanted: Sequence[list[int]],
    runners: list[Runner],
) -> list[Runner]:
    """Return candidates with others that were refitted, the best first.

    Each has the best before it to reach; those without a shape, which take least, are first.
    """

    def shaped(places: Sequence[int]) -> bool:
        return any(scores.scores[k].candidate.adapted for k in places)

    for places in sorted(wanted, key=shaped):
        more = sum(scores.scores[k].candidate.count for k in places)
        target = math.inf
        if runners:
            target = search.target(runners[0][0].trial, current.trial.adapted + more)
        found = search.refit(current.trial, scores, places, target)
        if found is not None:
            runners = [*runners, (found, places)]
            runners.sort(key=lambda runner: runner[0].trial.bic(search.level()))
    return runners


def _promising_pairs(
    search: Search, scores: Scores, ranked: Sequence[int], gained: float
) -> list[list[int]]:
    """Return the best pair, if it promises more than a candidate alone, or than one has gained."""
    if len(ranked) < 2:  # noqa: PLR2004 (a pair)
        return []
    gain, a, b = scores.best_pair(ranked, PAIRED)
    alone = max(gained, *(scores.scores[k].gain for k in (a, b, ranked[0])))
    return [[a, b]] if gain - alone > 2 * GATE * search.level() else []
