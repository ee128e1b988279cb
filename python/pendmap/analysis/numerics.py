"""Numerical choices that analyses share: checks, the core's arguments, attributes of results."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any, TypedDict

from pendmap import _core
from pendmap.errors import (
    MOST_PERIODS,
    MOST_SEED,
    MOST_THREADS,
    check_callable,
    check_number,
    check_whole,
    instruction_set,
)
from pendmap.files.variables import FORMAT_VERSION

Progress = Callable[[int, int], object]  # Called with units of work done and in total

_STEPS = 10_000  # Number of progress steps of a part of a computation
TOL = 1e-6  # Default error of a state after 5 periods; determines the step


class Choices(TypedDict):
    """Numerical choices as keyword arguments of analyses, or as passed to the core."""

    tol: float
    max_periods: int | None
    threads: Any  # None for one per processor, 0 in the core
    seed: int


@dataclasses.dataclass(frozen=True)
class Numerics:
    """Numerical choices of an analysis, checked on construction."""

    tol: float = TOL
    max_periods: int | None = None
    threads: int | None = None
    seed: int = 0
    progress: Progress | None = None
    began: float = dataclasses.field(default_factory=time.perf_counter, init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tol", check_number("tol", self.tol))
        for name, least, most in (
            ("max_periods", 1, MOST_PERIODS),
            ("threads", 1, MOST_THREADS),
            ("seed", 0, MOST_SEED),
        ):
            object.__setattr__(self, name, optional_whole(name, getattr(self, name), least, most))
        check_callable("progress", self.progress)

    @property
    def workers(self) -> int:
        """Number of threads as passed to the core: 0 for one per processor."""
        return self.threads or 0

    @property
    def options(self) -> Choices:
        """The choices as keyword arguments of another analysis."""
        return {
            "tol": self.tol,
            "max_periods": self.max_periods,
            "threads": self.threads,
            "seed": self.seed,
        }

    @property
    def core(self) -> Choices:
        """The choices as passed to the core."""
        return {**self.options, "threads": self.workers}

    @property
    def limits(self) -> tuple[float, int | None, int]:
        """Tolerance, largest number of periods and threads, as passed to the core."""
        return self.tol, self.max_periods, self.workers

    def provenance(self) -> dict[str, Any]:
        """Return attributes on how a result was computed, with the time since ``began``."""
        return {
            "tol": self.tol,
            "seconds": time.perf_counter() - self.began,
            "simd": instruction_set(),
            "threads": self.workers or _core.default_threads(),
            "seed": self.seed,
            "pendmap_version": _core.__version__,
            "format_version": FORMAT_VERSION,
        }


def part(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """Return the progress of one of ``parts`` equal parts of a computation; it never falls."""
    if progress is None:
        return None
    furthest = 0.0

    def report(done: int, total: int) -> None:
        nonlocal furthest
        furthest = max(furthest, done / max(total, 1))
        progress(round(_STEPS * (number + furthest)), _STEPS * parts)

    return report


def in_rounds(progress: Progress | None, typical: int) -> Progress | None:
    """Return the progress of rounds whose number is not known: it rises with each, and never falls.

    A round begins where the work done does not rise. After k rounds the share is k / (k +
    ``typical``).
    """
    if progress is None:
        return None
    rounds, last = 0, 0

    def report(done: int, total: int) -> None:
        nonlocal rounds, last
        rounds += done <= last
        last = done
        passed = rounds + done / max(total, 1)
        progress(round(_STEPS * passed / (passed + typical)), _STEPS)

    return report


def optional_whole(name: str, value: int | None, least: int, most: int) -> int | None:
    """Return a whole number between two bounds, or None if none is given."""
    return None if value is None else check_whole(name, value, least, most)
