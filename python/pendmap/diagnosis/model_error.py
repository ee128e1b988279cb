"""What a model leaves, as the error of every reading of a run.

A model that lacks something errs by more than the noise. Fitted with the noise's weights alone, it
follows the readings with the least noise and misses the others. So the readings of a run in which
it leaves more than the noise explains count alike, with the root mean square of what it leaves as
their standard error.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.identification.runs import FitRun


def model_errors(records: Evidence, trial: Trial) -> tuple[float, ...]:
    """Return the root mean square of what a model leaves in each fitted run, rad.

    0 where the noise explains it: where the mean of the squared residuals over the squared standard
    errors is at most ``1 + 4 sqrt(2 / N + 4 r^2)``, ``r`` the relative error of the noise.
    """
    errors = []
    for run, residual, of in zip(
        records.fitted, trial.fit.residuals, records.fitted_of, strict=True
    ):
        counted = np.isfinite(residual)
        if run.trusted is not None:
            counted &= run.trusted
        sigma = np.broadcast_to(np.asarray(run.sigma, np.float64), run.time.shape)[counted]
        if run.count is not None:
            sigma = np.hypot(sigma, run.count / math.sqrt(12))
        squares = residual[counted] ** 2
        doubt = records.readings[of].doubt
        allowed = 1 + 4 * math.sqrt(2 / max(squares.size, 1) + 4 * doubt**2)
        beyond = squares.size > 0 and float(np.mean(squares / sigma**2)) > allowed
        errors.append(math.sqrt(float(np.mean(squares))) if beyond else 0.0)
    return tuple(errors)


def weighted(records: Evidence, errors: Sequence[float]) -> Evidence:
    """Return records whose standard errors are the errors of a model, where these are not 0.

    What is held back has the error of its run; a whole run held back its own noise, and the mean
    square of what the errors of the others exceed theirs by.
    """
    of = dict(zip(records.fitted_of, errors, strict=True))
    pairs = list(zip(records.fitted, errors, strict=True))
    excess = float(np.mean([max(error**2 - _variance(run), 0.0) for run, error in pairs]))
    held = (
        _with(run, of[k] if k in of else math.sqrt(_variance(run) + excess) if excess > 0 else 0.0)
        for run, k in zip(records.held, records.held_of, strict=True)
    )
    fitted = (_with(run, error) for run, error in pairs)
    return dataclasses.replace(records, fitted=tuple(fitted), held=tuple(held))


def _variance(run: FitRun) -> float:
    """Return the mean square of the standard errors of a run, its counts included."""
    return float(np.mean(np.square(run.sigma))) + (run.count or 0.0) ** 2 / 12


def _with(run: FitRun, error: float) -> FitRun:
    if error == 0:
        return run
    return dataclasses.replace(run, sigma=np.full(run.time.shape, error), count=None)
