"""Recordings of datasets: their charts, the basins of a sweep, a trajectory in motion."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import registry
from pendmap.files import facts
from pendmap.viewer import chart, recording, sweep, trajectory

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb
    import xarray as xr

_OF_A_RUN: Final = ("seconds", "summary", "history")  # Facts that differ between equal results
_PLAIN: Final = (str, bool, int, float, np.generic)


def contents(dataset: xr.Dataset) -> dict[str, Any]:
    """Return layout, contents and name of the recording of a dataset."""
    attrs, kind = dataset.attrs, dataset.attrs["kind"]
    known = {str(k): v for k, v in facts(dataset).items() if k not in _OF_A_RUN}
    arrays = (v.values for k, v in sorted(dataset.variables.items()) if v.ndim)
    made: dict[str, Any] = {
        "name": ": ".join(str(attrs[key]) for key in ("kind", "title") if key in attrs),
        "content": recording.content_of([sorted(known.items()), *arrays]),
        "known": {k: _property(v) for k, v in known.items() if isinstance(v, _PLAIN)},
    }
    if kind == "trajectory":
        around = trajectory.places(known, dataset["velocity"].values)
        layout = trajectory.layout(known, around)
        return made | {"layout": layout, "log": functools.partial(trajectory.log, dataset=dataset)}
    drawn = chart.drawings(registry.build(dataset, cells=chart.CELLS))
    front: list[rrb.View | rrb.Container] = [drawn[0].container]
    line = recording.TIMELINE
    if kind == "basin_sweep":
        front, line = [sweep.view(dataset), *front], sweep.timeline(dataset)

    def log(stream: rr.RecordingStream) -> None:
        lines = str(attrs.get("summary", "")).splitlines()
        chart.log(stream, drawn, "\n\n".join(lines))
        if kind == "basin_sweep":
            sweep.log(stream, dataset, drawn[0].places)

    shares = [*([6] * len(front)), 5]
    return made | {
        "layout": recording.screen(*front, chart.ASIDE, shares=shares, timeline=line),
        "log": log,
    }


def _property(value: Any) -> float | str:  # noqa: ANN401 (text or a number)
    """Return a property, which has one type in all recordings of a process."""
    return value if isinstance(value, str) else float(value)
