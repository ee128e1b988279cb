"""How far model and records are apart, before and after."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.diagnosis.data import Evidence
    from pendmap.diagnosis.state import Found
    from pendmap.identification.fitting import TrajectoryFit
    from pendmap.identification.runs import FitRun

__all__ = ["Gap", "RunGap", "gap_of"]


@dataclasses.dataclass(frozen=True)
class RunGap:
    """Residuals of one run, rms in rad."""

    name: str
    held_out: bool
    noise_floor: float
    before: float
    after: float


@dataclasses.dataclass(frozen=True)
class Gap:
    """Root mean squares of the residuals, rad.

    Parameters
    ----------
    noise_floor, held_out_noise_floor : float
        Of the noise alone, as it is seen without a model: of the runs that were fitted, and of what
        was held back.
    before, after : float
        Of the baseline and of the model found, on the runs that both were fitted to.
    held_out_before, held_out_after : float
        On what was held back from both, with fresh initial states.
    by_run : tuple of RunGap
        Each run, or part of one, by itself.
    """

    noise_floor: float
    held_out_noise_floor: float
    before: float
    after: float
    held_out_before: float
    held_out_after: float
    by_run: tuple[RunGap, ...]


def gap_of(evidence: Evidence, base: Found, best: Found) -> Gap:
    """Return the gap that a baseline leaves and that a model leaves."""
    before, held_before = base.trial.fit, base.held.fit
    after, held_after = best.trial.fit, best.held.fit
    rows = _rows(evidence.fitted, before, after, held_out=False)
    held = _rows(evidence.held, held_before, held_after, held_out=True)
    return Gap(
        _together(evidence.fitted, rows),
        _together(evidence.held, held),
        _rms(evidence.fitted, before),
        _rms(evidence.fitted, after),
        _rms(evidence.held, held_before),
        _rms(evidence.held, held_after),
        (*rows, *held),
    )


def _rows(
    runs: Sequence[FitRun], before: TrajectoryFit, after: TrajectoryFit, *, held_out: bool
) -> list[RunGap]:
    return [
        RunGap(
            run.name,
            held_out,
            _floor(run),
            _rms([run], before, k),
            _rms([run], after, k),
        )
        for k, run in enumerate(runs)
    ]


def _floor(run: FitRun) -> float:
    sigma = np.broadcast_to(np.asarray(run.sigma, np.float64), run.time.shape)
    return float(np.sqrt(np.mean(np.square(sigma if run.trusted is None else sigma[run.trusted]))))


def _together(runs: Sequence[FitRun], rows: Sequence[RunGap]) -> float:
    sizes = [run.time.size if run.trusted is None else int(run.trusted.sum()) for run in runs]
    squares = [size * row.noise_floor**2 for size, row in zip(sizes, rows, strict=True)]
    return math.sqrt(sum(squares) / sum(sizes))


def _rms(runs: Sequence[FitRun], fit: TrajectoryFit, first: int = 0) -> float:
    squares, count = 0.0, 0
    for k, run in enumerate(runs, start=first):
        residual = fit.residuals[k]
        good = np.isfinite(residual)
        if run.trusted is not None:
            good &= run.trusted
        squares += float(np.sum(residual[good] ** 2))
        count += int(np.count_nonzero(good))
    return math.sqrt(squares / count) if count else math.nan
