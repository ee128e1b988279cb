"""Proposals compared: what each would do for what is wanted, and which is worth its time."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Literal

from pendmap.diagnosis.thresholds import Thresholds

if TYPE_CHECKING:
    from pendmap.diagnosis.next_experiment.proposals import Proposal

__all__ = ["Aim", "Outlook", "Prospect", "one_left", "wrong_name"]

Aim = Literal["separation", "interval", "limits"]


@dataclasses.dataclass(frozen=True)
class Prospect:
    """What a proposal would do.

    Parameters
    ----------
    proposal : Proposal
        What would be recorded.
    value : float
        The figure that is wanted, after it.
    wrong : float or None
        Chance that the wrong name would win, of a separation.
    resolved : float or None
        Chance that only one name would be left, of a separation.
    """

    proposal: Proposal
    value: float
    wrong: float | None = None
    resolved: float | None = None


@dataclasses.dataclass(frozen=True)
class Outlook:
    """What is wanted, and what each proposal would do for it.

    Parameters
    ----------
    aim : str
        ``separation``: the least ``s G`` of names that are not told apart; ``interval``: the width
        of the widest interval of 95 %, over the value; ``limits``: the median over effects of the
        smallest size that would be seen, over what it is now.
    about : tuple of str
        The names it is about: of a class; the parameter; those effects whose limits fall most.
    now, wanted : float
        The figure without a new record, and what is aimed at.
    prospects : tuple of Prospect
        In the order of the menu.
    equals : tuple of (str, str)
        Names that none of the proposals tells apart.
    """

    aim: Aim
    about: tuple[str, ...]
    now: float
    wanted: float
    prospects: tuple[Prospect, ...]
    equals: tuple[tuple[str, str], ...] = ()

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
