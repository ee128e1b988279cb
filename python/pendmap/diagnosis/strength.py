"""How strong an effect is where the records went: its torque, or what it adds to the reading."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.replay import Motion, replayed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.diagnosis.data import Evidence
    from pendmap.diagnosis.state import Found
    from pendmap.identification.runs import FitRun

__all__ = ["EXACT", "STEP", "Strength", "acting", "strength_of"]

INSTANTS: Final = 150
"""Instants of the records at which an effect is tried."""

STEP: Final = 1e-3
"""Part of a small swing in which it acts: the motion is the same for so long."""

EXACT: Final = 1e-9
"""Error of the readings, rad, that the integrator takes for its own allowance."""


@dataclasses.dataclass(frozen=True)
class Strength:
    """An effect over the motion of the fitted records.

    Parameters
    ----------
    torque, greatest_torque : float
        Root mean square and greatest size of its torque over the moment of inertia, rad/s^2.
    reading, greatest_reading : float
        The same of what it adds to the sensor's reading, rad.
    """

    torque: float
    greatest_torque: float
    reading: float
    greatest_reading: float


def strength_of(evidence: Evidence, best: Found, effect: str) -> Strength:
    """Return how strong an effect of a model is, from the motion with it and without it.

    Raises
    ------
    InputError
        If a motion leaves the range of numbers.
    """
    fit = best.trial.fit
    step = STEP * 2 * np.pi / fit.model.w0
    runs, states = [], []
    count = -(-INSTANTS // len(evidence.fitted))
    for k, run in enumerate(evidence.fitted):
        theta, velocity = fit.curves[k]
        known = np.flatnonzero(np.isfinite(theta))
        # Without a phase a drive is none; what is not known was fitted.
        drive = run.drive and {**run.drive, "phi": _phase(best, run, k)}
        for at in known[np.linspace(0, known.size - 1, min(count, known.size)).astype(int)]:
            time = run.time[at] + step * np.array([0.0, 0.5, 1.0])  # no record has fewer
            runs.append(
                dataclasses.replace(
                    run, time=time, theta=np.zeros(3), sigma=EXACT, trusted=None, drive=drive
                )
            )
            states.append((float(theta[at]), float(velocity[at])))
    motion = Motion.of(best)
    torque, reading = acting(motion, effect, runs, states, step)
    return Strength(*(s for x in (torque, reading) for s in (_rms(x), float(np.abs(x).max()))))


def acting(
    motion: Motion,
    effect: str,
    runs: Sequence[FitRun],
    states: Sequence[tuple[float, float]],
    step: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return an effect's torque, rad/s^2, and what it adds to the reading, rad, at runs' starts.

    Each run is as short as ``step``, s.
    """
    with_it = replayed(motion, runs, states)
    without = replayed(motion.without(effect), runs, states)
    pairs = list(zip(with_it, without, strict=True))
    torque = np.array([(a[1, 2] - b[1, 2]) / step for (_, a), (_, b) in pairs])
    reading = np.array([a[0] - b[0] for (a, _), (b, _) in pairs])
    return torque, reading


def _phase(best: Found, run: FitRun, place: int) -> float:
    known = (run.drive or {}).get("phi")
    fitted = best.trial.fit.estimates
    names = (f"phi[{place}]", "phi")
    return next((fitted[n].value for n in names if n in fitted), 0.0) if known is None else known


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
