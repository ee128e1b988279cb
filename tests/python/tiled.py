"""Small results in many tiles; as a program, a run that is stopped at one of its writes."""

from __future__ import annotations

import errno
import functools
import importlib
import os
import signal
import sys
from typing import TYPE_CHECKING, Any

import pytest
import xarray as xr

import pendmap
from pendmap import Grid, Pendulum, RunOptions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

TILE = 1500
_DRY = Pendulum(gamma=0.05, theta_r=0.05, p=1.1, omega=1.9)
_SLOW = Pendulum(gamma=0.03, p=0.5, omega=2.6)  # A further search finds attractors
_WINDOW = {"p": (0.2, 2.0, 20), "omega": (1.5, 2.2, 18)}
_SMALL = {"p": (0.4, 0.9, 9), "omega": (1.8, 2.2, 9)}
_CHANGES = ("seconds", "summary", "threads", "history")  # Attributes of how, not of what

CASES: dict[str, Callable[..., xr.Dataset]] = {
    "basins": functools.partial(pendmap.basins, _DRY, Grid.square(83)),
    "chaos": functools.partial(pendmap.basins, Pendulum(p=1.5, omega=1.1), Grid.square(103)),
    "slow": functools.partial(pendmap.basins, _SLOW, Grid.square(163)),
    "map": functools.partial(pendmap.parameter_map, Pendulum(), _WINDOW, starts=3),
    "sweep": functools.partial(pendmap.sweep, Pendulum(), {"p": (0.4, 1.6, 40)}, grid=16),
    "plane": functools.partial(pendmap.sweep, Pendulum(), _SMALL, grid=10),
    "bifurcation": functools.partial(pendmap.bifurcation, Pendulum(), {"p": (0.2, 2.0, 40)}),
    "lifetime": functools.partial(pendmap.lifetime, Pendulum(p=1.7), starts=4000),
}


@functools.cache
def plain(name: str) -> xr.Dataset:
    return case(name)


def case(name: str, **keep: Any) -> xr.Dataset:  # noqa: ANN401 (of a run)
    return CASES[name](run=RunOptions(**keep))


class StoppedError(Exception):
    """A run that is stopped by its progress."""


def begun(analysis: Callable[..., Any], store: Path, share: float = 0.5) -> None:
    """Begin a run in a store, and stop it at a share of its work, when a tile is kept."""
    records = store.with_name(f"{store.name}.part") / "records"

    def stop(done: int, total: int) -> None:
        # The search for attractors reports its progress too.
        if done > share * total and any(path.name.isdecimal() for path in records.glob("*/*")):
            raise StoppedError

    with pytest.raises(StoppedError):
        analysis(run=RunOptions(store=store, progress=stop))


def assert_same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Assert that two results are equal bit for bit."""
    bare = [
        each.load().assign_attrs(dict.fromkeys(_CHANGES, ""), threads=0) for each in (one, other)
    ]
    xr.testing.assert_identical(*bare)


def stopped(fault: str, at: int, store: str, count: list[int]) -> None:
    """Stop this process when it writes to ``store`` for the time ``at``; count in ``count``."""

    def hook(event: str, words: tuple[Any, ...]) -> None:
        writes = {"open", "os.rename", "os.remove", "os.rmdir", "os.mkdir"}
        if event not in writes or os.path.basename(store) not in str(words[0]):  # noqa: PTH119
            return
        if event == "open" and not words[2] & os.O_CREAT:
            return
        count[0] += 1
        if fault == "killed" and count[0] == at:
            os.kill(os.getpid(), signal.SIGKILL)
        if fault == "full" and count[0] >= at and event == "open":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(words[0]))

    sys.addaudithook(hook)


if __name__ == "__main__":
    # It is killed at the write ``at``, or the disk is full from there on, or it tells their number.
    name, place, fault, at = sys.argv[1:]
    importlib.import_module("pendmap.analysis.basin_tiles").TILE = TILE
    writes = [0]
    stopped(fault, int(at), place, writes)
    case(name, store=place, resume=True)
    sys.stdout.write(f"{writes[0]}\n")
