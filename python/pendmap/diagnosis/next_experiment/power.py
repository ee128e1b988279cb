"""How much each experiment of a menu would decide, predicted from sensitivities.

Between two names of one effect decides ``s G``, the part of the one's gain that the other, the
fitted parameters and fresh initial states cannot follow; twice the difference of log-likelihoods
has this mean and the variance ``4 s G``, so that the wrong name wins with the chance
``Phi(-sqrt(s G) / 2)``. To what the records have shown a new one adds what its information adds to
``s G``, whichever of the two names is right. The width of an interval, and the least size that
would be seen, go with the inverse root of information.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.diagnosis.candidates import Candidate, candidates
from pendmap.diagnosis.next_experiment.information import Prospects
from pendmap.diagnosis.next_experiment.proposals import menu_of
from pendmap.diagnosis.refit import Z95
from pendmap.diagnosis.thresholds import Thresholds

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.comparison.data import Evidence
    from pendmap.comparison.further import Reasons
    from pendmap.diagnosis.alternatives import Rival, Standing
    from pendmap.diagnosis.next_experiment.information import Information
    from pendmap.diagnosis.next_experiment.proposals import Proposal
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import Found

CLEAR: Final = 25.0
"""``s G`` from which a wrong name has a chance of 0.6 % at most."""

HALF: Final = 0.5
"""Of an interval, or of detection limits: a new record that does less is hardly worth it."""

NOTHING: Final = 1.0
"""``s G`` below which no experiment tells two names apart."""

MOST: Final = 3
"""So many effects are named whose limits fall most."""


@dataclasses.dataclass(frozen=True)
class _Pair:
    """An effect that was found and a rival that is not told from it."""

    effect: Candidate
    rival: Rival
    shapes: tuple[Candidate, ...]


def separated(
    evidence: Evidence,
    found: Found,
    standings: Sequence[Standing],
    level: float,
    reasons: Reasons,
) -> Outlook:
    """Return what each proposal would add to the separation of names that are alike."""
    pairs = [
        _Pair(standing.candidate, rival, _shapes(rival.candidate))
        for standing in standings
        for rival in standing.rivals
        if rival.alike and not rival.contains
    ]
    shapes = {shape.title: shape for pair in pairs for shape in pair.shapes}
    w0 = found.trial.fit.model.w0
    ahead = Prospects(evidence, found, menu_of(evidence, w0), list(shapes.values()), reasons)
    before = [_separation(ahead, ahead.old, found, pair) for pair in pairs]
    added = [
        [
            max(_separation(ahead, total, found, pair) - first, 0.0) / level
            for pair, first in zip(pairs, before, strict=True)
        ]
        for total in map(ahead.after, ahead.menu)
    ]
    most = np.max(added, axis=0) if added else np.zeros(len(pairs))
    open_ = [k for k in range(len(pairs)) if most[k] > NOTHING]
    equals = tuple(
        (pairs[k].effect.name, pairs[k].rival.candidate.name)
        for k in range(len(pairs))
        if k not in open_
    )
    shown = [max(pair.rival.behind, 0.0) for pair in pairs]
    prospects = []
    for proposal, gains in zip(ahead.menu, added, strict=True) if open_ else ():
        powers = [shown[k] + gains[k] for k in open_]
        prospects.append(
            Prospect(
                proposal,
                min(powers),
                min(sum(map(wrong_name, powers)), 1.0),
                math.prod(map(one_left, powers)),
            )
        )
    about = dict.fromkeys(
        n for k in open_ for n in (pairs[k].effect.name, pairs[k].rival.candidate.name)
    )
    now = min((shown[k] for k in open_), default=0.0)
    return Outlook("separation", tuple(about), now, CLEAR, tuple(prospects), equals)


def _shapes(candidate: Candidate) -> tuple[Candidate, ...]:
    """Return an effect in all its shapes."""
    own = () if candidate.formula is None else (candidate.formula,)
    every = candidates((), driven=True, own=own)
    return tuple(next(batch for batch in every if batch[0].name == candidate.name))


def _separation(ahead: Prospects, total: Information, found: Found, pair: _Pair) -> float:
    """Return by how much the sum of squares differs between two names, whichever is right."""
    shared = ahead.now.shared
    own = [shared.index(n) for n in (*pair.effect.free, *pair.effect.adapted) if n in shared]
    base = [k for k in range(len(shared)) if k not in own]
    size = [shared.index(pair.effect.free[0])]
    value = found.trial.fit[pair.effect.free[0]] ** 2
    places = [ahead.now.places[shape.title] for shape in pair.shapes]
    # The rival takes the shape that comes nearest.
    right = min(float(total.own(size, [*base, *p])[0, 0]) for p in places)
    nearest = min(places, key=lambda p: float(ahead.old.own(size, [*base, *p])[0, 0]))
    weights = ahead.old.followed(size, nearest, base)[:, 0]
    other = float(weights @ total.own(nearest, [*base, *own]) @ weights)
    return value * min(right, other)


def tightened(evidence: Evidence, found: Found, level: float, reasons: Reasons) -> Outlook | None:
    """Return what each proposal would do to the widest interval of an effect's size."""
    w0 = found.trial.fit.model.w0
    ahead = Prospects(evidence, found, menu_of(evidence, w0), (), reasons)
    shared = ahead.now.shared
    # What happens once is not met again.
    sizes = [c.free[0] for c in found.trial.chosen if c.free[0] in shared and not c.once]
    if not sizes:
        return None
    every = range(len(shared))

    def width(information: Information, name: str) -> float:
        k = shared.index(name)
        variance = level * float(information.covariance(every)[k, k])
        return Z95 * math.sqrt(max(variance, 0.0)) / max(abs(found.trial.fit[name]), 1e-300)

    weakest = max(sizes, key=lambda name: width(ahead.old, name))
    now = width(ahead.old, weakest)
    prospects = tuple(Prospect(p, width(ahead.after(p), weakest)) for p in ahead.menu)
    return Outlook("interval", (weakest,), now, HALF * now, prospects)


def seen(evidence: Evidence, found: Found, scores: Scores, reasons: Reasons) -> Outlook | None:
    """Return what each proposal would do to the smallest sizes that would be seen."""
    faintest: dict[str, Candidate] = {}
    least: dict[str, float] = {}
    for score in scores.scores:
        name = score.candidate.name
        shown = score.information or math.inf  # a shape that does not show at all says little
        if name not in least or shown < least[name]:
            faintest[name], least[name] = score.candidate, shown
    if not faintest:
        return None
    w0 = found.trial.fit.model.w0
    ahead = Prospects(evidence, found, menu_of(evidence, w0), list(faintest.values()), reasons)
    now = _shown(ahead, ahead.old, faintest)
    ratios = []
    for total in map(ahead.after, ahead.menu):
        then = _shown(ahead, total, faintest)
        # What was not to be seen at any size may be then.
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
    """Return the information about each size; of an effect with a phase where that is least."""
    base = len(ahead.now.shared)
    rest = total.own(range(base, ahead.now.count), range(base))
    shown = {}
    for name, candidate in candidates.items():
        places = np.array(ahead.now.places[candidate.title]) - base
        own = rest[np.ix_(places, places)]
        if candidate.phase is not None:
            faint = candidate.effect(ahead.units).parameters[candidate.size]
            # The derivative by the phase is the size times that of the same effect a quarter on.
            scale = np.array([1.0, 1 / faint])
            own = own * np.outer(scale, scale)
        shown[name] = max(float(np.linalg.eigvalsh(own)[0]), 0.0)
    return shown


Aim = Literal["separation", "interval", "limits"]


@dataclasses.dataclass(frozen=True)
class Prospect:
    """What a proposal would do."""

    proposal: Proposal  # What would be recorded
    value: float  # The figure that is wanted, after it
    wrong: float | None = None  # Chance that the wrong name would win, of a separation
    resolved: float | None = None  # Chance that only one name would be left, of a separation


@dataclasses.dataclass(frozen=True)
class Outlook:
    """What is wanted, and what each proposal would do for it."""

    # ``separation``: the least ``s G`` of names that are not told apart; ``interval``: the width of
    # the widest interval of 95 %, over the value; ``limits``: the median over effects of the
    # smallest size that would be seen, over what it is now.
    aim: Aim
    # The names it is about: of a class; the parameter; those effects whose limits fall most.
    about: tuple[str, ...]
    now: float  # The figure without a new record, and what is aimed at
    wanted: float
    prospects: tuple[Prospect, ...]  # In the order of the menu
    equals: tuple[tuple[str, str], ...] = ()  # Names that none of the proposals tells apart

    @property
    def best(self) -> Prospect | None:
        """What does enough in the least recording time; else what does most."""
        if not self.prospects:
            return None
        enough = [p for p in self.prospects if self.reaches(p)]
        if enough:
            return min(enough, key=lambda p: (*_effort(p), self._rank(p)))
        return min(self.prospects, key=lambda p: (self._rank(p), *_effort(p)))

    def reaches(self, prospect: Prospect) -> bool:
        """Whether a proposal does enough."""
        return self._rank(prospect) <= (-self.wanted if self.aim == "separation" else self.wanted)

    @property
    def by_start(self) -> tuple[Prospect, ...]:
        """The best of each kind of run: of those that do enough the least effort first."""
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


def wrong_name(power: float) -> float:
    """Return the chance that the wrong one of two names wins, ``Phi(-sqrt(s G) / 2)``."""
    return _tail(math.sqrt(max(power, 0.0)) / 2)


def one_left(power: float) -> float:
    """Return the chance that the wrong one of two names falls behind by enough to be left out."""
    return 1.0 - _tail((power - Thresholds().alike) / (2 * math.sqrt(power))) if power > 0 else 0.0


def _tail(z: float) -> float:
    return 0.5 * math.erfc(z / math.sqrt(2))
