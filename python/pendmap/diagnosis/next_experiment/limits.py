"""How small an effect could have been and still have been found."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

from pendmap.comparison.further import Reasons, attempted
from pendmap.diagnosis.candidates import choices_of
from pendmap.diagnosis.next_experiment.power import seen, separated, tightened
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.model.effects import Effect

if TYPE_CHECKING:
    from collections.abc import Collection

    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.next_experiment.power import Outlook, Prospect
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import Found
    from pendmap.diagnosis.verdict import Judgement
    from pendmap.units import Units


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


# What to record next, how much that would decide, and what these records would have shown.


NOTHING: Final = "No free decay or run under the drive adds to these records."

MARGIN: Final = 1e-6
"""A chance below this is not told: no model is known so well."""


@dataclasses.dataclass(frozen=True)
class Advice:
    """What to record next."""

    next_experiment: str | None  # In a sentence or two; none where it cannot be computed
    # For each effect that was not found the smallest size that would have been found with 95 %
    # probability.
    limits: dict[str, Limit]
    # What is wanted, and what each proposal would do for it; none where no proposal can be run
    # through by the model.
    outlook: Outlook | None

    @property
    def best(self) -> Prospect | None:
        """The proposal of the sentence."""
        return None if self.outlook is None else self.outlook.best


def advice_of(  # noqa: PLR0913, PLR0917 (what was recorded, found and judged)
    evidence: Evidence,
    best: Found,
    nearest: Found,
    judgement: Judgement,
    scores: Scores,
    level: float,
    reasons: Reasons,
) -> Advice:
    """Return what to record next.

    Names that are alike are to be told apart (``s G`` of 25), named or leading explanations of what
    is unknown; of effects that are told apart the widest interval is to be halved; where nothing is
    found, more is to be seen.
    """
    limits = detection_limits(scores, level, best.trial.names, best.trial.fit.model.units)

    def proposed() -> Outlook | None:
        if any(len(standing.equivalent) > 1 for standing in judgement.standings):
            return separated(evidence, nearest, judgement.standings, level, reasons)
        if judgement.verdict == "named":
            return tightened(evidence, best, level, reasons)
        return seen(evidence, best, scores, reasons)

    outlook = attempted(reasons, "proposals", proposed, None)
    said = _sentences(judgement, outlook, evidence.forced)
    if not said and "proposals" not in reasons:
        said = [NOTHING]
    return Advice(" ".join(said) or None, limits, outlook)


def chance_said(chance: float) -> str:
    """Return a chance, none of them impossible."""
    return f"{chance:.1g}" if chance >= MARGIN else f"below {MARGIN:g}"


def _sentences(judgement: Judgement, outlook: Outlook | None, driven: bool) -> list[str]:  # noqa: FBT001 (private)
    said = []
    if judgement.verdict in {"unknown", "partial"}:
        said.append(
            "Repeat one free decay several times over an hour: whether the rest repeats, and "
            "over what it changes, says what it is."
        )
    if outlook is None:
        return said
    best = outlook.best
    if best is not None:
        say = {"separation": _separation, "interval": _interval, "limits": _limits}
        said.append(say[outlook.aim](outlook, best))
    kinds = "free decay or run under the drive" if driven else "free decay"
    said += [
        f"No {kinds} tells {one} from {other}: {one} is shown by "
        f"{_revealed(judgement, one)}; {other} by {_revealed(judgement, other)}."
        for one, other in outlook.equals
    ]
    return said


def _revealed(judgement: Judgement, name: str) -> str:
    every = (
        c for s in judgement.standings for c in (s.candidate, *(r.candidate for r in s.rivals))
    )
    return str(next(c for c in every if c.name == name).definition["revealed_by"])


def _separation(outlook: Outlook, best: Prospect) -> str:
    names = ", ".join(outlook.about[:-1]) + f" and {outlook.about[-1]}"
    enough = ""
    if not outlook.reaches(best):
        # Information adds up, run by run.
        part = (outlook.wanted - outlook.now) / (best.value - outlook.now)
        runs = math.ceil(len(best.proposal.runs) * part)
        enough = f"; about {runs} such runs are needed"
    return (
        f"To tell {names} apart, record {best.proposal.what}: predicted separation "
        f"{_power(best.value)} (now {_power(outlook.now)}, {outlook.wanted:g} wanted{enough}), "
        f"chance of a wrong name {chance_said(best.wrong or 0.0)}."
    )


def _power(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"  # noqa: PLR2004 (two digits)


def _interval(outlook: Outlook, best: Prospect) -> str:
    return (
        f"The least sure is {outlook.about[0]}, known to +- {100 * outlook.now:.2g} % (95 %): "
        f"record {best.proposal.what}, for a predicted +- {100 * best.value:.2g} %."
    )


def _limits(outlook: Outlook, best: Prospect) -> str:
    names = ", ".join(outlook.about)
    return (
        f"To see smaller effects, record {best.proposal.what}: for half of the effects not found "
        f"the smallest size that shows falls to {100 * best.value:.2g} % of what it is now, or "
        f"further; most for {names}."
    )
