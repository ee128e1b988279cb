"""Presets of the virtual rig, and the runs that they draw from a seed."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

from pendmap.virtual_rig.equation import Parameters

if TYPE_CHECKING:
    from numpy.random import Generator


@dataclasses.dataclass(frozen=True)
class RunPlan:
    """The initial state, duration and drive ``p cos(frequency t + phase)`` of one run."""

    kind: str  # ``free`` or ``forced``
    theta: float  # when the run begins, rad
    velocity: float  # rad/s
    duration: float  # of the record, s
    p: float = 0.0  # 0 in a free run
    frequency: float = 1.0  # rad/s
    phase: float = 0.0  # rad
    lab_time: float = 0.0  # when the run begins, s


@dataclasses.dataclass(frozen=True)
class Preset:
    """A named experiment: numbers of runs, and ranges of the random draws."""

    free: int  # number of runs
    forced: int
    duration: tuple[float, float]  # of a run, s
    noise: tuple[float, float]  # degrees, drawn log-uniformly
    effect: str  # hidden effect if the request names none
    c_over_m: tuple[float, float] = (0.05, 0.1)  # 1/s
    friction: tuple[float, float] = (0.05, 0.1)  # Tr, rad/s^2

    @property
    def until_rest(self) -> bool:
        """Whether a record ends a little after the pendulum has come to rest: a single decay."""
        return self.forced == 0

    def parameters(self, rng: Generator) -> Parameters:
        """Draw the parameters of the rig without effects."""
        w0 = rng.uniform(6.0, 6.4)
        return Parameters(w0, rng.uniform(*self.c_over_m), rng.uniform(*self.friction))

    def plan(self, rng: Generator, w0: float, counts: tuple[int, int]) -> list[RunPlan]:
        """Draw alternating free and forced runs, one after another in lab time."""
        free = [(_free(rng, k, w0, alone=self.until_rest)) for k in range(counts[0])]
        forced = [_FORCED[k % len(_FORCED)](rng, w0) for k in range(counts[1])]
        mixed = []
        for k in range(max(counts)):
            mixed += free[k : k + 1] + forced[k : k + 1]
        plans, lab = [], 0.0
        for plan in mixed:
            duration = round(float(rng.uniform(*self.duration)), 1)
            plans.append(dataclasses.replace(plan, duration=duration, lab_time=round(lab, 1)))
            lab += duration + float(rng.uniform(10.0, 30.0))
        return plans


def _free(rng: Generator, k: int, w0: float, *, alone: bool) -> RunPlan:
    """Return the k-th free decay: releases at rest from large to small angles, a fifth rotating."""
    sign = float(rng.choice((-1.0, 1.0)))
    if alone:
        return RunPlan("free", sign * rng.uniform(2.9, 3.05), 0.0, 0.0)
    ranges = ((2.7, 3.05), (1.0, 1.6), None, (1.8, 2.4), (0.4, 0.8))
    span = ranges[k % len(ranges)]
    if span is None:
        return RunPlan("free", rng.uniform(-0.3, 0.3), sign * rng.uniform(2.2, 3.2) * w0, 0.0)
    return RunPlan("free", sign * rng.uniform(*span), 0.0, 0.0)


def _forced(rng: Generator, frequency: float, p: float, theta: float, velocity: float) -> RunPlan:
    phase = rng.uniform(-math.pi, math.pi)
    p, frequency, phase = round(p, 3), round(frequency, 3), round(phase, 3)
    return RunPlan("forced", theta, velocity, 0.0, p, frequency, phase)


def _swinging(rng: Generator, w0: float) -> RunPlan:
    """Return a run near the principal resonance: oscillation at half the drive's frequency."""
    frequency, p = rng.uniform(1.9, 2.04) * w0, rng.uniform(0.2, 0.6)
    theta = rng.choice((-1.0, 1.0)) * rng.uniform(0.4, 1.2)
    return _forced(rng, frequency, p, float(theta), 0.0)


def _rotating(rng: Generator, w0: float) -> RunPlan:
    """Return a run near the rotation with one turn per forcing period, in either direction."""
    way = float(rng.choice((-1.0, 1.0)))
    plan = _forced(rng, rng.uniform(1.2, 2.0) * w0, rng.uniform(0.4, 1.0), 0.0, 0.0)
    # On it the angle follows the drive's phase, fastest at the largest downward acceleration.
    theta = way * (plan.phase + rng.uniform(-0.6, 0.2))
    velocity = way * plan.frequency * (1 + 0.25 * math.cos(plan.phase))
    return dataclasses.replace(plan, theta=theta, velocity=velocity)


def _slow(rng: Generator, w0: float) -> RunPlan:
    """Return a run near the second resonance: drive near the natural frequency."""
    frequency, p = rng.uniform(0.85, 1.1) * w0, rng.uniform(0.3, 1.0)
    return _forced(rng, frequency, p, rng.uniform(-2.5, 2.5), rng.uniform(-0.5, 0.5) * w0)


def _strong(rng: Generator, w0: float) -> RunPlan:
    """Return a strongly driven run with a random start: large swings, rotations, chaos."""
    frequency, p = rng.uniform(1.8, 2.1) * w0, rng.uniform(0.6, 1.0)
    return _forced(rng, frequency, p, rng.uniform(-2.5, 2.5), rng.uniform(-1.0, 1.0) * w0)


_FORCED: Final = (_swinging, _rotating, _slow, _strong)

PRESETS: Final[dict[str, Preset]] = {
    # One release near pi until it rests; viscous damping and Coulomb friction.
    "free_decay": Preset(1, 0, (120.0, 120.0), (0.1, 0.1), "none", (0.045, 0.055), (0.07, 0.09)),
    # Four runs under drive, swinging and rotating.
    "forced": Preset(0, 4, (30.0, 40.0), (0.1, 0.1), "none"),
    # Five free and four forced runs, an effect hidden in them that the seed chooses.
    "hidden": Preset(5, 4, (15.0, 30.0), (0.05, 0.5), "any"),
}
"""Presets by name."""
