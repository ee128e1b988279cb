"""A fitted model on the records held back."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.fitted_model import FEW_STEPS, LITTLE
from pendmap.errors import FitDiverged
from pendmap.identification.fit import TrajectoryFit, fit_runs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.fitted_model import Trial, Windows
    from pendmap.identification.runs import FitRun

FOLDS: Final = 5
"""Folds of stretches that are left out in turn: two fixed stretches alone are luck."""


@dataclasses.dataclass(frozen=True)
class Held:
    """A model on the records held back, its parameters as they were fitted to the others."""

    chi2: float  # Sum of squared residuals over standard errors, initial states adapted
    degrees: int  # Samples less what was adapted
    fit: TrajectoryFit  # Curves and residuals


def tried(evidence: Evidence, trial: Trial) -> Held:
    """Try a model on what was held back.

    Whole runs have fresh initial states; stretches within a fitted run are passed through by the
    motion that was fitted to the rest of it.
    """
    model = trial.fit.model
    known = {name: value for name, value in trial.start.items() if "[" not in name}
    own = tuple(name for name in trial.free if name in known)
    if not evidence.inside:
        free = trial.free
        if not any(run.forced for run in evidence.held):
            # What only a drive shows has no part in free decays.
            drives = {e.name for e in model.effects if e.drives}
            free = tuple(name for name in free if name.partition(".")[0] not in drives)
        fit = fit_runs(
            evidence.held,
            model,
            free,
            start=known,
            profiled=(),
            hold=True,
            steps=FEW_STEPS,
            least_gain=LITTLE,
        )
        adapted = 2 * len(fit.windows) + len([n for n in fit.names if n.startswith("phi")])
        return Held(fit.chi2, max(fit.samples - adapted, 1), fit)
    places = {of: k for k, of in enumerate(evidence.held_of)}
    windows = tuple((places[w[0]], *w[1:]) for w in trial.fit.windows if w[0] in places)
    # No step: neither parameters nor states are adapted.
    fit = fit_runs(
        evidence.held, model, own, start=known, windows=windows, profiled=(), hold=True, steps=0
    )
    return Held(fit.chi2, max(fit.samples, 1), fit)


def predictive(evidence: Evidence, trial: Trial, held: Held, level: float) -> tuple[float, ...]:
    """Return what each held-out set adds to the sum of squares, parameters refitted with it.

    ``chi2(fitted and set) - chi2(fitted)``: the set of runs held back. Where stretches of single
    runs are held back, the sum over five rotated folds of such stretches, and the first and the
    last third of the runs, which ask for a forecast across amplitudes.
    """
    if not evidence.inside:
        shifted = tuple((w[0] + len(evidence.fitted), *w[1:]) for w in held.fit.windows)
        phases = {
            f"phi[{int(n[4:-1]) + len(evidence.fitted)}]": e.value
            for n, e in held.fit.estimates.items()
            if n.startswith("phi[")
        }
        both = (*evidence.fitted, *evidence.held)
        whole = _chi2(both, trial, (*trial.fit.windows, *shifted), level, phases)
        return (whole - trial.chi2,)
    back = dict(zip(evidence.held_of, evidence.held, strict=True))
    runs = tuple(
        dataclasses.replace(run, trusted=_good(run) | _good(back[of])) if of in back else run
        for run, of in zip(evidence.fitted, evidence.fitted_of, strict=True)
    )
    whole = _chi2(runs, trial, trial.fit.windows, level)
    folds = [tuple(_less_a_fold(run, k) for run in runs) for k in range(FOLDS)]
    thirds = [tuple(_less_a_third(run, first=first) for run in runs) for first in (True, False)]
    lost = [whole - _chi2(part, trial, trial.fit.windows, level) for part in (*folds, *thirds)]
    return (sum(lost[:FOLDS]), *lost[FOLDS:])


def _less_a_fold(run: FitRun, fold: int) -> FitRun:
    """Return a free run without two of ten stretches of its readings, half the run apart."""
    if run.forced:
        return run
    kept = _good(run).copy()
    counted = np.flatnonzero(kept)
    stretch = np.arange(counted.size) * 2 * FOLDS // max(counted.size, 1)
    kept[counted[stretch % FOLDS == fold]] = False
    return dataclasses.replace(run, trusted=kept)


def _less_a_third(run: FitRun, *, first: bool) -> FitRun:
    """Return a free run without the first or the last third of its readings."""
    if run.forced:
        return run
    good = _good(run)
    counted = np.flatnonzero(good)
    cut = int(counted[counted.size // 3 if first else -(counted.size // 3) - 1])
    kept = good.copy()
    kept[slice(0, cut) if first else slice(cut, None)] = False
    return dataclasses.replace(run, trusted=kept)


def _good(run: FitRun) -> np.ndarray:
    return np.ones(run.time.shape, bool) if run.trusted is None else run.trusted


def _chi2(
    runs: Sequence[FitRun],
    trial: Trial,
    windows: Windows,
    level: float,
    phases: dict[str, float] | None = None,
) -> float:
    """Return the least sum of squares of a trial's model on other readings of the same motion."""
    try:
        return fit_runs(
            runs,
            trial.fit.model,
            trial.free,
            start=trial.start | (phases or {}),
            windows=windows,
            profiled=(),
            steps=FEW_STEPS,
            least_gain=LITTLE * level,
        ).chi2
    except FitDiverged:
        return np.inf
