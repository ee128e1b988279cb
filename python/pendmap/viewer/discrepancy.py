"""The recording of a diagnosis: record and both models side by side, what is left, the report."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap import report
from pendmap.charts import diagnosis
from pendmap.errors import InputError
from pendmap.files import whole_file
from pendmap.viewer import beside, chart, columns, frame

if TYPE_CHECKING:
    import os

    from pendmap.diagnosis import Discrepancy
    from pendmap.viewer.beside import Beside

RATIO = 0.56
"""Height of a panel over its width."""


def record_discrepancy(found: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Write the recording of a diagnosis, with the layout in which the viewer shows it.

    For each run, ``k`` from 1, those held out last: three pendulums side by side,
    ``/run_k/pendulum/data/{record,before,after}/{arm,bob}``, the models' deviations from the record
    drawn larger by a factor that the view names; ``/run_k/angle/{record,before,after}`` (rad) and
    ``/run_k/residual/{before,after,above,below}`` (mrad; two standard deviations of the noise about
    0), on the timeline ``sim_time``, the record's own seconds. The torque that both models lack in
    ``/torque/{angle,velocity,amplitude,drive_phase,lab_time}/data/{before,after}``, the error of
    forecasts in ``/forecast/{free,forced}/data/{before,after,noise}``, the report's text in
    ``/summary``.

    Parameters
    ----------
    found : Discrepancy
        What :func:`pendmap.diagnosis.diagnose` returned.
    path : str or path
        The file to write, ``.rrd``; an existing one is replaced.

    Returns
    -------
    Path
        The file, complete.

    Raises
    ------
    InputError
        For an unknown suffix, or times that a recording cannot hold.
    OSError
        If the file cannot be written.
    """
    shown = beside.beside(found)
    latest = max(float(np.max(np.abs(one.time), initial=0.0)) for one in shown)
    if latest > columns.LATEST:
        raise InputError(
            f"{found.data.experiment.path}: time is {latest:g} s: a recording holds up to "
            f"{columns.LATEST:g} s"
        )
    larger = beside.magnified(shown)
    panels = [chart.Place.of(panel, RATIO) for panel in diagnosis.recorded(found)]
    with whole_file(path, (".rrd",)) as part, frame.strict():
        content = _content(found, shown)
        # A layout holds for all recordings of an application, and this one has runs of its own.
        recording = frame.identified(content, f"pendmap diagnosis {content[:6]}")
        with frame.written(recording, _blueprint(shown, larger, panels), part):
            _describe(recording, found, larger)
            frame.text(recording, "summary", report.as_markdown(report.diagnosis(found), {}))
            for number, one in enumerate(shown, 1):
                beside.log(recording, f"run_{number}", one, larger)
            for place in panels:
                chart.log_panel(recording, place)
    return Path(path)


def _content(found: Discrepancy, shown: list[Beside]) -> str:
    """Return a name that tells what was recorded: other readings or models, another name."""
    estimates = [(n, e.value) for n, e in found.best.fitted.fit.estimates.items()]
    digest = hashlib.blake2b(repr((found.verdict, estimates)).encode(), digest_size=12)
    for one in shown:
        for column in (one.time, one.record, one.before, one.after):
            digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()


def _describe(stream: rr.RecordingStream, found: Discrepancy, larger: float) -> None:
    """Log the recording's name and, as properties, verdict, effects and gap."""
    stream.send_recording_name(f"diagnosis of {Path(found.data.experiment.path).name}")
    gap = found.gap
    known: dict[str, float | str] = {
        "kind": "diagnosis",
        "verdict": found.verdict,
        "effects": ", ".join(effect.name for effect in found.effects),
        "noise_floor": gap.noise_floor,
        "before": gap.before,
        "after": gap.after,
        "held_out_before": gap.held_out_before,
        "held_out_after": gap.held_out_after,
        "deviations_drawn_larger": larger,
    }
    stream.send_property("pendmap", rr.AnyValues(drop_untyped_nones=True, **known))


def _blueprint(shown: list[Beside], larger: float, panels: list[chart.Place]) -> rrb.Blueprint:
    """Return the layout: a tab a run and one of the panels, beside them the report."""
    runs = [beside.views(f"run_{k}", one, larger) for k, one in enumerate(shown, 1)]
    grid = rrb.Grid(
        *(place.frame.view(place.panel.where, place.panel.title) for place in panels),
        grid_columns=2,
        name="Gap",
    )
    front = rrb.Tabs(*runs, *([grid] if panels else []), active_tab=_worst(shown))
    aside = rrb.TextDocumentView(origin="/summary", name="Report")
    return frame.screen(front, aside, shares=[5, 3])


def _worst(shown: list[Beside]) -> int:
    """Return the run that the baseline misses most: it lies in front."""
    sizes = [
        float(np.sqrt(np.nanmean(one.before**2))) / one.sigma
        if np.isfinite(one.before).any()
        else 0
        for one in shown
    ]
    return int(np.argmax(sizes))
