"""Advice on the next record, and detection limits of the effects that were not found."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

from pendmap.comparison.replay import Reasons, compute_part
from pendmap.diagnosis.candidates import count_choices
from pendmap.diagnosis.next_experiment.power import (
    predict_interval,
    predict_limits,
    predict_separation,
)

if TYPE_CHECKING:
    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.diagnosis.next_experiment.power import Outlook, Prospect
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import ScoredModel
    from pendmap.diagnosis.verdict import Assessment


DETECTION_PROBABILITY: Final = 0.95  # Probability of detection of an effect at its detection limit

UNDETECTABLE: Final = 10.0
"""Limit over the largest typical size above which an effect is undetectable."""

NOTHING: Final = "No proposed free decay or forced run adds information to these records."

MARGIN: Final = 1e-6  # Smallest reported probability of a wrong name; errors of the model exceed it


@dataclasses.dataclass(frozen=True)
class Limit:
    """Smallest size of an effect that would have been found with 95 % probability."""

    size: float  # SI, for the least detectable of its detectable shapes; infinite if none is
    candidate: Candidate  # The effect in that shape
    unseen: tuple[Candidate, ...] = ()  # Undetectable shapes, if others are detectable


@dataclasses.dataclass(frozen=True)
class Advice:
    """The recommended next record, detection limits and predicted outcomes."""

    next_experiment: str | None  # In a sentence or two; None if it cannot be computed
    limits: dict[str, Limit]  # Of each effect that was not found
    outlook: Outlook | None  # Predicted outcomes; None if the model can simulate no proposal

    @property
    def best(self) -> Prospect | None:
        """Prospect of the proposal in ``next_experiment``."""
        return None if self.outlook is None else self.outlook.best


def detection_limits(
    scores: Scores, level: float, found: FittedModel, chance: float
) -> dict[str, Limit]:
    """Return the smallest size of each effect that would have been found with 95 % probability.

    A size ``a`` has the expected gain ``a^2`` times the information ``x' x`` of the effect,
    orthogonal to the fitted parameters and initial states. The gain has a noncentral chi-squared
    distribution and must exceed the threshold of the search, which noise alone exceeds with the
    probability ``chance``.
    """
    from scipy.special import chdtri  # noqa: PLC0415 (where it is needed)

    choices = count_choices([score.candidate for score in scores.scores])
    shapes: dict[str, list[tuple[float, Candidate]]] = {}
    for score in scores.scores:
        candidate = score.candidate
        if candidate.name in found.names:
            continue
        among = len(choices) * choices[candidate.name]
        threshold = float(chdtri(candidate.count, chance / among))
        wanted = required_gain(threshold, len(candidate.free))
        shown = score.information / level
        size = math.sqrt(wanted / shown) if shown > 0 else math.inf
        most = max(map(abs, candidate.definition.parameters[0].typical))
        if size > UNDETECTABLE * abs(
            candidate.effect(found.fit.model.units, most).parameters[candidate.size]
        ):
            size = math.inf
        shapes.setdefault(candidate.name, []).append((size, candidate))
    limits = {}
    for name, sizes in shapes.items():
        seen = [pair for pair in sizes if math.isfinite(pair[0])]
        size, candidate = max(seen or sizes, key=lambda pair: pair[0])
        unseen = tuple(c for s, c in sizes if seen and not math.isfinite(s))
        limits[name] = Limit(size, candidate, unseen)
    return limits


@functools.cache
def required_gain(threshold: float, count: int) -> float:
    """Return the expected gain that exceeds a threshold with 95 % probability.

    ``count`` is the number of fitted parameters.
    """
    from scipy.optimize import brentq  # noqa: PLC0415 (where it is needed)
    from scipy.stats import ncx2  # noqa: PLC0415

    most = (math.sqrt(threshold) + 4.0) ** 2
    return float(
        brentq(
            lambda g: float(ncx2.sf(threshold, count, g)) - DETECTION_PROBABILITY,
            threshold / 2,
            most,
        )
    )


def advise(  # noqa: PLR0913, PLR0917 (what was recorded, found and judged)
    data: DataSplit,
    best: ScoredModel,
    nearest: ScoredModel,
    assessment: Assessment,
    scores: Scores,
    reasons: Reasons,
) -> Advice:
    """Return the recommended next record, detection limits and predicted outcomes.

    The aim is to distinguish equivalent names (``s G`` of 25), whatever the verdict; else to halve
    the widest interval of named effects; else to lower the detection limits.
    """
    chance = assessment.thresholds.chance
    limits = detection_limits(scores, nearest.fitted.level, best.fitted, chance)

    def proposed() -> Outlook | None:
        if any(len(each.equivalent) > 1 for each in assessment.identified):
            return predict_separation(data, nearest, assessment, reasons)
        if assessment.verdict == "named":
            return predict_interval(data, best, reasons)
        return predict_limits(data, best, scores, reasons)

    outlook = compute_part(reasons, "proposals", proposed, None)
    said = _sentences(assessment, outlook, driven=data.forced)
    if not said and "proposals" not in reasons:
        said = [NOTHING]
    return Advice(" ".join(said) or None, limits, outlook)


def _sentences(assessment: Assessment, outlook: Outlook | None, *, driven: bool) -> list[str]:
    """Return the sentences of the advice."""
    said = []
    if assessment.verdict in {"unknown", "partial"}:
        said.append(
            "Repeat one free decay several times over an hour: whether the residual repeats, and "
            "what it varies with, indicates its cause."
        )
    if outlook is None:
        return said
    if outlook.best is not None:
        said.append(_recommendation(outlook, outlook.best))
    kinds = "free decay or forced run" if driven else "free decay"
    said += [
        f"No {kinds} distinguishes {one} from {other}: {one} is revealed by "
        f"{_revealed(assessment, one)}; {other} by {_revealed(assessment, other)}."
        for one, other in outlook.equals
    ]
    return said


def _revealed(assessment: Assessment, name: str) -> str:
    """Return the library's description of the records that reveal an effect."""
    every = (
        c
        for s in assessment.identified
        for c in (s.candidate, *(r.candidate for r in s.alternatives))
    )
    return next(c for c in every if c.name == name).definition.revealed_by


def _recommendation(outlook: Outlook, best: Prospect) -> str:
    """Return the sentence that recommends a proposal."""
    names, what = ", ".join(outlook.about), best.proposal.what
    if outlook.aim == "interval":
        return (
            f"{outlook.about[0]} has the widest interval, +- {100 * outlook.now:.2g} % (95 %): "
            f"record {what}, for a predicted +- {100 * best.value:.2g} %."
        )
    if outlook.aim == "limits":
        return (
            f"To lower the detection limits, record {what}: for half of the effects not found the "
            f"limit falls to {100 * best.value:.2g} % of its present value or less; most for "
            f"{names}."
        )
    names = ", ".join(outlook.about[:-1]) + f" and {outlook.about[-1]}"
    enough = ""
    if not outlook.reaches(best):
        # Information of independent runs adds up.
        part = (outlook.wanted - outlook.now) / (best.value - outlook.now)
        runs = math.ceil(len(best.proposal.runs) * part)
        enough = f"; about {runs} such runs are needed"
    value, now = (f"{x:.0f}" if x >= 10 else f"{x:.2g}" for x in (best.value, outlook.now))  # noqa: PLR2004 (two digits)
    wrong = best.wrong or 0.0
    chance = f"{wrong:.1g}" if wrong >= MARGIN else f"below {MARGIN:g}"
    return (
        f"To distinguish {names}, record {what}: predicted separation {value} (now {now}, "
        f"{outlook.wanted:g} wanted{enough}), chance of a wrong name {chance}."
    )
