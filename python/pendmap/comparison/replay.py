"""Integration of a fitted model from given initial states.

A fitted model may diverge in another record, from another state or with another size of an effect.
The part of a diagnosis that needs this motion is then omitted, and the reason is kept.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

import numpy as np

from pendmap.identification.fit import fit_runs
from pendmap.model.rig import own_name

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.signal import Floats

    States = Sequence[tuple[float, float]]

Reasons = dict[str, str]  # Reason why a part was not computed, by its field in the JSON object

Part = TypeVar("Part")

LOST: Final = (ArithmeticError, np.linalg.LinAlgError)
"""Errors raised by a diverging motion, directly or in arithmetic and linear algebra with it."""

OWN: Final = ("w0", "c_over_m", "Tr", "torque")
"""Parameters kept apart from the model, whose damping cannot be negative as a fitted one can."""

STATE_STEPS: Final = 12  # Most least-squares iterations for initial states

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
class Motion:
    """Equation of motion of a fitted pendulum."""

    model: Rig  # Model with its effects
    own: Mapping[str, float]  # Values that replace the model's parameters

    @classmethod
    def of(cls, fit: TrajectoryFit) -> Motion:
        """Return the motion of a fitted model."""
        return cls(fit.model, {name: fit[name] for name in OWN if name in fit.estimates})

    def without(self, effect: str) -> Motion:
        """Return the motion of the pendulum without one of its effects."""
        own = own_name(effect)
        if own is not None:
            return dataclasses.replace(self, own={**self.own, own: 0.0})
        kept = tuple(e for e in self.model.effects if e.name != effect)
        return dataclasses.replace(self, model=dataclasses.replace(self.model, effects=kept))


def run_forward(
    motion: Motion, runs: Sequence[FitRun], states: States
) -> list[tuple[Floats, Floats]]:
    """Return readings (n,), rad, and angle and velocity (2, n), rad and rad/s, of each run.

    ``runs`` give times, drives and laboratory times; ``states`` are angle (rad) and velocity
    (rad/s) at the first time of each. Raises FitDiverged.
    """
    blank = [dataclasses.replace(run, theta=np.zeros(run.time.shape), trusted=None) for run in runs]
    fit = _fit_motion(motion, blank, states, steps=0)
    pairs = zip(fit.residuals, fit.curves, strict=True)
    return [(-residual, curve) for residual, curve in pairs]


def fit_states(motion: Motion, runs: Sequence[FitRun], states: States) -> list[tuple[float, float]]:
    """Return the least-squares initial states of runs; raises FitDiverged."""
    fit = _fit_motion(motion, runs, states, steps=STATE_STEPS)
    return [(theta, velocity) for *_, theta, velocity in fit.windows]


def _fit_motion(
    motion: Motion, runs: Sequence[FitRun], states: States, *, steps: int
) -> TrajectoryFit:
    """Fit initial states, in one window a run, with all parameters fixed."""
    whole = [dataclasses.replace(run, longest_s=math.inf) for run in runs]
    windows = [
        (k, 0, run.time.size, *state)
        for k, (run, state) in enumerate(zip(whole, states, strict=True))
    ]
    own = motion.own
    return fit_runs(
        whole,
        motion.model,
        tuple(own),
        start=own,
        windows=windows,
        profiled=(),
        hold=True,
        steps=steps,
    )


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
