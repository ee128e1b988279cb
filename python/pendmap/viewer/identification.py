"""The recording of an identification: record, model, residual, and both pendulums swinging."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.errors import InputError
from pendmap.files import whole_file
from pendmap.viewer import columns, decay, found, frame
from pendmap.viewer.comparison import Comparison, comparisons

if TYPE_CHECKING:
    import os

    from pendmap.identification import IdentificationReport


def record_identification(report: IdentificationReport, path: str | os.PathLike[str]) -> Path:
    """Write the recording of an identification, with the layout in which the viewer shows it.

    For each run that was fitted, ``k`` from 1: ``/run_k/angle/{record,model,peaks,left_out}``,
    ``/run_k/residual/{residual,above,below}`` (mrad; two standard deviations of the noise about 0),
    two pendulums on one pivot in ``/run_k/pendulum/data/{record,model}/{arm,bob}``, and
    ``/run_k/phase/data/{curve,record,record_now,model_now}``; the tables of what was found in
    ``/summary``; all on the timeline ``sim_time``, the record's own seconds. The model's angle is
    what the sensor would read of it, its zero error included.

    Of a run longer than 20,000 samples every k-th is drawn, unless that leaves fewer than 24 of
    each swing. Where the trajectory was not fitted, the best method's model is simulated from the
    first peak; where no method could be applied, the record is shown alone. The record's pendulum
    stands still where nothing was read: in a gap, or between peaks alone.

    Parameters
    ----------
    report : IdentificationReport
        What :func:`pendmap.identification.identify_experiment` returned.
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
    shown = comparisons(report)
    latest = max(float(np.max(np.abs(one.time), initial=0.0)) for one in shown)
    if latest > columns.LATEST:
        raise InputError(
            f"{report.run.name}: time is {latest:g} s: a recording holds up to {columns.LATEST:g} s"
        )
    w0 = _w0(report)
    with whole_file(path, (".rrd",)) as part, frame.strict():
        content = _content(report, shown)
        # A layout holds for all recordings of an application, and this one has axes of its own.
        recording = frame.identified(content, f"pendmap identification {content[:6]}")
        with frame.written(recording, _blueprint(shown, w0), part):
            _describe(recording, report)
            frame.text(recording, "summary", found.page(report))
            for number, one in enumerate(shown, 1):
                decay.log(recording, f"run_{number}", one, w0)
    return Path(path)


def _w0(report: IdentificationReport) -> float:
    """Return the natural frequency found, 1 where none was: it gives views their proportions."""
    try:
        return float(report.model.w0)
    except InputError:
        return 1.0


def _content(report: IdentificationReport, shown: list[Comparison]) -> str:
    """Return a name that tells what was recorded: other readings or estimates, another name."""
    estimates = [(n, k, e.value) for n, m in report.methods.items() for k, e in m.estimates.items()]
    digest = hashlib.blake2b(repr(estimates).encode(), digest_size=12)
    for one in shown:
        for column in (one.time, one.record, one.model):
            digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()


def _describe(stream: rr.RecordingStream, report: IdentificationReport) -> None:
    """Log the recording's name and, as properties, what the best method found."""
    stream.send_recording_name(f"identification of {Path(report.experiment.path).name}")
    known: dict[str, float | str] = {"kind": "identification"}
    try:
        best = report.best
    except InputError:
        best = None
    if best is not None:
        known["method"] = best.method
        for name, each in best.estimates.items():
            known[name] = float(each.value)
            if each.ci95 is not None:
                known[f"{name}_low"], known[f"{name}_high"] = map(float, each.ci95)
    if report.joint is not None:
        known["rms"] = float(report.joint.fit.rms)
    stream.send_property("pendmap", rr.AnyValues(drop_untyped_nones=True, **known))


def _blueprint(shown: list[Comparison], w0: float) -> rrb.Blueprint:
    """Return the layout: a tab a run, beside it what was found."""
    runs = [decay.views(f"run_{k}", one, w0) for k, one in enumerate(shown, 1)]
    front = runs[0] if len(runs) == 1 else rrb.Tabs(*runs, active_tab=0)
    aside = rrb.TextDocumentView(origin="/summary", name="What was found")
    return frame.screen(front, aside, shares=[5, 2])
