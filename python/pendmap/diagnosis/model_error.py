"""What a model leaves, as an error of every reading beside the noise.

A model that lacks something errs by more than the noise. Fitted with the noise's weights alone, it
follows the readings with the least noise and misses the others. So each run's standard errors are
``sqrt(sigma^2 + s^2)``, with the ``s`` at which the mean of the squared residuals over the squared
standard errors is 1; ``s`` is 0 where the noise explains what is left.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.diagnosis.data import Evidence
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.identification.runs import FitRun

__all__ = ["model_errors", "weighted"]

STEPS: Final = 60
"""Halvings of the interval in which ``s`` is."""


def model_errors(records: Evidence, trial: Trial) -> tuple[float, ...]:
    """Return the error of a model in each fitted run, rad.

    Parameters
    ----------
    records : Evidence
        With the noise's own standard errors.
    trial : Trial
        A model fitted to them, with any weights.
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
        errors.append(_error(squares, sigma**2) if _mean(squares, sigma**2) > allowed else 0.0)
    return tuple(errors)


def weighted(records: Evidence, errors: Sequence[float]) -> Evidence:
    """Return records whose standard errors have the errors of a model.

    What is held back has those of its run, or of whole runs the mean square.
    """
    mean = math.sqrt(float(np.mean(np.square(errors))))
    of = dict(zip(records.fitted_of, errors, strict=True))
    fitted = (_with(run, error) for run, error in zip(records.fitted, errors, strict=True))
    held = (
        _with(run, of.get(k, mean)) for run, k in zip(records.held, records.held_of, strict=True)
    )
    return dataclasses.replace(records, fitted=tuple(fitted), held=tuple(held))


def _with(run: FitRun, error: float) -> FitRun:
    if error == 0:
        return run
    sigma = np.asarray(run.sigma, np.float64)
    if run.count is not None:
        sigma = np.hypot(sigma, run.count / math.sqrt(12))
    return dataclasses.replace(run, sigma=np.hypot(sigma, error), count=None)


def _mean(squares: np.ndarray, variance: np.ndarray) -> float:
    return float(np.mean(squares / variance)) if squares.size else 0.0


def _error(squares: np.ndarray, variance: np.ndarray) -> float:
    """Return the ``s`` at which the mean of ``r^2 / (sigma^2 + s^2)`` is 1."""
    low, high = 0.0, float(squares.max())
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if _mean(squares, variance + middle) > 1 else (low, middle)
    return math.sqrt(high)
