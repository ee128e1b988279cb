"""Whether a fit follows the records that it was made from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pendmap.identification.fitting import TrajectoryFit
    from pendmap.identification.runs import FitRun

__all__ = ["refuse_astray"]

MISSED: Final = 0.5
"""Part of the readings' own standard deviation from which a residual is no smaller than motion."""

FAR: Final = 1.0
"""The same in rad: a pendulum that is off by this is elsewhere, also one that turns."""


def refuse_astray(path: Path, runs: Sequence[FitRun], fit: TrajectoryFit) -> None:
    """Refuse a fit that plainly is not one of its records.

    Parameters
    ----------
    path : Path
        The experiment.
    runs : sequence of FitRun
        What was fitted.
    fit : TrajectoryFit
        The fit.

    Raises
    ------
    InputError
        If the residual of a run is as large as its motion.
    """
    for run, residual in zip(runs, fit.residuals, strict=True):
        counted = np.isfinite(residual)
        if run.trusted is not None:
            counted &= run.trusted
        if not counted.any():
            continue
        rms = float(np.sqrt(np.mean(residual[counted] ** 2)))
        scatter = float(np.std(run.theta[counted]))
        if rms > min(MISSED * scatter, FAR):
            raise InputError(
                f"{path}: no model follows these records: of {run.name or 'a run'} {rms:.3g} rad "
                f"rms are missed, of a motion of {scatter:.3g}: they must be free decays of one "
                "pendulum, and a run under a drive must have the drive, in an experiment.toml: "
                'kind = "forced"'
            )
