"""Recordings for the Rerun viewer; the only package that imports rerun.

``record`` writes the recording of a result, ``view`` writes it or opens it; ``open_viewer`` shows a
recording; ``Live`` sends a trajectory to a running viewer during its computation.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import xarray as xr

from pendmap.charts import registry
from pendmap.errors import InputError, MissingExtraError, short_repr
from pendmap.errors import ViewerError as ViewerError

try:
    from pendmap.viewer import chart, recording
    from pendmap.viewer.live import ADDRESS as ADDRESS
    from pendmap.viewer.live import Live as Live
    from pendmap.viewer.live import NobodyListensError as NobodyListensError
    from pendmap.viewer.live import check_address as check_address
    from pendmap.viewer.recording import SUFFIXES as SUFFIXES
    from pendmap.viewer.window import NoDisplayError as NoDisplayError
    from pendmap.viewer.window import NotARecordingError as NotARecordingError
    from pendmap.viewer.window import RecordingNotFoundError as RecordingNotFoundError
    from pendmap.viewer.window import check_display as check_display
    from pendmap.viewer.window import open_viewer as open_viewer
except ModuleNotFoundError as error:
    text = f"recordings and the viewer need the extra pendmap[viewer] ({error})"
    raise MissingExtraError(text) from error


def record(
    result: Any,  # noqa: ANN401 (a dataset, records, or what was found in records)
    path: str | os.PathLike[str],
) -> Path:
    """Write the recording of a result, with the layout in which the viewer shows it.

    It has every panel of the result's chart; what moves in time is in docs/files.md.
    """
    if isinstance(result, xr.Dataset):
        made = chart.contents(registry.ready(result, "record"))
    elif type(result).__name__ in registry.RESULTS:
        from pendmap.viewer import runs  # noqa: PLC0415 (importing fits takes half a second)

        made = runs.contents(result)
    else:
        raise InputError(
            "result must be a dataset, records, an identification, a comparison or a diagnosis, "
            f"got {short_repr(result)}"
        )
    return recording.save(path, **made)


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
