"""The recording of an identification: record, model, residual, and both pendulums swinging."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.errors import InputError
from pendmap.files import whole_file
from pendmap.model.units import Units
from pendmap.pictures import names, plane
from pendmap.viewer import columns, found, frame
from pendmap.viewer.columns import Look
from pendmap.viewer.comparison import Comparison, comparisons

if TYPE_CHECKING:
    import os

    from pendmap.identification import IdentificationReport

__all__ = ["record_identification"]

Floats = npt.NDArray[np.float64]
Colour = tuple[int, int, int]

RECORD: Final = (230, 159, 0)
MODEL: Final = (0, 114, 178)
PEAKS: Final = (213, 94, 0)
RESIDUAL: Final = (0, 158, 115)
LEFT_OUT: Final = (204, 121, 167)

BAND: Final = 2.0
"""Half the width of the band that noise alone would fill, in standard deviations."""

CLOSE: Final = 4.0
"""Swings that the close view shows on either side of the cursor."""

REACH: Final = 1.3
"""Half the width of the view of the pendulums, in lengths of the arm."""


def record_identification(report: IdentificationReport, path: str | os.PathLike[str]) -> Path:
    """Write the recording of an identification, with the layout in which the viewer shows it.

    For each run that was fitted, ``k`` from 1: ``/run_k/angle/{record,model,peaks,left_out}``,
    ``/run_k/residual/{residual,above,below}`` (the noise's 2 standard deviations), the two
    pendulums on one pivot in ``/run_k/pendulum/data/{record,model}/{arm,bob}``, and
    ``/run_k/phase/data/{curve,record,record_now,model_now}``; the tables of what was found in
    ``/summary``; all on the timeline ``sim_time``, the record's own seconds. Of a run longer than
    20,000 samples every k-th is drawn, unless that leaves fewer than 24 of each swing. Where the
    whole record was not fitted, the best method's model is simulated from the first peak; where no
    method could be applied, the record is shown alone.

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
        recording = frame.identified(_content(report, shown))
        try:
            with recording:
                recording.save(part, default_blueprint=_blueprint(shown, w0))
                _describe(recording, report)
                frame.text(recording, "summary", found.page(report))
                for number, one in enumerate(shown, 1):
                    _log(recording, f"run_{number}", one, w0)
        finally:
            recording.disconnect()
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
    runs = [_run_views(f"run_{k}", one, w0) for k, one in enumerate(shown, 1)]
    front = runs[0] if len(runs) == 1 else rrb.Tabs(*runs, active_tab=0)
    aside = rrb.TextDocumentView(origin="/summary", name="What was found")
    return frame.screen(front, aside, shares=[5, 2])


def _run_views(root: str, one: Comparison, w0: float) -> rrb.Container:
    """Return the views of a run: pendulums and phase plane left; angle and residual right."""
    modelled = one.model.size > 0
    pendulums = rrb.Spatial2DView(
        origin=f"/{root}/pendulum",
        name="Record and model" if modelled else "Record",
        visual_bounds=rrb.VisualBounds2D(x_range=[-REACH, REACH], y_range=[-REACH, REACH + 0.3]),
    )
    left: list[rrb.View] = [pendulums, _frame(one, w0).view(f"{root}/phase", "Phase plane")]
    around = CLOSE * math.tau / w0
    close = rrb.VisibleTimeRange(
        frame.TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-around),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=around),
    )
    right: list[rrb.View] = [
        rrb.TimeSeriesView(origin=f"/{root}/angle", name=f"{names.ANGLE}, {one.name}"),
        rrb.TimeSeriesView(
            origin=f"/{root}/angle", name=f"{names.ANGLE}, near the cursor", time_ranges=[close]
        ),
    ]
    if np.isfinite(one.residual).any():
        right.append(
            rrb.TimeSeriesView(
                origin=f"/{root}/residual", name="Record less model (rad)", axis_y=_scale(one)
            )
        )
    return rrb.Horizontal(
        rrb.Vertical(*left), rrb.Vertical(*right), column_shares=[2, 3], name=one.name
    )


def _scale(one: Comparison) -> rrb.ScalarAxis:
    """Return an axis that holds the residuals that count and the noise's band."""
    reach = max(float(np.nanmax(np.abs(one.residual))), 1.5 * BAND * one.sigma, 1e-12)
    return rrb.ScalarAxis(range=(-1.05 * reach, 1.05 * reach), zoom_lock=False)


def _frame(one: Comparison, w0: float) -> frame.Frame:
    speeds = one.model_speed if one.model.size else one.speed
    speeds = speeds[np.isfinite(speeds)]
    return frame.Frame(
        (-math.pi, math.pi),
        plane.padded(speeds if speeds.size else np.zeros(1)),
        Units(w0, si=True),
    )


def _log(stream: rr.RecordingStream, root: str, one: Comparison, w0: float) -> None:
    """Log one run."""
    _angle(stream, f"{root}/angle", one)
    _residual(stream, f"{root}/residual", one)
    _pendulums(stream, f"{root}/pendulum", one)
    _frame(one, w0).log(stream, f"{root}/phase")
    _phase(stream, f"{root}/phase/data", one)


def _line(
    stream: rr.RecordingStream, path: str, time: Floats, values: Floats, name: str, colour: Colour
) -> None:
    style = rr.SeriesLines(colors=[colour], names=[name], widths=[1.5])
    stream.log(path, style, static=True)
    stream.send_columns(path, [columns.at(time)], rr.Scalars.columns(scalars=values))


def _marks(
    stream: rr.RecordingStream, path: str, time: Floats, values: Floats, name: str, colour: Colour
) -> None:
    if time.size:
        style = rr.SeriesPoints(colors=[colour], names=[name], marker_sizes=[3.0])
        stream.log(path, style, static=True)
        stream.send_columns(path, [columns.at(time)], rr.Scalars.columns(scalars=values))


def _angle(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log both angles, the model's upon the record's, with the peaks and what is not for fitting."""
    draw = _marks if one.sparse else _line
    draw(stream, f"{path}/record", one.time, one.record, "record", RECORD)
    if one.model.size:
        _line(stream, f"{path}/model", one.model_time, one.model, "model", MODEL)
    if not one.sparse:
        _marks(stream, f"{path}/peaks", one.peaks.time, one.peaks.amplitude, "peaks", PEAKS)
    out = one.left_out
    _marks(stream, f"{path}/left_out", one.time[out], one.record[out], "not for fitting", LEFT_OUT)


def _residual(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log what is left, and the lines between which noise alone would leave 95 % of it."""
    if not np.isfinite(one.residual).any():
        return
    draw = _marks if one.sparse else _line
    draw(stream, f"{path}/residual", one.time, one.residual, "record less model", RESIDUAL)
    ends = one.time[[0, -1]]
    for name, sign in (("above", 1), ("below", -1)) if one.sigma else ():
        band = np.full(2, sign * BAND * one.sigma)
        text = f"{'+' if sign > 0 else chr(0x2212)}{BAND:g} sigma of the noise"
        _line(stream, f"{path}/{name}", ends, band, text, frame.INK)


def _pendulums(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log both pendulums on one pivot: the record's thick, the model's thin and upon it."""
    turned = rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0]))
    stream.log(f"{path}/data", turned, static=True)
    parts = [("record", one.time, one.record, RECORD, (4.5, 13.0), 1.0)]
    if one.model.size:
        parts.append(("model", one.model_time, one.model, MODEL, (1.5, 7.0), 3.0))
    for name, time, theta, colour, (arm, bob), order in parts:
        there = np.isfinite(theta)
        at = np.stack([np.sin(theta), -np.cos(theta)], axis=1)[there]
        lines = np.stack([np.zeros_like(at), at], axis=1)
        root = f"{path}/data/{name}"
        columns.strips(stream, f"{root}/arm", time[there], lines, Look(colour, arm, order))
        columns.points(stream, f"{root}/bob", time[there], at, Look(colour, bob, order + 1))
    pivot = rr.Points2D([[0.0, 0.0]], colors=[frame.INK], radii=rr.Radius.ui_points(3.0))
    stream.log(f"{path}/data/pivot", pivot, static=True)
    places = [[REACH * x, REACH + 0.05] for x in (-0.5, 0.5)][: len(parts)]
    legend = rr.Points2D(
        places,
        colors=[part[3] for part in parts],
        radii=rr.Radius.ui_points([part[4][1] for part in parts]),
    )
    stream.log(f"{path}/axes/legend", legend, static=True)
    below = [[x, y + 0.05] for x, y in places]
    frame.write(stream, f"{path}/axes/legend/names", below, [part[0] for part in parts])


def _phase(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log the model's whole curve, the record's points, and the points that run along both."""
    known = np.isfinite(one.record) & np.isfinite(one.speed) & ~one.left_out
    places = np.stack([plane.wrapped(one.record[known]), one.speed[known]], axis=1)
    if known.any():
        small = rr.Radius.ui_points(2.5 if one.sparse else 1.0)
        spots = rr.Points2D(places.astype(np.float32), colors=[RECORD], radii=small)
        stream.log(f"{path}/record", spots, static=True)
        now = Look(RECORD, 8.0, 41.0)
        columns.points(stream, f"{path}/record_now", one.time[known], places, now)
    if not one.model.size:
        return
    there = np.isfinite(one.model)
    curve = plane.broken_at_wrap(one.model[there], one.model_speed[there]).astype(np.float32)
    lines = rr.LineStrips2D([curve], colors=[MODEL], radii=rr.Radius.ui_points(0.6))
    stream.log(f"{path}/curve", lines, static=True)
    at = np.stack([plane.wrapped(one.model[there]), one.model_speed[there]], axis=1)
    columns.points(stream, f"{path}/model_now", one.model_time[there], at, Look(MODEL, 5.0, 42.0))
