"""Recordings for the Rerun viewer; the only package that imports rerun.

``record`` writes the recording of a result, ``view`` writes it or opens it; ``open_viewer`` shows a
recording; ``Live`` sends a trajectory to a running viewer during its computation.
"""

from __future__ import annotations

import functools
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from pendmap.charts import registry
from pendmap.errors import InputError, MissingExtraError, ViewerError, short_repr
from pendmap.files import facts

try:
    import rerun.blueprint as rrb

    from pendmap.viewer import moving, recording, sweep, trajectory
    from pendmap.viewer.chart import CELLS, drawings, plain
    from pendmap.viewer.live import ADDRESS, Live, NobodyListensError, check_address
    from pendmap.viewer.recording import SUFFIXES
    from pendmap.viewer.window import (
        NoDisplayError,
        NotARecordingError,
        RecordingNotFoundError,
        check_display,
        open_viewer,
    )
except ModuleNotFoundError as error:
    text = f"recordings and the viewer need the extra pendmap[viewer] ({error})"
    raise MissingExtraError(text) from error

if TYPE_CHECKING:
    from collections.abc import Iterable

    import rerun as rr

    from pendmap.viewer.chart import Drawing

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
    "view",
]

_OF_A_RUN = ("seconds", "summary", "history")  # Facts that differ between equal results
_PLAIN = (str, bool, int, float, np.generic)
ASIDE = rrb.Vertical(
    rrb.TextDocumentView(origin="/legend", name="Legend"),
    rrb.TextDocumentView(origin="/summary", name="Summary"),
)


def record(
    result: Any,  # noqa: ANN401 (a dataset, records, or what was found in records)
    path: str | os.PathLike[str],
) -> Path:
    """Write the recording of a result, with the layout in which the viewer shows it.

    A recording has every panel of the result's chart, marks under ``/PANEL/data``, their names and
    colours in ``/legend``, and ``/summary``. Basin map: ``/basin/data/{labels,attractors}``,
    ``/settle/data/steps``, ``/turns/data/turns``, ``/exponent/data/exponent``. Sweep: the basins of
    each model on the timeline of the parameter (of two: ``map``), and its chart. Map over two
    parameters: ``/kinds/data/kinds``, ``/{exponent,attractors,undecided}/data/values``.
    Bifurcation diagram: ``/{bifurcation,velocity,exponent}/data/NUMBER``. Trajectory:
    ``/state/{theta,omega,energy}``, ``/pendulum/data/{arm,bob,pivot,trail}``,
    ``/phase/data/{curve,now}``, ``/poincare/data/points``, on the timelines ``sim_time``
    (nondimensional time, shown as seconds) and ``period``. Identification and diagnosis, of each
    run, on the record's own seconds: ``/run_1/angle/{record,model}``,
    ``/run_1/residual/{residual,above,below}`` (mrad) and moving pendulums in
    ``/run_1/pendulum/data``; a diagnosis has the models ``before`` and ``after``.

    Parameters
    ----------
    result : xarray.Dataset or other result
        Whatever has a figure. A selection of a dataset is shown with its own cells.
    path : str or path
        The file to write, ``.rrd``; an existing one is replaced.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        If there is no recording of such a result, for another suffix, or for times that a recording
        cannot hold.
    MemoryError
        If the dataset is too large.
    OSError
        If the file cannot be written.
    """
    if isinstance(result, xr.Dataset):
        made = _of_dataset(registry.ready(result, "record"))
    elif type(result).__name__ in registry.RESULTS:
        made = _of_records(result)
    else:
        raise InputError(
            "result must be a dataset, records, an identification, a comparison or a diagnosis, "
            f"got {short_repr(result)}"
        )
    return recording.save(path, **made)


def _of_dataset(dataset: xr.Dataset) -> dict[str, Any]:
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
        layout = trajectory.blueprint(dataset)
        return made | {"layout": layout, "log": functools.partial(trajectory.log, dataset=dataset)}
    drawn = drawings(registry.build(dataset, cells=CELLS))
    front: list[rrb.View | rrb.Container] = [drawn[0].container]
    line = recording.TIMELINE
    if kind == "basin_sweep":
        front, line = [sweep.view(dataset), *front], sweep.timeline(dataset)

    def log(stream: rr.RecordingStream) -> None:
        lines = str(attrs.get("summary", "")).splitlines()
        _pages(stream, drawn, "\n\n".join(lines))
        if kind == "basin_sweep":
            sweep.log(stream, dataset, drawn[0].places)

    shares = [*([6] * len(front)), 5]
    return made | {
        "layout": recording.screen(*front, ASIDE, shares=shares, timeline=line),
        "log": log,
    }


def _of_records(result: Any) -> dict[str, Any]:  # noqa: ANN401 (of several types)
    """Return layout, contents and name of the recording of what was found in records."""
    from pendmap.viewer import runs  # noqa: PLC0415 (importing fits takes half a second)

    shown = registry.of_result(result, cells=CELLS)
    drawn, summary = drawings(shown), runs.summary(result)
    motions, larger = runs.motions(result)
    moving.refuse_late(shown.title, (one.time for one in motions))
    tabs = [runs.container(f"run_{k}", one, larger) for k, one in enumerate(motions, 1)]
    tabs += [one.container for one in drawn]

    def log(stream: rr.RecordingStream) -> None:
        _pages(stream, drawn, summary)
        for number, one in enumerate(motions, 1):
            runs.log(stream, f"run_{number}", one, larger)

    arrays = (v for one in motions for v in (one.time, one.record, *(m[2] for m in one.models)))
    return {
        "name": plain(shown.title),
        "content": recording.content_of([shown.title, summary, *arrays]),
        "known": {"deviations_drawn_larger": larger, **runs.known(result)},
        "layout": recording.screen(rrb.Tabs(*tabs, active_tab=0), ASIDE, shares=[11, 5]),
        "log": log,
    }


def _pages(stream: rr.RecordingStream, drawn: Iterable[Drawing], summary: str) -> None:
    """Log the panels of charts, their legend and a summary."""
    recording.text(stream, "summary", summary)
    recording.text(stream, "legend", "\n".join(line for one in drawn for line in one.legend()))
    for one in drawn:
        for place in one.places:
            place.log(stream)


def _property(value: Any) -> float | str:  # noqa: ANN401 (text or a number)
    """Return a property, which has one type in all recordings of a process."""
    return value if isinstance(value, str) else float(value)


def view(
    result: Any,  # noqa: ANN401 (a dataset, records, or what was found in records)
    path: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the Rerun recording of a result, or open it in the viewer.

    Parameters
    ----------
    result : xarray.Dataset, other result or path
        A result of any analysis, records, a result of :func:`pendmap.identify`,
        :func:`pendmap.compare` or :func:`pendmap.diagnose`; or a recording (.rrd), which is opened.
    path : str or path, optional
        The recording to write, ``.rrd``; an existing one is replaced. Without it the viewer shows
        the result, from a file in a temporary folder.

    Returns
    -------
    Path
        The recording.

    Raises
    ------
    InputError
        If there is no recording of such a result, or for another suffix.
    NoDisplayError, ViewerError
        If the viewer cannot be opened; the message names the recording, which is complete.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.basins(pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0), 20)
    >>> pendmap.view(result, "basins.rrd").name
    'basins.rrd'
    """
    if isinstance(result, str | os.PathLike):
        if path is not None:
            raise InputError(f"path must be left out where a recording is opened, got {path!r}")
        open_viewer(result)
        return Path(result)
    if path is not None:
        return record(result, path)
    target = record(result, Path(tempfile.mkdtemp(prefix="pendmap-")) / "result.rrd")
    open_viewer(target)
    return target
