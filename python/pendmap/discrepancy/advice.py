"""What to record next, and what these records would have shown."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.select import GATE

if TYPE_CHECKING:
    from pendmap.discrepancy.scores import Scores
    from pendmap.discrepancy.verdict import Judgement

__all__ = ["Advice", "advice_of"]

DETECTED: Final = 60.0
"""Score from which an effect is found nearly always: the gate lies four standard errors below."""


@dataclasses.dataclass(frozen=True)
class Advice:
    """What to record next.

    Parameters
    ----------
    next_experiment : str
        In a sentence.
    limits : mapping of str to float
        For each effect that was not found the smallest size (SI, of the shape that shows it least)
        that would have been scored 12; infinite where the records do not show it at all.
    """

    next_experiment: str
    limits: dict[str, float]


def advice_of(judgement: Judgement, scores: Scores, level: float) -> Advice:
    """Return what to record next.

    Parameters
    ----------
    judgement : Judgement
        The verdict.
    scores : Scores
        At the baseline.
    level : float
        Of the noise.
    """
    found = {standing.candidate.name for standing in judgement.standings}
    limits: dict[str, float] = {}
    for score in scores.scores:
        name = score.candidate.name
        if name in found and judgement.verdict != "unknown":
            continue
        limit = math.sqrt(GATE * level / score.information) if score.information > 0 else math.inf
        limits[name] = max(limits.get(name, 0.0), limit)
    return Advice(_sentence(judgement), limits)


def _sentence(judgement: Judgement) -> str:
    if judgement.verdict == "none":
        return (
            "Nothing is missing at this noise; to look deeper, record longer, from larger "
            "amplitudes, or through whole turns."
        )
    if judgement.verdict in {"unknown", "partial"}:
        return (
            "Repeat one free decay several times over an hour, and record one that begins in "
            "rotation: whether the rest repeats, and over what it changes, says what it is."
        )
    wanted = []
    for standing in judgement.standings:
        for rival in [rival for rival in standing.rivals if rival.alike][:1]:
            power = rival.separation * standing.gain
            wanted.append(
                f"{standing.candidate.name} and {rival.candidate.name} differ by s G = "
                f"{power:.2g} here, 25 are needed: record "
                f"{standing.candidate.definition['revealed_by']}, "
                f"and {rival.candidate.definition['revealed_by']}"
            )
    if wanted:
        return "; ".join(wanted) + "."
    return (
        "The effects are told apart; runs held back or repeated on another day would confirm them."
    )
