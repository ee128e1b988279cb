"""heyoka's adaptive Taylor integrator in batch mode, and the search for its best setting."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import heyoka as hy  # type: ignore[import-untyped]
import numpy as np

from benchmarks.peers.common import Case, Regular, clock, loosest
from benchmarks.peers.report import has_avx512

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

# The tolerance acts only through the order, ceil(1 - ln(tol) / 2): one rung an order is enough.
LADDER = tuple(math.exp(-2.0 * (order - 1.5)) for order in range(6, 19))
SURVEY_SIDE, SURVEY_PERIODS, SURVEY_ROUNDS = 48, 40, 6


@dataclass(frozen=True)
class Setting:
    """How the integrator is built and driven.

    `drive` is "time" for cos(omega t) of the integrator's own time, or "oscillator" for two more
    states that carry c = 1 + p cos(omega t): c' = -omega s, s' = omega (c - 1).
    """

    batch: int
    force_avx512: bool = False
    drive: Literal["time", "oscillator"] = "time"
    fast_math: bool = False
    compact_mode: bool = False
    high_accuracy: bool = False
    slp_vectorize: bool = False
    opt_level: int = 3
    propagate: Literal["until", "grid"] = "until"

    def __str__(self) -> str:
        """Return the setting as text: the differences from heyoka's defaults."""
        flags = ("force_avx512", "fast_math", "compact_mode", "high_accuracy", "slp_vectorize")
        words = [f"batch {self.batch}", self.drive, *(f for f in flags if getattr(self, f))]
        if self.opt_level != Setting.opt_level:
            words.append(f"opt_level {self.opt_level}")
        if self.propagate == "grid":
            words.append("propagate_grid")
        return ", ".join(words)


class HeyokaBatch:
    """taylor_adaptive_batch for one case, setting and tolerance, on one thread."""

    label = "heyoka"

    def __init__(self, case: Case, how: Setting, tol: float, torque: float = 0.0) -> None:
        """Build and compile the integrator; the equation's parameters are constants in it."""
        self.case, self.how, self.tol = case, how, tol
        system, extra = _equations(case, how, torque)
        self._extra = np.array(extra, dtype=np.float64)[:, None]
        self._integrator = hy.taylor_adaptive_batch(
            system,
            np.zeros((len(system), how.batch)),
            tol=tol,
            force_avx512=how.force_avx512,
            fast_math=how.fast_math,
            compact_mode=how.compact_mode,
            high_accuracy=how.high_accuracy,
            slp_vectorize=how.slp_vectorize,
            opt_level=how.opt_level,
        )

    @property
    def setting(self) -> str:
        """The setting and the tolerance as text."""
        return f"{self.how}, tol {self.tol:.1e} (order {self._integrator.order})"

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return unwrapped angle and velocity, shape (N,), after whole forcing periods."""
        return self.propagate(theta, velocity, periods * self.case.period, periods)

    def propagate(
        self, theta: Floats, velocity: Floats, until: float, samples: int = 1
    ) -> tuple[Floats, Floats]:
        """Return unwrapped angle and velocity, shape (N,), at time `until`."""
        batch, count = self.how.batch, theta.size
        filled = batch * math.ceil(count / batch)
        starts = np.pad(np.stack([theta, velocity]), ((0, 0), (0, filled - count)), mode="edge")
        ends = np.empty((2, filled))
        integrator = self._integrator
        state = integrator.state
        stops = np.repeat(np.linspace(0.0, until, samples + 1)[:, None], batch, axis=1)
        for first in range(0, filled, batch):
            block = slice(first, first + batch)
            integrator.set_time(0.0)
            state[:2] = starts[:, block]
            state[2:] = self._extra
            if self.how.propagate == "grid":
                integrator.propagate_grid(stops)
            else:
                integrator.propagate_until(until)
            ends[:, block] = state[:2]
        return ends[0, :count], ends[1, :count]


def _equations(
    case: Case, how: Setting, torque: float
) -> tuple[list[tuple[Any, Any]], tuple[float, ...]]:
    """Return the system (state, right-hand side) and the starts of the states beyond two."""
    gamma, p, omega = case.gamma, case.p, case.omega
    theta, velocity, c, s = hy.make_vars("theta", "velocity", "c", "s")
    sine = hy.sin(theta)
    if p == 0.0:
        return [(theta, velocity), (velocity, torque - gamma * velocity - sine)], ()
    if how.drive == "time":
        force = 1.0 + p * hy.cos(omega * hy.time)
        return [(theta, velocity), (velocity, -gamma * velocity - force * sine)], ()
    system = [
        (theta, velocity),
        (velocity, -gamma * velocity - c * sine),
        (c, -omega * s),
        (s, omega * c - omega),
    ]
    return system, (1.0 + p, 0.0)


def plain_settings() -> list[Setting]:
    """Return heyoka's recommended batch size, and also batch 8 if there is AVX-512."""
    settings = [Setting(hy.recommended_simd_size())]
    if has_avx512():
        settings.append(Setting(8, force_avx512=True))
    return settings


def candidates() -> list[Setting]:
    """Return the settings compared first: batch, drive and fast_math."""
    settings = plain_settings()
    settings.append(replace(settings[-1], batch=2 * settings[-1].batch))
    return [
        replace(setting, drive=drive, fast_math=fast)
        for setting in settings
        for drive in ("time", "oscillator")
        for fast in (False, True)
    ]


def variations(best: Setting) -> list[Setting]:
    """Return the best candidate with one further option changed, for each option."""
    return [
        replace(best, compact_mode=True),
        replace(best, high_accuracy=True),
        replace(best, slp_vectorize=True),
        replace(best, opt_level=2),
        replace(best, propagate="grid"),
    ]


def at_error(
    case: Case, how: Setting, sample: Regular, target: float, *, torque: float = 0.0
) -> HeyokaBatch:
    """Return the integrator at the loosest tolerance whose error is at most `target`."""
    return loosest(lambda tol: HeyokaBatch(case, how, tol, torque), LADDER, sample, target)


def survey(case: Case, sample: Regular, target: float) -> list[tuple[float, HeyokaBatch]]:
    """Time every setting, each at its own tolerance for the target error.

    Returns
    -------
    list of (ns, integrator)
        ns a trajectory and forcing period (best of some alternating rounds), quickest first.
    """
    first = _timed([at_error(case, how, sample, target) for how in candidates()])
    best = min(first, key=lambda pair: pair[0])[1].how
    second = _timed([at_error(case, how, sample, target) for how in [best, *variations(best)]])
    return sorted([*first, *second[1:]], key=lambda pair: pair[0])


def _timed(methods: Sequence[HeyokaBatch]) -> list[tuple[float, HeyokaBatch]]:
    rounds = [
        [clock(method, SURVEY_SIDE, SURVEY_PERIODS) for method in methods]
        for _ in range(SURVEY_ROUNDS)
    ]
    return [(min(times), m) for times, m in zip(zip(*rounds, strict=True), methods, strict=True)]
