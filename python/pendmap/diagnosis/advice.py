"""Advice on the next record, and detection limits of the effects that were not found."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.candidates import count_choices
from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.diagnosis.named import NamedEffect
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import ScoredModel
    from pendmap.diagnosis.verdict import Assessment, Identifiability
    from pendmap.records import Run

DETECTION_PROBABILITY: Final = 0.95  # Probability of detection of an effect at its detection limit
LARGE: Final = 1.0  # Swings from which records show drag and the angle's harmonics, rad
SMALL: Final = 0.1  # Last swing over the largest from which a decay is not seen to its end
UNDETECTABLE: Final = 10.0
"""Limit over the largest typical size above which an effect is undetectable."""


@dataclasses.dataclass(frozen=True)
class Limit:
    """Smallest size of an effect that would have been found with 95 % probability."""

    size: float  # SI, for the least detectable of its detectable shapes; infinite if none is
    candidate: Candidate  # The effect in that shape
    unseen: tuple[Candidate, ...] = ()  # Undetectable shapes, if others are detectable


@dataclasses.dataclass(frozen=True)
class Advice:
    """The recommended next record, and the detection limits."""

    next_experiment: str | None  # In a few sentences; None if limits were not computed
    limits: dict[str, Limit]  # Of each effect that was not found


def detection_limits(
    scores: Scores, level: float, fitted: FittedModel, chance: float
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
        if candidate.name in fitted.names:
            continue
        among = len(choices) * choices[candidate.name]
        threshold = float(chdtri(candidate.count, chance / among))
        wanted = required_gain(threshold, len(candidate.free))
        shown = score.information / level
        size = math.sqrt(wanted / shown) if shown > 0 else math.inf
        most = max(map(abs, candidate.definition.parameters[0].typical))
        if size > UNDETECTABLE * abs(
            candidate.effect(fitted.fit.model.units, most).parameters[candidate.size]
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


def advise(  # noqa: PLR0913, PLR0917 (what was found, in what)
    data: DataSplit,
    best: ScoredModel,
    nearest: ScoredModel,
    assessment: Assessment,
    effects: Sequence[NamedEffect],
    scores: Scores,
) -> Advice:
    """Return the recommended next record and the detection limits.

    The aim is to distinguish equivalent names, whatever the verdict; else to narrow the widest
    interval of named effects; else to lower the detection limits. The information of independent
    runs adds up, and intervals and limits are proportional to its inverse root.
    """
    chance = assessment.thresholds.chance
    limits = detection_limits(scores, nearest.fitted.level, best.fitted, chance)
    sentences: list[str | None] = []
    if assessment.verdict in {"unknown", "partial"}:
        sentences.append(_lacking(data.runs))
    classes = [one for one in assessment.identified if len(one.equivalent) > 1]
    if classes:
        sentences.append(_distinguishing(classes))
    elif assessment.verdict in {"none", "named"}:
        sentences.append(_narrowing(assessment, effects) or _lowering(limits))
    return Advice(" ".join(filter(None, sentences)) or None, limits)


def _lacking(runs: Sequence[Run]) -> str:
    """Return the sentence on what records lack that would show the cause of a residual."""
    free = [run for run in runs if run.kind == "free" and run.moves]
    sizes = [np.abs(run.theta[run.trusted]) for run in free]
    largest = max((float(size.max()) for size in sizes), default=0.0)
    ends = [float(size[-max(size.size // 20, 1) :].max()) for size in sizes]
    times = [run.lab_time_s + run.time[[0, -1]] for run in runs]
    hours = (np.max(times) - np.min(times)) / 3600
    lacks = {
        "a second run from the same release (does the residual repeat?)": len(free) == 1,
        "free decays (friction and drag without the drive)": not free,
        f"swings of more than {largest:.2g} rad (drag, and what depends on the angle)": free
        and largest < LARGE,
        f"the end of a decay, below {min(ends, default=0.0):.2g} rad (friction, and what holds the "
        "pendulum at rest)": free and min(ends) > SMALL * largest,
        "the same run an hour later (does it drift?)": hours < 1,
    }
    texts = "; ".join(text for text, true in lacks.items() if true)
    return f"These records lack {texts or 'nothing that the library names: try --effects'}."


def _distinguishing(classes: Sequence[Identifiability]) -> str:
    """Return the sentence on names that the records do not distinguish."""
    revealed: dict[str, dict[str, None]] = {}
    for one in classes:
        alike = [r.candidate for r in one.alternatives if r.alike and not r.contains]
        for candidate in (one.candidate, *alike):
            revealed.setdefault(candidate.definition.revealed_by, {})[candidate.name] = None
    groups = [f"{', '.join(names)} ({what or 'unknown'})" for what, names in revealed.items()]
    return f"To distinguish equally good names, record what reveals {', '.join(groups)}."


def _narrowing(assessment: Assessment, effects: Sequence[NamedEffect]) -> str | None:
    """Return the sentence on the widest interval; None without intervals."""
    sizes = {
        one.candidate.name: one.candidate.size
        for one in assessment.identified
        if not one.candidate.once  # An effect that acts once does not occur in a new record.
    }
    widths = {}
    for effect in effects:
        size = sizes.get(effect.name, "")
        if size in effect.ci95:
            low, high = effect.ci95[size]
            widths[f"{effect.name}.{size}"] = (high - low) / 2 / abs(effect.parameters[size])
    if not widths:
        return None
    widest = max(widths, key=lambda name: widths[name])
    return (
        f"{widest} has the widest interval, +- {100 * widths[widest]:.2g} % (95 %): about four "
        "times as many such records halve it."
    )


def _lowering(limits: Mapping[str, Limit]) -> str | None:
    """Return the sentences on the detection limits; None without limits."""
    if not limits:
        return None
    text = "About four times as many such records halve the detection limits."
    unseen = sum(math.isinf(limit.size) for limit in limits.values())
    if unseen:
        text += (
            f" {counted(unseen, 'effect')} cannot be detected in such records at any size: "
            "pendmap effects lists the records that reveal each."
        )
    return text
