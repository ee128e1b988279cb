"""Requests that exceed the memory, under a real limit: one line each, and no file."""

from __future__ import annotations

import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

LIMIT = 6_000_000
"""Limit of `ulimit -v`, kB."""

COMMANDS = [
    "basins --p 0.6 --grid 20000",
    "map --p 0:1:3000 --omega 1:2:3000",
    "orbit --n 2 --w 0 --grid 100000",
    "simulate --until 5e6 --samples 100 --lyapunov --json",
]

CALLS = """
import numpy as np
import pendmap
from pendmap import _core
pendulum = pendmap.Pendulum(p=0.6)
wide = pendmap.Grid.square(40000)
calls = {
    "basins": lambda: pendmap.basins(pendulum, wide),
    "orbit": lambda: pendmap.orbit(pendulum, 1, 0, wide),
    "parameter_map": lambda: pendmap.parameter_map(
        pendulum, {"p": (0.1, 1.0, 20000), "gamma": (0.1, 0.2, 20000)}
    ),
    "simulate": lambda: pendmap.simulate(pendulum, 1.0, 0.0, 5e4, samples=10000),
    "basins_of": lambda: pendmap.basins_of(pendulum, *np.broadcast_to(0.5, (2, 10**9))),
    "advance": lambda: pendmap.advance(pendulum, *np.broadcast_to(0.5, (2, 10**9)), 1),
    "growth": lambda: _core.growth(
        pendulum, np.zeros(10**4), np.zeros(10**4), 10**6, 1, 20, 1
    ),
}
for name, call in calls.items():
    try:
        call()
    except MemoryError as error:
        assert str(error), name
    else:
        raise AssertionError(f"{name} is not refused")
"""

needs_limits = pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("bash") is None, reason="needs ulimit -v"
)


def limited(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    line = f'ulimit -v {LIMIT} && exec "$@"'
    return subprocess.run(
        [str(shutil.which("bash")), "-c", line, "bash", *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        cwd=folder,
    )


@needs_limits
@pytest.mark.parametrize("words", COMMANDS)
def test_a_command_that_asks_for_too_much_is_refused_in_one_line(
    words: str, tmp_path: Path
) -> None:
    ended = limited(sys.executable, "-m", "pendmap", *words.split(), "--quiet", folder=tmp_path)
    assert ended.returncode == 2, ended.stderr
    assert ended.stderr.startswith("pendmap: not enough memory: ")
    assert ended.stderr.count("\n") == 1
    assert not ended.stdout
    assert not list(tmp_path.iterdir())


@needs_limits
def test_a_function_that_asks_for_too_much_raises_memory_error(tmp_path: Path) -> None:
    ended = limited(sys.executable, "-c", CALLS, folder=tmp_path)
    assert ended.returncode == 0, ended.stderr


@needs_limits
def test_a_command_runs_with_the_largest_number_of_threads(tmp_path: Path) -> None:
    line = "-m pendmap basins --p 0.6 --grid 12 --threads 256 --json"
    ended = limited(sys.executable, *line.split(), folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
