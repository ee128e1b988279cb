"""Evaluation of a fitted model on the records held back."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.diagnosis.fitted_model import FEW_STEPS, LITTLE
from pendmap.errors import FitDiverged
from pendmap.identification.fit import TrajectoryFit, fit_runs
from pendmap.identification.parameters import SENSOR

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.fitted_model import FittedModel, Windows
    from pendmap.identification.runs import FitRun

FOLDS: Final = 5  # Number of folds of stretches; two fixed stretches alone depend on chance


@dataclasses.dataclass(frozen=True)
class HoldOut:
    """A model evaluated on the records held back, with fixed parameters."""

    chi2: float  # Sum of squared residuals over standard errors, initial states fitted
    degrees: int  # Samples less fitted numbers
    fit: TrajectoryFit  # Curves and residuals


def evaluate_hold_out(data: DataSplit, fitted: FittedModel) -> HoldOut:
    """Evaluate a model on the records held back.

    Whole runs have new initial states; stretches within fitted runs are compared with the fitted
    motion, without any step of a fit.
    """
    model, free = fitted.fit.model, fitted.free
    known = {
        name: value for name, value in fitted.start.items() if "[" not in name and name != SENSOR
    }
    if not any(run.drive for run in data.held):
        # Effects of the drive do not act without a harmonic drive.
        drives = {e.name for e in model.effects if e.drives}
        free = tuple(name for name in free if name.partition(".")[0] not in drives)
    search: dict[str, Any] = {"steps": FEW_STEPS, "least_gain": LITTLE}
    if data.inside:
        free = tuple(name for name in free if name in known)
        places = {data.fitted_of.index(of): k for k, of in enumerate(data.held_of)}
        windows = tuple((places[w[0]], *w[1:]) for w in fitted.fit.windows if w[0] in places)
        known |= fitted.fit.sensors_of([data.fitted_of.index(of) for of in data.held_of])
        search = {"steps": 0, "windows": windows}
    fit = fit_runs(data.held, model, free, start=known, profiled=(), hold=True, **search)
    adapted = 0
    if not data.inside:
        adapted = 2 * len(fit.windows) + len(_of_runs(fit, 0))
    return HoldOut(fit.chi2, max(fit.samples - adapted, 1), fit)


def hold_out_losses(
    data: DataSplit, fitted: FittedModel, held: HoldOut, level: float
) -> tuple[float, ...]:
    """Return the increase of the least sum of squares by adding each held-out set to the fit.

    ``chi2(fitted and set) - chi2(fitted)``. The set consists of the runs held back; if stretches
    are held back, the sets are five rotated folds of stretches (summed), and the first and the last
    third of the runs, which require a forecast across amplitudes.
    """
    if not data.inside:
        shifted = tuple((w[0] + len(data.fitted), *w[1:]) for w in held.fit.windows)
        known = _of_runs(fitted.fit, 0) | _of_runs(held.fit, len(data.fitted))
        both = (*data.fitted, *data.held)
        whole = _chi2(both, fitted, (*fitted.fit.windows, *shifted), level, known)
        return (whole - fitted.chi2,)
    windows, runs = fitted.fit.windows, data.whole
    whole = _chi2(runs, fitted, windows, level)
    lost = [
        whole - _chi2([_without(run, k) for run in runs], fitted, windows, level)
        for k in range(FOLDS + 2)
    ]
    return (sum(lost[:FOLDS]), *lost[FOLDS:])


def _of_runs(fit: TrajectoryFit, first: int) -> dict[str, float]:
    """Return phases and sensors of the runs of a fit, numbered from ``first``."""
    values = {}
    for name, estimate in fit.estimates.items():
        kind, _, number = name.rstrip("]").partition("[")
        if kind in {"phi", SENSOR}:
            values[f"{kind}[{first + int(number or 0)}]"] = estimate.value
    return values


def _without(run: FitRun, number: int) -> FitRun:
    """Return a free run without a part of its readings.

    A fold is two of ten stretches, separated by half the run; two further parts are the first and
    the last third.
    """
    if run.forced:
        return run
    trusted = run.counted.copy()
    samples = np.flatnonzero(trusted)
    n, k = samples.size, np.arange(samples.size)
    if number < FOLDS:
        part = 2 * FOLDS * k // max(n, 1) % FOLDS == number
    else:
        part = k < n // 3 if number == FOLDS else k >= n - n // 3 - 1
    trusted[samples[part]] = False
    return dataclasses.replace(run, trusted=trusted)


def _chi2(
    runs: Sequence[FitRun],
    fitted: FittedModel,
    windows: Windows,
    level: float,
    of_runs: dict[str, float] | None = None,
) -> float:
    """Return the least sum of squares of a model on other readings, from the fitted motion."""
    try:
        return fit_runs(
            runs,
            fitted.fit.model,
            fitted.free,
            start=fitted.start | (of_runs or {}),
            windows=windows,
            profiled=(),
            steps=FEW_STEPS,
            least_gain=LITTLE * level,
        ).chi2
    except FitDiverged:
        return np.inf
