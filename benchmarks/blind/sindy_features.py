"""Features for SINDy: the states of a record, and each library effect's contribution to th''.

No formula of an effect is written here. A torque is the virtual rig's acceleration with the effect
minus that without it, so that SINDy is offered the exact hidden form; names and shapes are the
candidates of ``pendmap diagnose``. Effects of a sensor or a clock are linearised: a reading ``y =
th + e g(th)`` obeys, to first order in e,

``y'' = F + e (g'' - F_th g - F_v g')``,   ``g' = g_th v + g_t``,   ``g'' = g_thth v^2 + g_th F``,

where ``F(th, v, t)`` is the acceleration without effects; with a wrong clock, or a delayed sensor,
the phase of the drive is shifted.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from pendmap.diagnosis.candidates import Candidate, list_candidates
from pendmap.model import Rig
from pendmap.virtual_rig import EFFECTS
from pendmap.virtual_rig.effects.base import Drive, Reading
from pendmap.virtual_rig.equation import Equation, Parameters
from pendmap.virtual_rig.path import Path

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from pendmap.identification.runs import FitRun
    from pendmap.virtual_rig.effects.base import Effect

    Floats = NDArray[np.float64]

ORDER = 5
"""Order of the Savitzky-Golay polynomials."""

FIRST_WIDTH = 0.15
"""Half the window, s, of the first estimate of w0."""

FAINT = 1e-6
"""Size at which a torque is evaluated, SI: torques are (nearly) proportional to it."""

STEP = 1e-3
"""Step of finite differences in the angle, rad."""


@dataclasses.dataclass(frozen=True)
class States:
    """The state along a run, from its angle alone.

    Parameters
    ----------
    run : FitRun
        The record.
    interval : float
        Between two samples, s.
    half : int
        Half the smoothing window, samples.
    theta, velocity, acceleration : ndarray, shape (n,)
        Smoothed; rad, rad/s, rad/s^2.
    """

    run: FitRun
    interval: float
    half: int
    theta: Floats
    velocity: Floats
    acceleration: Floats

    @property
    def good(self) -> NDArray[np.bool_]:
        """Mask of the samples that are used."""
        trusted = self.run.trusted
        return np.ones(self.theta.shape, bool) if trusted is None else trusted

    @property
    def velocity_noise(self) -> float:
        """Standard error of the velocity, rad/s."""
        filtered = savgol_coeffs(2 * self.half + 1, ORDER, deriv=1, delta=self.interval)
        return float(np.median(self.run.sigma) * np.linalg.norm(filtered))

    @property
    def vertical(self) -> Floats:
        """Acceleration of the pivot over gravity, as stated in the experiment."""
        upward, _ = _drive(self.run).at(np.zeros(1, np.intp), self.run.time)
        return np.broadcast_to(np.asarray(upward, np.float64), self.theta.shape)

    @property
    def base(self) -> Floats:
        """Columns of w0^2, c/m and Tr, shape (n, 3): in every model, never thresholded."""
        pull = -(1 + self.vertical) * np.sin(self.theta)
        return np.stack([pull, -self.velocity, -np.sign(self.velocity)], axis=1)


@dataclasses.dataclass(frozen=True)
class Feature:
    """A column of the regression: an effect in one shape, and with one of two phases."""

    effect: str
    shape: tuple[tuple[str, float], ...]
    phase: float


def states_of(run: FitRun, half: int) -> States:
    """Return the smoothed states of a run whose samples are evenly spaced."""
    interval = float(np.median(np.diff(run.time)))
    half = min(max(half, (ORDER + 3) // 2), (run.time.size - 1) // 2)
    found = [
        savgol_filter(run.theta, 2 * half + 1, ORDER, deriv=k, delta=interval) for k in range(3)
    ]
    return States(run, interval, half, *found)


def smoothed(runs: Sequence[FitRun], width: float) -> tuple[list[States], Parameters]:
    """Return the states of all runs, and w0, c/m and Tr of a first regression.

    The best window for a second derivative balances its noise, which falls with the window's
    fifth power, against its bias: half of it is ``width (sigma^2 w0 dt)^(1 / (2 order + 3)) / w0``.

    Parameters
    ----------
    runs : sequence of FitRun
        The records.
    width : float
        The factor of that law.
    """
    first = [states_of(run, round(FIRST_WIDTH / float(run.time[1] - run.time[0]))) for run in runs]
    base = np.concatenate([s.base[s.good] for s in first])
    target = np.concatenate([s.acceleration[s.good] for s in first])
    squared, damping, friction = np.linalg.lstsq(base, target)[0]
    w0 = math.sqrt(max(float(squared), 1.0))
    found = []
    for states in first:
        noise = float(np.median(states.run.sigma))
        small = noise**2 * w0 * states.interval
        half = width * small ** (1 / (2 * ORDER + 3)) / w0
        found.append(states_of(states.run, round(half / states.interval)))
    return found, Parameters(w0, max(float(damping), FAINT), max(float(friction), FAINT))


def features(every: Iterable[States], rig: Parameters) -> list[tuple[Candidate, Feature]]:
    """Return the features applicable to these records."""
    forced = any(s.run.drive is not None for s in every)
    pool = list_candidates({"viscous_damping", "coulomb_friction"}, driven=forced)
    found = []
    for candidate in (c for shapes in pool for c in shapes):
        kind = EFFECTS[candidate.name]
        if (kind.needs == "forced" and not forced) or kind.states:  # no feature has a memory
            continue
        shape = tuple(candidate.effect(Rig(rig.w0).units).parameters.items())
        kept = tuple((n, v) for n, v in shape if n in candidate.shape)
        phases = (0.0,) if candidate.phase is None else (0.0, math.pi / 2)
        found += [(candidate, Feature(candidate.name, kept, phase)) for phase in phases]
    return found


def columns(states: States, rig: Parameters, pool: list[tuple[Candidate, Feature]]) -> Floats:
    """Return each feature's contribution of size 1 to th'' along a run, shape (n, len(pool))."""
    plain = _rates(states, rig, [], states.theta)
    found = np.empty((plain.size, len(pool)))
    for k, (candidate, feature) in enumerate(pool):
        if EFFECTS[candidate.name].group == "reading":
            found[:, k] = _reading(states, rig, plain, feature)
        else:
            effect = _made(feature, FAINT)
            found[:, k] = (_rates(states, rig, [effect], states.theta) - plain) / FAINT
    return found


def _made(feature: Feature, size: float) -> Any:  # noqa: ANN401 (of its class)
    """Return the rig's effect of that name."""
    kind: type[Effect] = EFFECTS[feature.effect]
    values: dict[str, float] = {}
    for field in dataclasses.fields(kind):
        if field.metadata.get("size"):
            values[field.name] = size
        else:
            values[field.name] = dict(feature.shape).get(field.name, feature.phase)
    return kind(**values)


def _drive(run: FitRun) -> Drive:
    given = run.drive or {}
    p, omega, phi = (np.array([float(given.get(n) or 0.0)]) for n in ("p", "Omega", "phi"))
    return Drive.harmonic(p, omega, phi)


def _rates(
    states: States,
    rig: Parameters,
    effects: list[Effect],
    theta: Floats,
    time: Floats | None = None,
) -> Floats:
    """Return th'' of the rig's equation along a run, shape (n,)."""
    run = states.run
    equation = Equation(rig, _drive(run), np.array([run.lab_time_s]), effects)
    first, velocity = np.zeros((1, 1), np.intp), states.velocity[np.newaxis]
    when = (run.time if time is None else time)[np.newaxis]
    ahead = np.where(velocity < 0, -1.0, 1.0)
    motion = equation.motion(first, when, theta[np.newaxis], velocity, ahead, np.ones((1, 1)))
    motion.side = np.where(motion.load < 0, -1.0, 1.0)
    return np.asarray(equation.rates(motion, np.zeros((*velocity.shape, 0)))[0][0], np.float64)


def _reading(states: States, rig: Parameters, plain: Floats, feature: Feature) -> Floats:
    time, theta, v = states.run.time, states.theta, states.velocity
    if feature.effect == "sensor_lag":  # a short one reads a slightly earlier angle
        return (_rates(states, rig, [], theta, time - FAINT) - plain) / FAINT
    effect = _made(feature, FAINT)
    clock = effect.clock(time)
    if np.any(clock != time):
        return (_rates(states, rig, [], theta, clock) - plain) / FAINT
    size = min(
        0.5, *(f.metadata["most"] for f in dataclasses.fields(effect) if "size" in f.metadata)
    )
    effect = _made(feature, size)
    path = Path()
    path.lab = states.run.lab_time_s

    def moved(angle: Floats, late: float = 0.0) -> Floats:
        return np.asarray(
            (effect.distort(Reading(time + late, angle, path)) - angle) / size, np.float64
        )

    less, here, more = (moved(theta + d) for d in (-STEP, 0.0, STEP))
    drift = (moved(theta, STEP) - moved(theta, -STEP)) / (2 * STEP)
    slope, bend = (more - less) / (2 * STEP), (more - 2 * here + less) / STEP**2
    further = _rates(states, rig, [], theta + STEP)
    by_angle = (further - _rates(states, rig, [], theta - STEP)) / (2 * STEP)
    return bend * v**2 + slope * plain - by_angle * here + rig.c_over_m * (slope * v + drift)
