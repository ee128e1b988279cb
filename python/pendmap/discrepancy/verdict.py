"""The five verdicts, and what they rest on."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.discrepancy.calibration import complete
from pendmap.discrepancy.form import Form, form_of
from pendmap.discrepancy.rivals import Standing, standing_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.refit import Found
    from pendmap.discrepancy.runs import RunByRun
    from pendmap.discrepancy.select import Search

__all__ = ["Judgement", "closes_most", "judge"]

Verdict = Literal["none", "named", "partial", "ambiguous", "unknown"]

SPREAD: Final = 0.3
"""How much an effect's size may differ from run to run, over its size, beyond what noise makes:
more is no effect that is alike in every run."""

CLOSED: Final = 0.9
"""Share of the gap, on what was fitted and on what was held back, that effects must close to be
named beside what is left."""

CHANCE: Final = 1e-3
"""Chance of what is left below which it is no chance: a tenth of the false alarms allowed."""

FAINT: Final = 60.0
"""Gain of effects that close no gap to speak of: of these nothing is asked but that what is left
shows in no torque, no residual and no run."""

DOUBTFUL: Final = 0.5
"""Probability below which names that explain all are more likely wrong than right: none is
claimed, unless what is in doubt is little beside one of them."""

LITTLE: Final = 0.1
"""Part of the greatest effect's gain below which others close little of the gap."""

SHARED: Final = 0.45
"""The same part where all together leave something: effects that have to share the work, and do not
do it even so, are a form made up of others, and none of them is claimed."""

SHARED_CLOSED: Final = 0.95
"""Share of the gap that effects must close that share less of the work and leave something."""

SHARED_SPREAD: Final = 0.1
"""And how much their sizes may differ from run to run."""

SURE: Final = 0.9
"""Probability that names are right below which they are given with reserve."""

FORECAST: Final = 1.3
"""Sum of squares over degrees of freedom on what was held back above which something is left: the
effects found do not foretell what they were not fitted to. Of 830 blind diagnoses that named
effects two were above it, and both were wrong. A doubt about the noise may allow more."""

SEVERAL: Final = 1.0
"""Standard errors by which the greatest of several runs counts as less than all together."""


@dataclasses.dataclass(frozen=True)
class Judgement:
    """What a search amounts to.

    Parameters
    ----------
    verdict : str
        ``none``: the baseline describes the records; ``named``: effects explain all; ``ambiguous``:
        a class of effects does, which these records do not tell apart; ``partial``: effects close
        most of the gap and something is left; ``unknown``: something is missing that no candidate
        explains.
    standings : tuple of Standing
        The effects that were found, among their rivals.
    left : float
        The slow part of what is left, over its standard error.
    ratio, ratio_allowed : float
        Sum of squares over degrees of freedom, and up to where chance and the doubt about the noise
        allow it: ``1 + 4 sqrt(2 / N + 4 r^2)``.
    ratio_held : float
        Sum of squares over degrees of freedom on what was held back.
    closed : float
        Share of the gap that the effects close, the lesser one of what was fitted and held back.
    uneven : float
        How differently the runs would have the parameters, over the standard error of that
        (Cochran's Q less its degrees of freedom over ``sqrt(2 degrees)``).
    spread : float
        How much sizes differ from run to run beyond noise, over their size: the greatest of the
        effects that close the gap.
    chance : float
        That noise alone would show such a torque over angle, velocity, amplitude, drive phase or
        time as is left.
    form : Form
        What is left, looked for in every direction.
    complete : float
        Probability that the effects found are all that is missing, each by its name or in its
        class (:mod:`pendmap.discrepancy.calibration`); 1 where none was found.
    """

    verdict: Verdict
    standings: tuple[Standing, ...]
    left: float
    ratio: float
    ratio_allowed: float
    ratio_held: float
    closed: float
    uneven: float
    spread: float
    chance: float
    form: Form
    complete: float

    @property
    def approximate(self) -> bool:
        """Whether what was found may be only nearly what is missing."""
        return self.verdict == "partial" or self.complete < SURE


def judge(
    evidence: Evidence, search: Search, best: Found, runs: RunByRun, chance: float
) -> Judgement:
    """Return the verdict on a search.

    Parameters
    ----------
    evidence : Evidence
        The records.
    search : Search
        After it ran.
    best : Found
        What it found.
    runs : RunByRun
        Its parameters run by run.
    chance : float
        That noise alone would show such a torque over angle, velocity, ... as is left.
    """
    uneven = runs.uneven
    trial = best.trial
    degrees = max(trial.fit.degrees, 1)
    # The doubt about the noise as it is seen without a model, run by run.
    allowed = 1 + 4 * math.sqrt(2 / degrees + 4 * evidence.doubt**2)
    ratio = trial.chi2 / degrees
    # The greatest of several runs is greater by chance.
    left = max(trial.remainder.z, max(trial.remainder.by_run) - SEVERAL)
    form = form_of(
        search.scores(trial),
        search.chance_of,
        torque=chance,
        slow=trial.remainder.chance,
        runs=runs.chance,
    )
    held = best.held.chi2 / max(best.held.degrees, 1)
    missed = bool(trial.chosen) and held > max(FORECAST, allowed)
    # What an effect would take up that was too weak to be accepted is not unknown.
    rest = missed or (form.chance if trial.chosen else form.unnamed) < CHANCE
    closed = _closed(search, best)
    standings = tuple(standing_of(search, best, candidate) for candidate in trial.chosen)
    # Of those that close the gap: what mends a little of one run may be in that run alone.
    most = max((standing.gain for standing in standings), default=0.0)
    closing = [s.candidate for s in standings if s.gain >= LITTLE * most]
    spread = max((runs.spread(candidate.free[0]) for candidate in closing), default=0.0)
    sure = complete(form.chance, [s.gain for s in standings]) if standings else 1.0
    verdict: Verdict
    weak = sum(standing.gain for standing in standings) < FAINT
    faint = weak and form.unnamed >= CHANCE and not missed
    if not trial.chosen:
        verdict = "unknown" if rest else "none"
    elif not faint and (rest or sure < DOUBTFUL):
        most = closes_most(standings, closed, spread, rest=rest)
        verdict = "partial" if most else "unknown"
    elif any(len(standing.equivalent) > 1 for standing in standings):
        verdict = "ambiguous"
    else:
        verdict = "named"
    return Judgement(
        verdict, standings, left, ratio, allowed, held, closed, uneven, spread, chance, form, sure
    )


def _closed(search: Search, best: Found) -> float:
    """Return the share of the gap closed, the lesser one of what was fitted and held back.

    The gap is the sum of squares above that of noise, as the best model's spectrum shows it.
    """
    level = best.trial.remainder.level
    noise = level
    if any(run.count is not None for run in search.evidence.fitted):
        # Deviances of counts are not squares: of noise alone they are 1 for each reading, or less.
        noise = min(best.trial.chi2 / max(best.trial.fit.degrees, 1), 1.0)
    before = (search.base.held.chi2 - noise * search.base.held.degrees) / level
    after = (best.held.chi2 - noise * best.held.degrees) / level
    # Noise alone scatters by this much: a gap below it cannot be divided.
    scatter = math.sqrt(2 * best.held.degrees)
    fall = (search.base.trial.chi2 - best.trial.chi2) / level
    left = max(best.trial.remainder.excess, 0.0)
    fitted = fall / (fall + left) if fall > 0 else float(left == 0)
    if before < scatter:
        return fitted if after < 2 * scatter else 0.0
    return float(np.clip(min(1 - after / before, fitted), -1.0, 1.0))


def closes_most(standings: Sequence[Standing], closed: float, spread: float, *, rest: bool) -> bool:
    """Return whether effects that do not explain all are claimed for the most of it.

    One does it nearly alone, or, where something is left beside all, several share it well.

    Parameters
    ----------
    standings : sequence of Standing
        The effects.
    closed, spread : float
        Share of the gap that they close, and how differently the runs would have the greatest.
    rest : bool
        Whether something is left; else the names are in doubt.
    """
    *others, most = sorted(standing.gain for standing in standings)
    # Without which there is no motion to speak of is no measure of what the others do.
    part = sum(others) / most if math.isfinite(most) else math.inf if others else 0.0
    if part < LITTLE:
        return (rest or part > 0) and closed >= CLOSED and spread <= SPREAD
    return rest and part < SHARED and closed >= SHARED_CLOSED and spread <= SHARED_SPREAD
