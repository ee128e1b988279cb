"""A fitted model run forward from a state, without any further data."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pendmap.identification.fit import fit_runs
from pendmap.model.rig import own_name

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig

    Floats = NDArray[np.float64]

OWN: Final = ("w0", "c_over_m", "Tr", "torque")
"""Parameters that stand beside the model: damping may have been fitted negative, and a model has
none."""

SEARCHED: Final = 12
"""Steps in which a state is found."""


class Fits(NamedTuple):
    """A model fitted to records, and with its parameters held on the records held back."""

    fitted: TrajectoryFit
    held: TrajectoryFit


@dataclasses.dataclass(frozen=True)
class Motion:
    """What makes a pendulum move as it was fitted.

    Parameters
    ----------
    model : Rig
        With its effects.
    own : mapping of str to float
        What counts instead of the model's own parameters.
    """

    model: Rig
    own: Mapping[str, float]

    @classmethod
    def of(cls, fit: TrajectoryFit) -> Motion:
        """Return that of a model that was fitted."""
        return cls(fit.model, {name: fit[name] for name in OWN if name in fit.estimates})

    def without(self, effect: str) -> Motion:
        """Return the same pendulum without one of its effects."""
        own = own_name(effect)
        if own is not None:
            return dataclasses.replace(self, own={**self.own, own: 0.0})
        kept = tuple(e for e in self.model.effects if e.name != effect)
        return dataclasses.replace(self, model=dataclasses.replace(self.model, effects=kept))


def replayed(
    motion: Motion, runs: Sequence[FitRun], states: Sequence[tuple[float, float]]
) -> list[tuple[Floats, Floats]]:
    """Return what the sensor would read of a model, and how the model moves.

    Parameters
    ----------
    motion : Motion
        The model.
    runs : sequence of FitRun
        Times, drives and laboratory time; readings are not looked at.
    states : sequence of (float, float)
        Angle (rad) and velocity (rad/s) of each at its first time.

    Returns
    -------
    list of (ndarray of shape (n,), ndarray of shape (2, n))
        For each run readings (rad), and angle and velocity (rad, rad/s).

    Raises
    ------
    FitDiverged
        If a motion leaves the range of numbers.
    """
    blank = [dataclasses.replace(run, theta=np.zeros(run.time.shape), trusted=None) for run in runs]
    fit = _from(motion, blank, states, steps=0)
    pairs = zip(fit.residuals, fit.curves, strict=True)
    return [(-residual, curve) for residual, curve in pairs]


def settled(
    motion: Motion, runs: Sequence[FitRun], states: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return the states at the runs' first times from which a model comes nearest to readings.

    Raises
    ------
    FitDiverged
        If a motion leaves the range of numbers.
    """
    fit = _from(motion, runs, states, steps=SEARCHED)
    return [(theta, velocity) for *_, theta, velocity in fit.windows]


def drives(held: TrajectoryFit, run: FitRun, place: int) -> Mapping[str, float | None] | None:
    """Return the drive of a run held back, its phase as the model has it where no one knows it."""
    if run.drive is None or run.drive.get("phi") is not None:
        return run.drive
    known = held.estimates
    phase = next((known[n].value for n in (f"phi[{place}]", "phi") if n in known), 0.0)
    return {**run.drive, "phi": phase}


def _from(
    motion: Motion, runs: Sequence[FitRun], states: Sequence[tuple[float, float]], *, steps: int
) -> TrajectoryFit:
    whole = [dataclasses.replace(run, longest_s=math.inf) for run in runs]
    windows = [
        (k, 0, run.time.size, *state)
        for k, (run, state) in enumerate(zip(whole, states, strict=True))
    ]
    own = motion.own
    return fit_runs(
        whole, motion.model, tuple(own), start=own, windows=windows, profiled=(), hold=True,
        steps=steps,
    )  # fmt: skip


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


def strength_of(fit: TrajectoryFit, fitted: Sequence[FitRun], effect: str) -> Strength:
    """Return how strong an effect of a model is, from the motion with it and without it.

    Raises
    ------
    FitDiverged
        If a motion leaves the range of numbers.
    """
    step = STEP * 2 * np.pi / fit.model.w0
    runs, states = [], []
    count = -(-INSTANTS // len(fitted))
    for k, run in enumerate(fitted):
        theta, velocity = fit.curves[k]
        known = np.flatnonzero(np.isfinite(theta))
        # Without a phase a drive is none; what is not known was fitted.
        drive = run.drive and {**run.drive, "phi": _phase(fit, run, k)}
        for at in known[np.linspace(0, known.size - 1, min(count, known.size)).astype(int)]:
            time = run.time[at] + step * np.array([0.0, 0.5, 1.0])  # no record has fewer
            runs.append(
                dataclasses.replace(
                    run, time=time, theta=np.zeros(3), sigma=EXACT, trusted=None, drive=drive
                )
            )
            states.append((float(theta[at]), float(velocity[at])))
    motion = Motion.of(fit)
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


def _phase(fit: TrajectoryFit, run: FitRun, place: int) -> float:
    known = (run.drive or {}).get("phi")
    fitted = fit.estimates
    names = (f"phi[{place}]", "phi")
    return next((fitted[n].value for n in names if n in fitted), 0.0) if known is None else known


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
