"""Recordings for the Rerun viewer; the only package that imports rerun.

``record`` writes the recording of a dataset, ``record_identification`` that of an identification,
``record_discrepancy`` that of a diagnosis, ``view`` that of any of them; ``open_viewer`` shows a
recording; ``Live`` sends a trajectory to a running viewer during its computation.
"""

from __future__ import annotations

import functools
import importlib
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from pendmap.charts import registry
from pendmap.errors import InputError, MissingExtraError, ViewerError, short_repr

try:
    from pendmap.viewer import basin_sweep, basins, chart, frame, trajectory
    from pendmap.viewer.frame import SUFFIXES
    from pendmap.viewer.live import ADDRESS, Live, NobodyListensError, check_address
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
    from pendmap.diagnosis import Discrepancy
    from pendmap.identification import IdentificationReport
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
    "view",
]

_KINDS = {
    "basin_sweep": (basin_sweep.blueprint, basin_sweep.log),
    "basins": (basins.blueprint, basins.log),
    "trajectory": (trajectory.blueprint, trajectory.log),
}

_OF_RECORDS = {
    "record_discrepancy": "pendmap.viewer.discrepancy",
    "record_identification": "pendmap.viewer.identification",
}

_RECORDS = {
    "Discrepancy": "record_discrepancy",
    "IdentificationReport": "record_identification",
}
"""Functions of results of records, by their type: importing the types takes half a second."""


def __getattr__(name: str) -> Any:  # noqa: ANN401 (functions)
    """Import recordings of records on demand: importing fits takes half a second."""
    if name not in _OF_RECORDS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_OF_RECORDS[name]), name)


def record(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write the recording of a dataset, with the layout in which the viewer shows it.

    Basin map: ``/basin/data/{labels,attractors}``, ``/settle/data/steps``,
    ``/turns/data/turns``, ``/exponent/data/exponent`` (meaningful layers, the leading one in
    front), ``/legend`` and ``/summary``. Sweep: ``/basin/data/{labels,attractors}`` of each model,
    on the timeline of the parameter (of two: ``map``), its chart, ``/legend`` and ``/summary``.
    Closed orbits: ``/phase/data/NUMBER`` with ``path`` and ``points``, ``/legend`` and
    ``/summary``. Map over two parameters: ``/kinds/data/kinds``,
    ``/{exponent,attractors,undecided}/data/values``. Bifurcation diagram:
    ``/{bifurcation,velocity,exponent}/data/NUMBER``. Exponent: ``/growth/data/own``,
    ``/average/data/{own,band,value}`` and ``/distribution/data/density`` or, for a closed orbit,
    ``/exponent/data/{own,value}``, and ``/attractor/data/points``. Lifetime:
    ``/survival/data/NUMBER`` (0: all), ``/survival/data/{tail,band}``,
    ``/tail/data/{mean,error,fitted}`` and ``/legend``. Critical curves:
    ``/tongues/data/{plus,minus,undamped,fold,own}``, also under ``/paper`` in the plane of
    eq. 1.4. Melnikov's criterion: ``/melnikov/data/{forward,backward,own}``. Trajectory:
    ``/state/{theta,omega,energy}``, ``/pendulum/data/{arm,bob,pivot,trail}``,
    ``/phase/data/{curve,now}``, ``/poincare/data/points`` and ``/summary``, on the timelines
    ``sim_time`` (nondimensional time, shown as seconds) and ``period``.

    Parameters
    ----------
    dataset : xarray.Dataset
        Result of ``pendmap.basins``, ``pendmap.sweep``, ``pendmap.orbit``,
        ``pendmap.parameter_map``,
        ``pendmap.bifurcation``, ``pendmap.lyapunov``, ``pendmap.lifetime``, ``pendmap.tongues``,
        ``pendmap.melnikov`` or ``pendmap.simulate``; ``attrs["kind"]`` names the kind. A
        selection is shown with its own cells, as by :func:`pendmap.render.draw`.
    path : str or path
        The file to write, ``.rrd``; an existing one is replaced.

    Returns
    -------
    Path
        The written file.

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
        made = registry.build(dataset, cells=basins.CELLS)
        view, log = chart.blueprint(made), functools.partial(chart.log, chart=made)
    return frame.save(
        path,
        view,
        lambda stream: log(stream, dataset),
        name=": ".join(str(dataset.attrs[k]) for k in ("kind", "title") if k in dataset.attrs),
        content=frame.identifier(dataset),
        known=frame.properties(dataset),
    )


def view(
    result: xr.Dataset | IdentificationReport | Discrepancy | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the Rerun recording of a result, or open it in the viewer.

    Parameters
    ----------
    result : xarray.Dataset, IdentificationReport, Discrepancy or path
        A result of any analysis, of :func:`pendmap.identify` or :func:`pendmap.diagnose`; or a
        recording (.rrd), which is opened.
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
    kind = type(result).__name__
    if isinstance(result, xr.Dataset):
        write: Any = record
    elif kind in _RECORDS:
        write = __getattr__(_RECORDS[kind])
    else:
        raise InputError(
            "result must be a dataset, an identification, a diagnosis or the path of a recording, "
            f"got {short_repr(result)}"
        )
    if path is not None:
        return Path(write(result, path))
    target = Path(tempfile.mkdtemp(prefix="pendmap-")) / "result.rrd"
    write(result, target)
    open_viewer(target)
    return target
