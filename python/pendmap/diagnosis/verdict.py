"""The five verdicts, and what they rest on."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.diagnosis.alternatives import Standing, standing_of
from pendmap.diagnosis.calibration import complete
from pendmap.diagnosis.form import Form, form_of

if TYPE_CHECKING:
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.runs import RunByRun
    from pendmap.diagnosis.state import Found, State

__all__ = ["Judgement", "judge"]

Verdict = Literal["none", "named", "partial", "ambiguous", "unknown"]

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
        Share of the squared gap above the noise that the effects close on what was fitted.
    uneven : float
        How differently the runs would have the parameters, over the standard error of that
        (Cochran's Q less its degrees of freedom over ``sqrt(2 degrees)``).
    spread : float
        Standard error of the first effect's size by its scatter between the runs beyond noise,
        over the size.
    chance : float
        That noise alone would show such a torque over angle, velocity, amplitude, drive phase or
        time as is left.
    form : Form
        What is left, looked for in every direction.
    complete : float
        Probability that the effects found are all that is missing, each by its name or in its
        class (:mod:`pendmap.diagnosis.calibration`); 1 where none was found.
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
    approximate: bool


def judge(state: State, best: Found, runs: RunByRun, chance: float) -> Judgement:
    """Return the verdict on a search."""
    limits, trial = state.thresholds, best.trial
    degrees = max(trial.fit.degrees, 1)
    # The doubt about the noise as it is seen without a model, run by run.
    allowed = 1 + 4 * math.sqrt(2 / degrees + 4 * state.evidence.doubt**2)
    ratio = trial.chi2 / degrees
    # The greatest of several runs is greater by chance.
    left = max(trial.remainder.z, max(trial.remainder.by_run) - SEVERAL)
    held_out = limits.forecast * max(ratio, allowed)
    others = {
        "torque": chance,
        "slow": trial.remainder.chance,
        "runs": runs.chance,
        "held_out": _foretold(best, held_out) if trial.chosen else 1.0,
    }
    form = form_of(state.scores(trial), trial.remainder.chance_of, others)
    rest = form.chance < limits.rest
    closed = _closed(state, best)
    standings = tuple(
        sorted(
            (standing_of(state, trial, candidate) for candidate in trial.chosen),
            key=lambda s: -s.gain,
        )
    )
    spread = _spread(trial, runs, standings[0].candidate) if standings else 0.0
    sure = complete(form.chance, [s.gain for s in standings]) if standings else 1.0
    verdict: Verdict
    if not standings:
        verdict = "unknown" if rest else "none"
    elif rest:
        verdict = "partial" if closed >= limits.closes and spread <= limits.spread else "unknown"
    elif any(len(standing.equivalent) > 1 for standing in standings):
        verdict = "ambiguous"
    else:
        verdict = "named"
    return Judgement(
        verdict,
        standings,
        left,
        ratio,
        allowed,
        best.held.chi2 / max(best.held.degrees, 1),
        closed,
        runs.uneven,
        spread,
        chance,
        form,
        sure,
        verdict == "partial" or sure < limits.sure,
    )


def _foretold(best: Found, ratio: float) -> float:
    """Return the chance that noise alone leaves as much on what was held back.

    Parameters
    ----------
    best : Found
        The model.
    ratio : float
        Sum of squares per reading that counts as noise.
    """
    from scipy.special import chdtrc  # noqa: PLC0415 (where it is needed)

    readings = max(best.held.degrees / best.trial.level, 1.0)
    return float(chdtrc(readings, best.held.chi2 / ratio / best.trial.level))


def _spread(trial: Trial, runs: RunByRun, candidate: Candidate) -> float:
    """Return the standard error of an effect's size by its scatter between runs, over the size."""
    size = candidate.free[0]
    error = runs.between(size) / math.sqrt(max(len(runs.shown(size)), 1))
    return error / max(abs(trial.fit[size]), 1e-300)


def _closed(state: State, best: Found) -> float:
    """Return the share of the gap closed on what was fitted.

    The gap is the sum of squares above that of noise, as the best model's spectrum shows it; 1
    where it is no more than noise scatters.
    """
    trial, base = best.trial, state.base
    degrees = max(trial.fit.degrees, 1)
    noise = min(trial.remainder.level, trial.chi2 / degrees)
    gap = base.chi2 - noise * degrees
    if gap <= noise * math.sqrt(2 * degrees):
        return 1.0
    return float(np.clip(1 - max(trial.chi2 - noise * degrees, 0.0) / gap, -1.0, 1.0))
