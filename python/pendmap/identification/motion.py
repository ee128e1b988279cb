"""Motion of a fitted model from given initial states."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.identification.fit import fit_runs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.signal import Floats

    States = Sequence[tuple[float, float]]

OWN: Final = ("w0", "c_over_m", "Tr", "torque")
"""Parameters kept apart from the model, whose damping cannot be negative as a fitted one can."""

STATE_STEPS: Final = 12  # Most least-squares iterations for initial states


@dataclasses.dataclass(frozen=True)
class Motion:
    """Equation of motion of a fitted pendulum."""

    model: Rig  # Model with its effects
    own: Mapping[str, float]  # Values of the model's parameters, and of sensors by their run

    @classmethod
    def of(cls, fit: TrajectoryFit) -> Motion:
        """Return the motion of a fitted model."""
        return cls(fit.model, {name: fit[name] for name in OWN if name in fit.estimates})


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
    return fit_runs(
        whole,
        motion.model,
        tuple(name for name in motion.own if name in OWN),
        start=motion.own,
        windows=windows,
        profiled=(),
        hold=True,
        steps=steps,
    )
