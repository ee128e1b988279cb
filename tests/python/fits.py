"""Fits of arrays of times and angles, as they are, without the checks of records."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.identification import identify
from pendmap.identification.methods.trajectory import (
    JointFit,
    fit_from_start,
    identification_of,
    physical,
)
from pendmap.identification.readings import as_fit_run, reading_of
from pendmap.records import Experiment, Run

if TYPE_CHECKING:
    from decays import Floats
    from pendmap.identification import Identification
    from pendmap.identification.fit import TrajectoryFit

    Fitted = Identification | TrajectoryFit


TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}
"""Parameters of `decay()`."""


def scores(result: Fitted, truth: dict[str, float]) -> Floats:
    """Return the differences of estimates from the truth in standard errors."""
    known = [result.estimates[name] for name in truth]
    pairs = zip(known, truth.values(), strict=True)
    return np.array([(one.value - true) / (one.stderr or np.nan) for one, true in pairs])


def agrees(result: Fitted, truth: dict[str, float], errors: float = 4) -> None:
    """Check that no estimate is further from the truth than a number of standard errors."""
    assert np.all(np.abs(scores(result, truth)) < errors), result.estimates


def written(path: Path, *columns: Floats, names: str = "theta_rad", form: str = "%.8f") -> Path:
    """Write times and further columns to a file; return its path."""
    table = np.stack(columns, axis=1)
    np.savetxt(path, table, form, ",", header=f"t_s,{names}", comments="")
    return path


def run_of(time: Floats, angle: Floats, trusted: np.ndarray | None = None) -> Run:
    """Return a free decay."""
    good = np.ones(time.size, bool) if trusted is None else trusted
    return Run("a", "a.csv", "free", time, angle, good)


def methods_of(
    time: Floats, angle: Floats, *names: str, trusted: np.ndarray | None = None
) -> dict[str, Identification]:
    """Return the results of methods, by default of all."""
    experiment = Experiment(Path("there"), (run_of(time, angle, trusted),))
    return identify(experiment, methods=names or None).methods


def joint_fit(
    time: Floats,
    angle: Floats,
    sigma: float | None = None,
    trusted: np.ndarray | None = None,
    **choices: Any,  # noqa: ANN401 (those of fit_from_start)
) -> JointFit:
    """Return the fit of the trajectory method, for a known noise."""
    run = run_of(time, angle, trusted)
    reading = reading_of(time - time[0], angle, sigma, trusted=run.trusted)
    fit, readings = fit_from_start([as_fit_run(run, reading)], [reading], **choices)
    return JointFit(fit, (run,), readings)


def trajectory_of(time: Floats, angle: Floats, **choices: Any) -> Identification:  # noqa: ANN401
    """Return the result of the trajectory method."""
    return identification_of(physical(joint_fit(time, angle, **choices)))
