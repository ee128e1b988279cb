"""Recordings for the Rerun viewer; the only place that imports rerun.

``record`` looks at what a dataset holds and writes its recording, ``record_identification`` writes
that of what was found in records, ``record_discrepancy`` that of what a model lacks;
``open_viewer`` shows one; ``Live`` sends a trajectory to a running viewer while it is computed.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pendmap.errors import InputError
from pendmap.files import whole_file
from pendmap.pictures.layers import refuse_lists
from pendmap.viewer import basins, frame, orbits, trajectory
from pendmap.viewer.discrepancy import record_discrepancy
from pendmap.viewer.identification import record_identification
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

SUFFIXES = (".rrd",)
"""The kind of file a recording is."""

_KINDS = {
    "basins": (basins.blueprint, basins.log),
    "orbits": (orbits.blueprint, orbits.log),
    "trajectory": (trajectory.blueprint, trajectory.log),
}


def record(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write the recording of a dataset, with the layout in which the viewer shows it.

    Of a basin map: ``/basin/data/{labels,attractors}``, ``/settle/data/steps``,
    ``/turns/data/turns``, ``/exponent/data/exponent`` (those layers that tell something, the
    leading one in front), ``/legend`` and ``/summary``. Of closed orbits: ``/phase/data/NUMBER``
    with ``path`` and ``points``, ``/legend`` and ``/summary``. Of a trajectory:
    ``/state/{theta,omega,energy}``, ``/pendulum/data/{arm,bob,pivot,trail}``,
    ``/phase/data/{curve,now}``, ``/poincare/data/points`` and ``/summary``, on the timelines
    ``sim_time`` (nondimensional time, shown as seconds) and ``period``.

    Parameters
    ----------
    dataset : xarray.Dataset
        What ``pendmap.basins``, ``pendmap.orbit`` or ``pendmap.simulate`` returned;
        ``attrs["kind"]`` tells which.
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
    OSError
        If the file cannot be written.
    """
    kind = dataset.attrs.get("kind")
    if kind not in _KINDS:
        known = ", ".join(_KINDS)
        raise InputError(f"cannot record a dataset of kind {kind!r}; kinds that can be: {known}")
    refuse_lists(dataset)
    layout, log = _KINDS[kind]
    with whole_file(path, SUFFIXES) as part, frame.strict():
        recording = frame.recording(dataset)
        try:
            with recording:
                recording.save(part, default_blueprint=layout(dataset))
                frame.describe(recording, dataset)
                log(recording, dataset)
        finally:
            recording.disconnect()
    return Path(path)
