"""Functions in a forked child of a process that has called them: no thread is left behind."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCRIPT = """
import os, signal, sys
import numpy as np
import decays, pendmap
pendulum, grid = pendmap.Pendulum(p=0.6), pendmap.Grid.square(12)
time, theta = decays.record(decays.decay(until=12.0), seconds=8.0, rate=25.0)
jobs = [
    lambda: pendmap.basins(pendulum, grid),
    lambda: pendmap.bifurcation(pendulum, {"p": (0.6, 0.8, 3)}),
    lambda: pendmap.lyapunov(pendmap.Pendulum(p=2.0), 1.0, 0.0, precision=0.1),
    lambda: pendmap.orbit(pendulum, 1, 1, grid),
    lambda: pendmap.simulate(pendulum, 1.0, 0.0, 20.0, lyapunov=True),
    lambda: pendmap.identification.identify(time, theta),
    lambda: pendmap.save(pendmap.basins(pendulum, grid), sys.argv[1]),
]
for job in jobs:
    job()
for job in jobs:
    child = os.fork()
    if child == 0:
        signal.alarm(60)  # it waits for ever
        job()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0, job
"""


@pytest.mark.thorough
@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_functions_work_in_a_forked_child(suffix: str, tmp_path: object) -> None:
    words = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", SCRIPT]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    run = subprocess.run(
        [*words, f"{tmp_path}/a{suffix}"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert run.returncode == 0, run.stdout + run.stderr
