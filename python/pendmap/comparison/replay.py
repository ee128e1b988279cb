"""Parts of a diagnosis that need the motion of a fitted model, which may diverge.

A fitted model may diverge in another record, from another state or with another size of an effect.
The part of a diagnosis that needs this motion is then omitted, and the reason is kept.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

import numpy as np

from pendmap.identification.motion import Motion, run_forward

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun

Reasons = dict[str, str]  # Reason why a part was not computed, by its field in the JSON object

Part = TypeVar("Part")

LOST: Final = (ArithmeticError, np.linalg.LinAlgError)
"""Errors raised by a diverging motion, directly or in arithmetic and linear algebra with it."""

INSTANTS: Final = 150  # Instants of the records at which the torque of an effect is evaluated

STEP: Final = 1e-3
"""Integration time from each instant, in periods of small swings, short against the motion."""

EXACT: Final = 1e-9
"""Nominal standard error of readings, rad, which sets the integrator's tolerance."""


def compute_part(reasons: Reasons, field: str, compute: Callable[[], Part], default: Part) -> Part:
    """Return a part of a diagnosis, or the default if it fails, with the reason in ``reasons``."""
    try:
        return compute()
    except LOST as error:
        reasons[field] = str(error)
        return default


class Fits(NamedTuple):
    """Fit of a model to records, and the model with these parameters on the held-out records."""

    fitted: TrajectoryFit
    held: TrajectoryFit


@dataclasses.dataclass(frozen=True)
class Strength:
    """Strength of an effect over the motion of the fitted records."""

    torque: float  # Root mean square of its torque over the moment of inertia, rad/s^2
    greatest_torque: float  # Greatest size of that torque, rad/s^2
    reading: float  # Root mean square of its contribution to the reading, rad
    greatest_reading: float  # Greatest size of that contribution, rad


def effect_strength(fit: TrajectoryFit, fitted: Sequence[FitRun], effect: str) -> Strength:
    """Return the strength of an effect from the motion with and without it; raises FitDiverged."""
    step = STEP * 2 * np.pi / fit.model.w0
    runs, states = [], []
    count = -(-INSTANTS // len(fitted))
    for k, run in enumerate(fitted):
        theta, velocity = fit.curves[k]
        known = np.flatnonzero(np.isfinite(theta))
        drive = fit.drive_of(run, k)
        for at in known[np.linspace(0, known.size - 1, min(count, known.size)).astype(int)]:
            time = run.time[at] + step * np.array([0.0, 0.5, 1.0])  # a record has at least three
            runs.append(
                dataclasses.replace(
                    run, time=time, theta=np.zeros(3), sigma=EXACT, trusted=None, drive=drive
                )
            )
            states.append((float(theta[at]), float(velocity[at])))
    motion = Motion.of(fit)
    with_it = run_forward(motion, runs, states)
    without = run_forward(motion.without(effect), runs, states)
    pairs = list(zip(with_it, without, strict=True))
    torque = np.array([(a[1, 2] - b[1, 2]) / step for (_, a), (_, b) in pairs])
    reading = np.array([a[0] - b[0] for (a, _), (b, _) in pairs])
    return Strength(
        float(np.sqrt(np.mean(torque**2))),
        float(np.abs(torque).max()),
        float(np.sqrt(np.mean(reading**2))),
        float(np.abs(reading).max()),
    )
