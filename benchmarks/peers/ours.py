"""pendmap as one of the compared methods: the kernel alone, and the labels."""

from __future__ import annotations

import importlib
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.peers.common import Case, Regular, loosest

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LADDER = tuple(range(6, 400))


def _core() -> Any:  # noqa: ANN401 (the compiled module; imported only where it is compared)
    return importlib.import_module("pendmap._core")


class Pendmap:
    """The lane kernel for one case at fixed steps a forcing period."""

    label = "pendmap"

    def __init__(
        self,
        case: Case,
        steps: int,
        *,
        torque: float = 0.0,
        theta_r: float = 0.0,
        threads: int = 1,
    ) -> None:
        """Choose the steps a forcing period (2 pi where p = 0) and the threads."""
        self.case, self.steps, self.threads = case, steps, threads
        pendulum = importlib.import_module("pendmap").Pendulum
        self.pendulum = pendulum(
            gamma=case.gamma, p=case.p, omega=case.omega, torque=torque, theta_r=theta_r
        )

    @property
    def setting(self) -> str:
        """The steps and the instruction set as text."""
        return f"{simd()}, {self.steps} steps a period"

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return wrapped angle and velocity, shape (N,), after whole forcing periods."""
        theta, velocity, _ = _core().advance(
            self.pendulum, theta, velocity, periods, self.steps, self.threads
        )
        return theta, velocity


def simd() -> str:
    """Return the instruction set that pendmap uses here."""
    name: str = _core().simd()
    return name


def at_error(case: Case, sample: Regular, target: float, *, torque: float = 0.0) -> Pendmap:
    """Return the kernel with the fewest steps a period whose error is at most `target`."""
    return loosest(lambda steps: Pendmap(case, steps, torque=torque), LADDER, sample, target)


def command() -> str:
    """Return the command `pendmap` installed with this Python.

    Raises
    ------
    FileNotFoundError
        If it is not installed.
    """
    found = shutil.which("pendmap", path=str(Path(sys.executable).parent)) or shutil.which(
        "pendmap"
    )
    if found is None:
        msg = "the command pendmap is not installed"
        raise FileNotFoundError(msg)
    return found
