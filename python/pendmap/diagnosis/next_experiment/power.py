"""Predicted outcome of each proposed experiment, from sensitivities.

``s G`` separates two names of one effect: it is the part of the gain of one that the other, fitted
with all parameters and new initial states, does not reach. Twice the difference of log-likelihoods
has this mean and the variance ``4 s G``, so the wrong name wins with the probability
``Phi(-sqrt(s G) / 2)``. A new record increases ``s G`` by its information, whichever name is right.
The width of an interval and the smallest detectable size are proportional to the inverse root of
information.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.diagnosis.candidates import Candidate, list_candidates
from pendmap.diagnosis.next_experiment.information import Prospects
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.comparison.data import DataSplit
    from pendmap.comparison.replay import Reasons
    from pendmap.diagnosis.next_experiment.information import Information
    from pendmap.diagnosis.next_experiment.proposals import Proposal
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import ScoredModel
    from pendmap.diagnosis.verdict import Alternative, Assessment

CLEAR: Final = 25.0  # ``s G`` from which a wrong name has a probability of at most 0.6 %

HALF: Final = 0.5
"""Target of a proposal: interval width or detection limits over the present ones."""

NOTHING: Final = 1.0  # Increase of ``s G`` below which no experiment distinguishes two names

MOST: Final = 3  # Number of effects that are named: those whose detection limits fall most

Aim = Literal["separation", "interval", "limits"]


@dataclasses.dataclass(frozen=True)
class _Pair:
    """An effect that was found and an alternative that is indistinguishable from it."""

    effect: Candidate
    alternative: Alternative
    shapes: tuple[Candidate, ...]  # Shapes of the alternative


def predict_separation(
    data: DataSplit,
    found: ScoredModel,
    assessment: Assessment,
    reasons: Reasons,
) -> Outlook:
    """Return the predicted separation of indistinguishable names after each proposal."""
    pairs = [
        _Pair(each.candidate, alternative, _shapes(alternative.candidate))
        for each in assessment.identified
        for alternative in each.alternatives
        if alternative.alike and not alternative.contains
    ]
    shapes = {shape.title: shape for pair in pairs for shape in pair.shapes}
    ahead = Prospects(data, found, list(shapes.values()), reasons)
    before = [_separation(ahead, ahead.old, found, pair) for pair in pairs]
    added = [
        [
            max(_separation(ahead, total, found, pair) - first, 0.0) / found.fitted.level
            for pair, first in zip(pairs, before, strict=True)
        ]
        for total in map(ahead.after, ahead.menu)
    ]
    most = np.max(added, axis=0) if added else np.zeros(len(pairs))
    open_ = [k for k in range(len(pairs)) if most[k] > NOTHING]
    equals = tuple(
        (pairs[k].effect.name, pairs[k].alternative.candidate.name)
        for k in range(len(pairs))
        if k not in open_
    )
    shown = [max(pair.alternative.behind, 0.0) for pair in pairs]
    prospects = []
    for proposal, gains in zip(ahead.menu, added, strict=True) if open_ else ():
        powers = [shown[k] + gains[k] for k in open_]
        prospects.append(
            Prospect(
                proposal,
                min(powers),
                min(sum(map(chance_wrong_name, powers)), 1.0),
                math.prod(chance_resolved(power, assessment.thresholds.alike) for power in powers),
            )
        )
    about = dict.fromkeys(
        n for k in open_ for n in (pairs[k].effect.name, pairs[k].alternative.candidate.name)
    )
    now = min((shown[k] for k in open_), default=0.0)
    return Outlook("separation", tuple(about), now, CLEAR, tuple(prospects), equals)


def _shapes(candidate: Candidate) -> tuple[Candidate, ...]:
    """Return a candidate in all its shapes."""
    own = () if candidate.formula is None else (candidate.formula,)
    every = list_candidates((), driven=True, own=own)
    return tuple(next(batch for batch in every if batch[0].name == candidate.name))


def _separation(ahead: Prospects, total: Information, found: ScoredModel, pair: _Pair) -> float:
    """Return the least difference of the sum of squares of two names, whichever is right."""
    shared = ahead.now.shared
    own = [shared.index(n) for n in (*pair.effect.free, *pair.effect.adapted) if n in shared]
    base = [k for k in range(len(shared)) if k not in own]
    size = [shared.index(pair.effect.free[0])]
    value = found.fitted.fit[pair.effect.free[0]] ** 2
    places = [ahead.now.places[shape.title] for shape in pair.shapes]
    # The alternative is fitted in its nearest shape.
    right = min(float(total.own(size, [*base, *p])[0, 0]) for p in places)
    nearest = min(places, key=lambda p: float(ahead.old.own(size, [*base, *p])[0, 0]))
    weights = ahead.old.followed(size, nearest, base)[:, 0]
    other = float(weights @ total.own(nearest, [*base, *own]) @ weights)
    return value * min(right, other)


def predict_interval(data: DataSplit, found: ScoredModel, reasons: Reasons) -> Outlook | None:
    """Return the predicted widest interval of an effect's size after each proposal."""
    ahead = Prospects(data, found, (), reasons)
    shared = ahead.now.shared
    # An effect that acts once does not occur in a new record.
    sizes = [c.free[0] for c in found.fitted.chosen if c.free[0] in shared and not c.once]
    if not sizes:
        return None
    every = range(len(shared))

    def width(information: Information, name: str) -> float:
        k = shared.index(name)
        variance = found.fitted.level * float(information.covariance(every)[k, k])
        return Z95 * math.sqrt(max(variance, 0.0)) / max(abs(found.fitted.fit[name]), 1e-300)

    weakest = max(sizes, key=lambda name: width(ahead.old, name))
    now = width(ahead.old, weakest)
    prospects = tuple(Prospect(p, width(ahead.after(p), weakest)) for p in ahead.menu)
    return Outlook("interval", (weakest,), now, HALF * now, prospects)


def predict_limits(
    data: DataSplit, found: ScoredModel, scores: Scores, reasons: Reasons
) -> Outlook | None:
    """Return the predicted detection limits, over the present ones, after each proposal."""
    faintest: dict[str, Candidate] = {}
    least: dict[str, float] = {}
    for score in scores.scores:
        name = score.candidate.name
        shown = score.information or math.inf  # undetectable shapes are not compared
        if name not in least or shown < least[name]:
            faintest[name], least[name] = score.candidate, shown
    if not faintest:
        return None
    ahead = Prospects(data, found, list(faintest.values()), reasons)
    now = _shown(ahead, ahead.old, faintest)
    ratios = []
    for total in map(ahead.after, ahead.menu):
        then = _shown(ahead, total, faintest)
        # Effects that are undetectable at any size may become detectable.
        ratios.append({n: math.sqrt(now[n] / then[n]) for n in now if then[n] > 0})
    prospects = tuple(
        Prospect(proposal, float(np.median(list(ratio.values()))))
        for proposal, ratio in zip(ahead.menu, ratios, strict=True)
        if ratio
    )
    outlook = Outlook("limits", (), 1.0, HALF, prospects)
    if outlook.best is None:
        return None
    falls = ratios[ahead.menu.index(outlook.best.proposal)]
    about = tuple(sorted(falls, key=lambda name: falls[name])[:MOST])
    return dataclasses.replace(outlook, about=about)


def _shown(
    ahead: Prospects, total: Information, candidates: Mapping[str, Candidate]
) -> dict[str, float]:
    """Return the information about each size, at the least informative phase."""
    base = len(ahead.now.shared)
    rest = total.own(range(base, ahead.now.count), range(base))
    shown = {}
    for name, candidate in candidates.items():
        places = np.array(ahead.now.places[candidate.title]) - base
        own = rest[np.ix_(places, places)]
        if candidate.phase is not None:
            faint = candidate.effect(ahead.units).parameters[candidate.size]
            # The derivative by the phase is the size times the response a quarter turn later.
            scale = np.array([1.0, 1 / faint])
            own = own * np.outer(scale, scale)
        shown[name] = max(float(np.linalg.eigvalsh(own)[0]), 0.0)
    return shown


@dataclasses.dataclass(frozen=True)
class Prospect:
    """Predicted outcome of a proposal."""

    proposal: Proposal
    value: float  # Figure of merit after it
    wrong: float | None = None  # Probability that the wrong name wins, for a separation
    resolved: float | None = None  # Probability that the names are distinguished, for a separation


@dataclasses.dataclass(frozen=True)
class Outlook:
    """An aim, its figure of merit, and the predicted outcomes of all proposals."""

    # ``separation``: the least ``s G`` of indistinguishable names; ``interval``: half the widest
    # 95 % interval over its value; ``limits``: the median over effects of the smallest detectable
    # size over the present one.
    aim: Aim
    about: tuple[str, ...]  # Names of a class, the parameter, or effects whose limits fall most
    now: float  # Figure of merit without a new record
    wanted: float  # Target of the figure of merit
    prospects: tuple[Prospect, ...]  # In the order of the proposals
    equals: tuple[tuple[str, str], ...] = ()  # Names that no proposal distinguishes

    @property
    def best(self) -> Prospect | None:
        """Prospect that reaches the aim with the least effort, else the one nearest to it."""
        if not self.prospects:
            return None
        enough = [p for p in self.prospects if self.reaches(p)]
        if enough:
            return min(enough, key=lambda p: (*_effort(p), self._rank(p)))
        return min(self.prospects, key=lambda p: (self._rank(p), *_effort(p)))

    def reaches(self, prospect: Prospect) -> bool:
        """Return whether a proposal reaches the aim."""
        return self._rank(prospect) <= (-self.wanted if self.aim == "separation" else self.wanted)

    @property
    def by_start(self) -> tuple[Prospect, ...]:
        """Best prospect of each kind of run: those that reach the aim first, by effort."""
        kinds: dict[object, list[Prospect]] = {}
        for prospect in self.prospects:
            kinds.setdefault(prospect.proposal.starts, []).append(prospect)
        each = [dataclasses.replace(self, prospects=tuple(own)).best for own in kinds.values()]
        chosen = [p for p in each if p is not None]
        enough = sorted(filter(self.reaches, chosen), key=lambda p: (*_effort(p), self._rank(p)))
        return (*enough, *sorted((p for p in chosen if p not in enough), key=self._rank))

    def _rank(self, prospect: Prospect) -> float:
        return -prospect.value if self.aim == "separation" else prospect.value


def _effort(prospect: Prospect) -> tuple[float, float, int]:
    proposal = prospect.proposal
    return proposal.seconds, proposal.wait_s, len(proposal.runs)


def chance_wrong_name(power: float) -> float:
    """Return the probability that the wrong one of two names wins, ``Phi(-sqrt(s G) / 2)``."""
    return _tail(math.sqrt(max(power, 0.0)) / 2)


def chance_resolved(power: float, alike: float) -> float:
    """Return the probability that the wrong one of two names falls behind by ``alike``."""
    return 1.0 - _tail((power - alike) / (2 * math.sqrt(power))) if power > 0 else 0.0


def _tail(z: float) -> float:
    return 0.5 * math.erfc(z / math.sqrt(2))
