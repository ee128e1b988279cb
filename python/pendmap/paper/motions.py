"""Forced motions of the paper's figures 8 and 9: virtual rig against identified model."""

from __future__ import annotations

import dataclasses
import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.ndimage import distance_transform_edt

from pendmap import virtual_rig
from pendmap.analysis.basins import basins
from pendmap.analysis.grid import Axis, Grid
from pendmap.comparison import Ensemble, compare
from pendmap.records import read_experiment
from pendmap.virtual_rig import RunPlan, experiment

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pendmap.comparison import ForcedComparison
    from pendmap.model import Rig

STEADY: Final = (
    (0.2, 1.9, "oscillation", 2, 0),
    (0.6, 2.1, "oscillation", 2, 0),
    (0.3, 2.0, "rotation", 1, 1),
    (1.0, 2.0, "rotation", 1, 1),
)
"""Drives ``p`` and ``Omega / 6.2 rad/s``, not given by the paper, and the attractor of the start:
kind, period, turns."""
TUMBLING: Final = ((0.6, 2.0, 2.0, 6.0), (0.4, 2.0, 2.0, 6.0))
"""``p``, ``Omega / 6.2 rad/s``, angle (rad) and velocity (rad/s) of the start."""
SECONDS = 2500.0  # Time after which the paper takes its steady states, s
TUMBLED = 300.0
"""Duration of a tumbling run, s, in which 98 % of the ensemble members settle."""
_W0: Final = 6.2  # Natural frequency of the paper's rig, rad/s
_CELLS: Final = 100  # Cells a side of the basin map in which starts are chosen
_FASTEST: Final = 18.0  # Largest velocity of that map, rad/s
_RATE: Final = 50.0  # Samples a second of the long runs
_MEMBERS: Final = 40  # Number of ensemble members of a run of 2500 s


def steady_states(model: Rig, seed: int = 0) -> list[ForcedComparison]:
    """Return runs of 2500 s, each started deepest inside the basin of an attractor of the model."""
    starts = [
        (p, omega, *_inside(dataclasses.replace(model, p=p, Omega=omega * _W0), kind, n, w))
        for p, omega, kind, n, w in STEADY
    ]
    return _beside(model, starts, SECONDS, seed, _MEMBERS)


def tumbling(model: Rig, seed: int = 0) -> list[ForcedComparison]:
    """Return runs of 300 s from starts that tumble at first, without any pre-iterates."""
    return _beside(model, TUMBLING, TUMBLED, seed)


def _inside(model: Rig, kind: str, n: int, w: int) -> tuple[float, float]:
    """Return the start in the basin of an attractor that is farthest from any other basin."""
    grid = Grid(Axis(-math.pi, math.pi, _CELLS), Axis(-_FASTEST, _FASTEST, _CELLS))
    result = basins(model, grid, check=False)
    wanted = (result["kind"] == kind) & (result["n"] == n) & (result["w"] == w)
    here = np.isin(result["label"].values, result["id"].values[wanted.values])
    # The angle is periodic: the map is tiled three times and the middle copy is used.
    deep = distance_transform_edt(np.tile(here, 3))[:, _CELLS : 2 * _CELLS]
    row, column = np.unravel_index(int(np.argmax(deep)), deep.shape)
    return float(result["theta"].values[column]), float(result["velocity"].values[row])


def _beside(
    model: Rig, starts: Iterable[tuple[float, ...]], seconds: float, seed: int, members: int = 400
) -> list[ForcedComparison]:
    """Compare a model with records of the virtual rig from starts (p, Omega / w0, th, v)."""
    truth = experiment.PARAMETERS
    request = virtual_rig.Request(
        preset="forced",
        seed=seed,
        effects=("none",),
        w0=truth.w0,
        c_over_m=truth.c_over_m,
        friction=truth.friction,
        noise=math.degrees(experiment.SENSOR.noise),
        counts=experiment.SENSOR.counts,
        rate=_RATE,
        plans=tuple(
            RunPlan("forced", theta, velocity, seconds, p=p, frequency=round(omega * _W0, 6))
            for p, omega, theta, velocity in starts
        ),
    )
    with tempfile.TemporaryDirectory() as folder:
        where = virtual_rig.places(Path(folder) / "virtual_rig", replace=False)
        virtual_rig.write(virtual_rig.make(request), where)
        read = read_experiment(where.experiment)
        return list(compare(model, read, ensemble=Ensemble(members=members)).forced)
