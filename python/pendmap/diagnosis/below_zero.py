"""Damping or friction that effects of time take below 0 while the records last.

A drift is a straight line, and a line that falls ends below 0: damping would feed the motion then.
What a drift is to an experiment is told by its torque, not by its name: one in proportion to the
velocity adds to the damping, one of the same size at any velocity to the dry friction.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.further import Reasons, attempted
from pendmap.diagnosis.replay import Motion
from pendmap.diagnosis.strength import EXACT, STEP, acting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.diagnosis.data import Evidence
    from pendmap.diagnosis.state import Found
    from pendmap.identification.runs import FitRun

__all__ = ["below_zero"]

INSTANTS: Final = 80
"""Instants of the time in the laboratory at which drifts are looked at."""

LIKE: Final = 0.05
"""How far from 2, or from 1, the torque at twice the velocity may be over that at once."""


def below_zero(evidence: Evidence, found: Found, reasons: Reasons) -> dict[str, float]:
    """Return from which time in the laboratory on, s, damping or friction are below 0.

    ``c_over_m`` and ``Tr`` with all effects that change with time and add to them, where they are
    not below 0 all the time; empty where none changes sign while the records last.

    Parameters
    ----------
    evidence : Evidence
        The records.
    found : Found
        A model.
    reasons : dict of str to str
        Where it is kept which effect could not be looked at, and why.
    """
    fit = found.trial.fit
    drifting = [e.name for e in fit.model.effects if e.drifts and e.brakes]
    runs = evidence.fitted
    times = np.linspace(
        min(run.lab_time_s + run.time[0] for run in runs),
        max(run.lab_time_s + run.time[-1] for run in runs),
        INSTANTS,
    )
    speed = max(float(np.nanmax(np.abs(curve[1]))) for curve in fit.curves)
    own = {name: np.full(INSTANTS, fit[name]) for name in ("c_over_m", "Tr") if name in fit.names}
    for name in drifting:
        torques = attempted(
            reasons,
            f"below_zero.{name}",
            functools.partial(_torques, found, runs[0], name, times, speed),
            None,
        )
        if torques is None:
            continue
        once, twice = torques
        at = int(np.argmax(np.abs(once)))
        ratio = twice[at] / once[at] if once[at] else 0.0
        if abs(ratio - 2) < LIKE and "c_over_m" in own:
            own["c_over_m"] = own["c_over_m"] - twice / speed
        elif abs(ratio - 1) < LIKE and "Tr" in own:
            own["Tr"] = own["Tr"] - twice
    return {
        name: float(times[np.argmax(values < 0)])
        for name, values in own.items()
        if values.min() < 0 < values.max()
    }


def _torques(
    found: Found, run: FitRun, effect: str, times: NDArray[np.float64], speed: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return an effect's torque at half a speed and at that speed."""
    once, twice = (_torque(found, run, effect, times, v) for v in (speed / 2, speed))
    return once, twice


def _torque(
    found: Found, run: FitRun, effect: str, times: NDArray[np.float64], speed: float
) -> NDArray[np.float64]:
    """Return an effect's torque at the lowest point, rad/s^2, at instants in the laboratory."""
    step = STEP * 2 * np.pi / found.trial.fit.model.w0
    blank = [
        dataclasses.replace(
            run,
            time=step * np.array([0.0, 0.5, 1.0]),  # no record has fewer
            theta=np.zeros(3),
            sigma=EXACT,
            trusted=None,
            drive=None,
            pivot=None,
            rod_sensor=None,
            count=None,
            lab_time_s=float(at),
        )
        for at in times
    ]
    states = [(0.0, speed)] * len(blank)
    motion = Motion.of(found)
    torque, _ = acting(motion, effect, blank, states, step)
    return torque
