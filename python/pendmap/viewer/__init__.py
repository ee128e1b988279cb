"""Recordings for the Rerun viewer; the only place that imports rerun.

``record`` looks at what a dataset holds and writes its recording, ``record_identification`` writes
that of what was found in records, ``record_discrepancy`` that of what a model lacks;
``open_viewer`` shows one; ``Live`` sends a trajectory to a running viewer while it is computed.
"""

from __future__ import annotations

import functools
import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendmap.charts import registry
from pendmap.files import whole_file
from pendmap.viewer import (
    basins,
    chart,
    frame,
    trajectory,
)
from pendmap.viewer.live import ADDRESS, Live, NobodyListensError, check_address
from pendmap.viewer.window import (
    NoDisplayError,
    NotARecordingError,
    RecordingNotFoundError,
    ViewerError,
    check_display,
    open_viewer,
)

if TYPE_CHECKING:
    import os

    import xarray as xr

    from pendmap.viewer.discrepancy import record_discrepancy
    from pendmap.viewer.identification import record_identification

__all__ = [
    "ADDRESS",
    "SUFFIXES",
    "Live",
    "NoDisplayError",
    "NobodyListensError",
    "NotARecordingError",
    "RecordingNotFoundError",
    "ViewerError",
    "check_address",
    "check_display",
    "open_viewer",
    "record",
    "record_discrepancy",
    "record_identification",
]

SUFFIXES = (".rrd",)  # The kind of file a recording is

CELLS = 4096
"""Rows and columns of an image at most: graphics processors take no larger ones for sure."""

_KINDS = {
    "basins": (basins.blueprint, basins.log),
    "trajectory": (trajectory.blueprint, trajectory.log),
}

_OF_RECORDS = {
    "record_discrepancy": "pendmap.viewer.discrepancy",
    "record_identification": "pendmap.viewer.identification",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 (functions)
    """Import recordings of records when they are asked for: importing fits takes half a second."""
    if name not in _OF_RECORDS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_OF_RECORDS[name]), name)


def record(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write the recording of a dataset, with the layout in which the viewer shows it.

    Of a basin map: ``/basin/data/{labels,attractors}``, ``/settle/data/steps``,
    ``/turns/data/turns``, ``/exponent/data/exponent`` (those layers that tell something, the
    leading one in front), ``/legend`` and ``/summary``. Of closed orbits: ``/phase/data/NUMBER``
    with ``path`` and ``points``, ``/legend`` and ``/summary``. Of a map over two parameters:
    ``/kinds/data/kinds``, ``/{exponent,attractors,undecided}/data/values``. Of a bifurcation
    diagram: ``/{bifurcation,velocity,exponent}/data/NUMBER``. Of an exponent:
    ``/growth/data/own``, ``/average/data/{own,band,value}`` and ``/distribution/data/density`` or,
    of a closed orbit, ``/exponent/data/{own,value}``, and ``/attractor/data/points``. Of a
    lifetime: ``/survival/data/NUMBER`` (0: all), ``/survival/data/{tail,band}``,
    ``/tail/data/{mean,error,fitted}`` and ``/legend``. Of critical curves:
    ``/tongues/data/{plus,minus,undamped,fold,own}`` and the same under ``/paper`` in the plane of
    eq. 1.4. Of Melnikov's criterion: ``/melnikov/data/{forward,backward,own}``. Of a trajectory:
    ``/state/{theta,omega,energy}``, ``/pendulum/data/{arm,bob,pivot,trail}``,
    ``/phase/data/{curve,now}``, ``/poincare/data/points`` and ``/summary``, on the timelines
    ``sim_time`` (nondimensional time, shown as seconds) and ``period``.

    Parameters
    ----------
    dataset : xarray.Dataset
        What ``pendmap.basins``, ``pendmap.orbit``, ``pendmap.parameter_map``,
        ``pendmap.bifurcation``, ``pendmap.lyapunov``, ``pendmap.lifetime``, ``pendmap.tongues``,
        ``pendmap.melnikov`` or ``pendmap.simulate`` returned; ``attrs["kind"]`` tells which. Of a
        selection the recording shows the cells that are there, as :func:`pendmap.render.draw`.
    path : str or path
        The file to write, ``.rrd``; an existing one is replaced.

    Returns
    -------
    Path
        The file, complete.

    Raises
    ------
    InputError
        For an unknown kind of dataset or suffix.
    MemoryError
        If the dataset is too large.
    OSError
        If the file cannot be written.
    """
    dataset = registry.ready(dataset, "record")
    kind = dataset.attrs["kind"]
    if kind in _KINDS:
        layout, log = _KINDS[kind]
        view = layout(dataset)
    else:
        made = registry.build(dataset, cells=CELLS)
        view, log = chart.blueprint(made), functools.partial(chart.log, chart=made)
    with (
        whole_file(path, SUFFIXES) as part,
        frame.strict(),
        frame.written(frame.recording(dataset), view, part) as recording,
    ):
        frame.describe(recording, dataset)
        log(recording, dataset)
    return Path(path)
