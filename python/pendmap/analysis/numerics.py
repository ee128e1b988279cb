"""Numerical choices that analyses share: checks, the core's arguments, attributes of results."""

from __future__ import annotations

import dataclasses
import time
from typing import Any, TypedDict

from pendmap import _core
from pendmap.analysis.run import RunOptions
from pendmap.errors import MOST_PERIODS, check_number, check_whole, instruction_set
from pendmap.files.variables import FORMAT_VERSION

TOL = 1e-6  # Default error of a state after 5 periods; determines the step


class Choices(TypedDict):
    """Numerical choices as passed to the core."""

    tol: float
    max_periods: int | None
    threads: int
    seed: int


@dataclasses.dataclass(frozen=True)
class Numerics:
    """Numerical choices of an analysis, checked on construction."""

    run: RunOptions = dataclasses.field(default_factory=RunOptions)
    tol: float = TOL
    max_periods: int | None = None
    began: float = dataclasses.field(default_factory=time.perf_counter, init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tol", check_number("tol", self.tol))
        bound = optional_whole("max_periods", self.max_periods, 1, MOST_PERIODS)
        object.__setattr__(self, "max_periods", bound)

    @property
    def request(self) -> dict[str, Any]:
        """The choices that determine numbers of a result."""
        return {"tol": self.tol, "max_periods": self.max_periods, "seed": self.run.seed}

    @property
    def core(self) -> Choices:
        """The choices as passed to the core."""
        bound, seed = self.max_periods, self.run.seed
        return {"tol": self.tol, "max_periods": bound, "threads": self.run.workers, "seed": seed}

    def provenance(self) -> dict[str, Any]:
        """Return attributes on how a result was computed, with the time since ``began``."""
        return {
            "tol": self.tol,
            "seconds": time.perf_counter() - self.began,
            "simd": instruction_set(),
            "threads": self.run.here,
            "seed": self.run.seed,
            "pendmap_version": _core.__version__,
            "format_version": FORMAT_VERSION,
        }


def optional_whole(name: str, value: int | None, least: int, most: int) -> int | None:
    """Return a whole number between two bounds, or None if none is given."""
    return None if value is None else check_whole(name, value, least, most)
