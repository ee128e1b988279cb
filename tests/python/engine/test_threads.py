"""Public functions from eight threads at once: what each returns, and no crash."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import pendmap
from decays import decay, record
from pendmap import Grid, Pendulum, render

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

MODEL = Pendulum(p=0.6)
MAP = pendmap.basins(MODEL, Grid.square(16))
DIFFER = {"seconds", "history", "summary"}  # Attributes of equal results that may differ


def own_axes() -> bytes:
    figure = Figure(figsize=(3.0, 3.0), dpi=50)
    FigureCanvasAgg(figure)
    pendmap.plot(MAP, figure.add_subplot(), layer="labels")
    return b""


def again(result: Any, file: Path) -> Any:  # noqa: ANN401 (any result)
    return pendmap.load(pendmap.save(result, file))


def calls(folder: Path) -> dict[str, Callable[[], Any]]:
    """Small requests of the public functions, each with files of its own thread."""

    def file(end: str) -> Path:
        return folder / f"{threading.get_ident()}{end}"

    plane = {"p": (0.5, 0.9, 2), "omega": (1.8, 2.2, 2)}
    time, theta = record(decay(release=1.0, until=20.0), seconds=12)
    return {
        "save": lambda: again(MAP, file(".nc")),
        "save zarr": lambda: again(MAP, file(".zarr")),
        "basins": lambda: pendmap.basins(MODEL, Grid.square(12)),
        "map": lambda: pendmap.parameter_map(Pendulum(), plane, starts=3),
        "plot": lambda: render.draw(MAP, file(".png"), dpi=40).read_bytes(),
        "sweep": lambda: pendmap.sweep(MODEL, {"p": [0.5, 0.6]}, grid=8),
        "own axes": own_axes,
        "simulate": lambda: pendmap.simulate(MODEL, 1.0, 0.0, 20.0),
        "identify": lambda: str(again(pendmap.identify(time, theta), file("_report.nc"))),
    }


def same(one: Any, other: Any) -> bool:  # noqa: ANN401 (any result)
    if not isinstance(one, xr.Dataset):
        return bool(np.all(one == other))
    bare = (each.drop_vars(DIFFER, errors="ignore") for each in (one, other))
    first, second = (each.assign_attrs(dict.fromkeys(DIFFER, "")) for each in bare)
    return bool(first.identical(second))


@pytest.mark.parametrize("repeat", [1, pytest.param(12, marks=pytest.mark.thorough)])
def test_public_functions_run_in_eight_threads_at_once(tmp_path: Path, repeat: int) -> None:
    settings = dict(mpl.rcParams)
    wanted = {name: (call, call()) for name, call in calls(tmp_path).items()}
    with ThreadPoolExecutor(8) as pool:
        running = [
            (name, pool.submit(call))
            for name, (call, _) in wanted.items()
            for _ in range(8 * repeat)
        ]
    for name, future in running:
        assert same(future.result(), wanted[name][1]), name
    assert dict(mpl.rcParams) == settings
