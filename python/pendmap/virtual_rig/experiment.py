"""Simulation of an experiment: noise-free motion, record and truth of every run."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, check_number
from pendmap.virtual_rig.effects import draw, draws_size
from pendmap.virtual_rig.effects.base import Drive
from pendmap.virtual_rig.effects.readings import read
from pendmap.virtual_rig.equation import Equation, Parameters
from pendmap.virtual_rig.integrator import integrate
from pendmap.virtual_rig.presets import PRESETS, RunPlan
from pendmap.virtual_rig.sensor import Sensor, check_ranges

if TYPE_CHECKING:
    from pendmap.virtual_rig.effects.base import Effect
    from pendmap.virtual_rig.path import Floats, Path

_AFTER_REST: Final = 3.0  # Time recorded after the pendulum has come to rest, s
_MOST_SAMPLES: Final = 10_000_000
"""Largest number of samples of all runs; their records take 250 megabytes."""
_RIG, _RUNS, _EFFECTS, _SENSOR = range(4)  # Streams of random numbers


@dataclasses.dataclass(frozen=True)
class Request:
    """Request for an experiment; ``None`` leaves a value to the preset and the seed.

    Parameters
    ----------
    preset : str
        A name of ``PRESETS``.
    seed : int
        Seed of all draws; 0 or more.
    effects : tuple of str
        Effects to hide, with parameters if wanted (``magnet:dipole,amplitude=0.1,d=0.2``), ``any``,
        which the seed chooses, or ``none`` alone; by default none, hidden: any.
    size : float
        Multiplies the size of every effect that is drawn; 1 if none is drawn.
    w0 : float
        Natural frequency, rad/s; by default 6.0 to 6.4.
    c_over_m : float
        Viscous damping, 1/s; by default about 0.05, forced and hidden: 0.05 to 0.1.
    friction : float
        Coulomb friction Tr, rad/s^2; by default about 0.08, forced and hidden: 0.05 to 0.1.
    theta_r : float
        The friction without dimensions, ``Tr / w0**2``, in its place.
    free : int
        Number of free decays; by default 1, forced: 0, hidden: 5.
    forced : int
        Number of runs under drive, at most 99 of both kinds; by default 0, forced and hidden: 4.
    duration : float
        Length of every run, s, at most 3600; by default until rest, forced: 30 to 40, hidden: 15 to
        30.
    noise : float
        Noise of the sensor, degrees; by default 0.1, hidden: 0.05 to 0.5.
    rate : float
        Samples a second, Hz.
    counts : int
        Counts a turn; 0: no steps.
    correlation : float
        AR(1) coefficient of the noise.
    dropouts : float
        Share of the samples that are lost.
    outliers : float
        Share of the samples that are false.
    jitter : float
        Rms deviation of the sampling instants, s.
    plans : tuple of RunPlan
        The runs, instead of those that the preset draws, their number and their duration.

    Raises
    ------
    InputError
        If a value is not finite or outside its range.
    """

    preset: str
    seed: int = 0
    effects: tuple[str, ...] = ()
    size: float = 1.0
    w0: float | None = None
    c_over_m: float | None = None
    friction: float | None = None
    theta_r: float | None = None
    free: int | None = None
    forced: int | None = None
    duration: float | None = None
    noise: float | None = None
    rate: float = 100.0
    counts: int = 4096
    correlation: float = 0.0
    dropouts: float = 0.0
    outliers: float = 0.0
    jitter: float = 0.0
    plans: tuple[RunPlan, ...] = ()

    def __post_init__(self) -> None:
        if self.preset not in PRESETS:
            known = ", ".join(PRESETS)
            raise InputError(f"experiment must be one of {known}, got {self.preset!r}")
        if self.seed < 0:
            raise InputError(f"seed must be 0 or more, got {self.seed}")
        # A rig far outside these ranges takes too long: steps follow its shortest time scale.
        check_ranges(
            self,
            size=(1e-9, 1e9, ""),
            w0=(0.1, 100.0, "rad/s"),
            c_over_m=(0.0, 100.0, "1/s"),
            duration=(1.0, 3600.0, "s"),
            noise=(0.0, 180.0, "degrees"),
        )
        if self.theta_r is not None and self.friction is not None:
            raise InputError("one of theta_r and Tr must be left out, got both")
        self._refuse_idle()
        self._refuse_plans()
        free, forced = self.runs
        if min(free, forced) < 0 or not 1 <= free + forced <= 99:  # noqa: PLR2004
            raise InputError(f"runs must be 1 to 99 together, got {free} free and {forced} forced")
        seconds = self.duration or PRESETS[self.preset].duration[1]
        seconds = max((plan.duration for plan in self.plans), default=seconds)
        if self.rate * seconds * (free + forced) > _MOST_SAMPLES:
            raise InputError(
                f"rate must be up to {_MOST_SAMPLES / seconds / (free + forced):.4g} Hz with"
                f" {free + forced} runs of {seconds:g} s, got {self.rate:g}"
            )

    def _refuse_idle(self) -> None:
        """Refuse settings without effect."""
        asked = self.effects or (PRESETS[self.preset].effect,)
        if self.size != 1 and not any(draws_size(text) for text in asked):
            raise InputError(
                f"size must be 1 where no size of an effect is drawn, got {self.size:g}: it must "
                "have an effect whose size is not given"
            )
        if self.noise == 0 and self.correlation != 0:
            raise InputError(
                f"correlation must be 0 where noise is 0, got {self.correlation:g}: without noise "
                "there is nothing to correlate"
            )

    def _refuse_plans(self) -> None:
        asked = [n for n in ("free", "forced", "duration") if getattr(self, n) is not None]
        if self.plans and asked:
            raise InputError(f"one of {asked[0]} and plans must be left out, got both")
        for k, plan in enumerate(self.plans):
            if plan.kind not in {"free", "forced"}:
                raise InputError(f"kind of plan {k} must be free or forced, got {plan.kind!r}")
            for name in ("theta", "velocity", "p", "frequency", "phase", "lab_time", "duration"):
                check_number(f"{name} of plan {k}", getattr(plan, name))
            if not 1 <= plan.duration <= 3600:  # noqa: PLR2004
                raise InputError(f"duration of plan {k} must be 1 to 3600 s, got {plan.duration:g}")

    @property
    def runs(self) -> tuple[int, int]:
        """Numbers of free and forced runs."""
        if self.plans:
            free = sum(plan.kind == "free" for plan in self.plans)
            return free, len(self.plans) - free
        preset = PRESETS[self.preset]
        free = preset.free if self.free is None else self.free
        return free, preset.forced if self.forced is None else self.forced

    def stream(self, *path: int) -> np.random.Generator:
        """Return the random stream of one part of the experiment."""
        return np.random.default_rng([self.seed, *path])


@dataclasses.dataclass(frozen=True)
class Run:
    """One run: its plan, its noise-free motion and its record."""

    plan: RunPlan
    path: Path  # Noise-free motion
    time: Floats  # The record, s, shape (N,)
    angle: Floats  # rad, shape (N,)
    lost: int  # Number of samples lost from the record


@dataclasses.dataclass(frozen=True)
class Experiment:
    """All runs of an experiment, with its truth."""

    request: Request
    parameters: Parameters
    effects: list[Effect]
    sensor: Sensor
    runs: list[Run]


def make(request: Request) -> Experiment:
    """Draw an experiment, integrate its runs and read its sensor.

    Equal requests give equal experiments, bit for bit on one machine.

    Raises
    ------
    InputError
        If a value, a name of an effect or a combination is not allowed.

    Examples
    --------
    >>> run = make(Request("free_decay", seed=1, duration=5.0)).runs[0]
    >>> run.time.size, run.plan.kind
    (501, 'free')
    """
    preset = PRESETS[request.preset]
    rng = request.stream(_RIG)
    drawn = preset.parameters(rng)
    given = {"w0": request.w0, "c_over_m": request.c_over_m, "friction": request.friction}
    parameters = dataclasses.replace(drawn, **{k: v for k, v in given.items() if v is not None})
    if request.theta_r is not None:
        friction = request.theta_r * parameters.w0**2
        parameters = dataclasses.replace(parameters, friction=friction)
    sensor = _sensor(request, rng)
    plans = list(request.plans)
    if not plans:
        plans = preset.plan(request.stream(_RUNS), parameters.w0, request.runs)
    if request.duration is not None:
        plans = _lasting(plans, request.duration)
    kinds = {plan.kind for plan in plans}
    asked = list(request.effects or (preset.effect,))
    effects = draw(asked, request.stream(_EFFECTS), request.size, kinds)
    readings = [effect for effect in effects if effect.group == "reading"]
    others = [effect for effect in effects if effect.group != "reading"]
    lab, *harmonic = (
        np.array([getattr(plan, name) for plan in plans])
        for name in ("lab_time", "p", "frequency", "phase")
    )
    equation = Equation(parameters, Drive.harmonic(*harmonic), lab, others)
    ends = [max(_true(np.array([plan.duration]), readings)[0], 0.0) for plan in plans]
    theta, velocity = np.array([(plan.theta, plan.velocity) for plan in plans], float).T
    paths = integrate(equation, np.array(ends), theta, velocity)
    runs = []
    stops = preset.until_rest and request.duration is None and not request.plans
    for k, (planned, path) in enumerate(zip(plans, paths, strict=True)):
        plan = planned
        if stops and path.events and path.events[-1].what == "stick":
            last = float(math.ceil(path.events[-1].time + _AFTER_REST))
            plan = dataclasses.replace(plan, duration=min(plan.duration, last))
        times = sensor.times(plan.duration)
        instants = sensor.instants(times, request.stream(_SENSOR, k, 1))
        reading = read(path, _true(instants, readings), readings)
        angle, keep = sensor.write_down(reading, request.stream(_SENSOR, k, 0))
        runs.append(Run(plan, path, times[keep], angle[keep], int((~keep).sum())))
    return Experiment(request, parameters, effects, sensor, runs)


def _sensor(request: Request, rng: np.random.Generator) -> Sensor:
    low, high = PRESETS[request.preset].noise
    drawn = math.exp(rng.uniform(math.log(low), math.log(high)))
    noise = drawn if request.noise is None else request.noise
    shared = {field.name for field in dataclasses.fields(Sensor)} - {"noise"}
    settings: dict[str, Any] = {name: getattr(request, name) for name in shared}
    return Sensor(noise=math.radians(noise), **settings)


def _lasting(plans: list[RunPlan], duration: float) -> list[RunPlan]:
    """Return the runs with another duration and unchanged pauses between them."""
    result, lab = [], 0.0
    for k, plan in enumerate(plans):
        result.append(dataclasses.replace(plan, duration=duration, lab_time=round(lab, 1)))
        if k + 1 < len(plans):
            pause = plans[k + 1].lab_time - plan.lab_time - plan.duration
            lab += duration + pause
    return result


def _true(time: Floats, readings: list[Effect]) -> Floats:
    """Return the true times of samples recorded at ``time``."""
    for effect in readings:
        time = effect.clock(time)
    return time


PARAMETERS: Final = Parameters(w0=6.2, c_over_m=2 * 0.004 * 6.2, friction=0.08)
"""A rig like that of Horton, Wiercigroch & Xu (2008), figures 4 to 7 and table 1.

The paper gives no numbers; these yield periods and a decay time like those in its figures.
"""
RELEASE: Final = 3.0  # Angle of the release at rest, rad
SECONDS: Final = 86.0  # Length of the record, s: the pendulum comes to rest before its end
SENSOR: Final = Sensor(rate=100.0, counts=4096, noise=math.radians(0.1))
OFFSET: Final = math.radians(0.05)  # Reading of the encoder at rest, rad


def paper_decay(seed: int = 0) -> tuple[Floats, Floats]:
    """Return a free decay like the paper's as the encoder reads it, from release until rest.

    Parameters
    ----------
    seed : int
        Seed of the noise; 0 or more.

    Returns
    -------
    time, theta : ndarray, shape (N,)
        s and rad.
    """
    none = np.zeros(1)
    equation = Equation(PARAMETERS, Drive.harmonic(none, np.ones(1), none), none, [])
    (path,) = integrate(equation, np.array([SECONDS]), np.array([RELEASE]), none)
    times = SENSOR.times(SECONDS)
    reading = path.angle(times) + OFFSET
    angle, written = SENSOR.write_down(reading, np.random.default_rng(seed))
    return times[written], angle[written]
