"""Recording of an identification: record, model, residual, and both pendulums in motion."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import names, plane
from pendmap.errors import InputError
from pendmap.formatting import counted, interval, written
from pendmap.identification.report import as_text
from pendmap.model.labels import unit_of
from pendmap.units import Units
from pendmap.viewer import columns, frame, runs
from pendmap.viewer.columns import Look
from pendmap.viewer.comparison import Comparison, comparisons
from pendmap.viewer.runs import Series

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from pendmap.identification import Estimate, IdentificationReport


# The model is drawn broad with the thin record on top, so that both remain visible.
RECORD: Final = Series("record", (230, 159, 0), 1.2)
MODEL: Final = Series("model", (0, 114, 178), 4.0)
PEAKS: Final = Series("peaks", (213, 94, 0))
RESIDUAL: Final = Series("record less model", (0, 158, 115))
LEFT_OUT: Final = Series("not for fitting", (204, 121, 167))
THIN, BROAD = (1.5, 7.0, 3.0), (4.5, 13.0, 1.0)
"""Radii of arm and bob, in screen points, and drawing order, of the record and of the model."""
CLOSE: Final = 4.0  # Half width of the close view about the cursor, swings
SMALL, MARGIN = 2.0, 1.15
"""Amplitude below which the phase plane is enlarged, rad, and its width over the amplitude."""
REACH: Final = 1.15  # Half width of the view of the pendulums, arm lengths
COMPARED: Final = ("w0", "c_over_m", "Tr")  # Parameters in which all methods are compared


def record_identification(report: IdentificationReport, path: str | os.PathLike[str]) -> Path:
    """Write the recording of an identification, with the layout in which the viewer shows it.

    For each fitted run, ``k`` from 1: ``/run_k/angle/{record,model,peaks,left_out}``,
    ``/run_k/residual/{residual,above,below}`` (mrad; two standard deviations of the noise about 0),
    two pendulums on one pivot in ``/run_k/pendulum/data/{record,model}/{arm,bob}``, and
    ``/run_k/phase/data/{curve,record,record_now,model_now}``; tables of the estimates in
    ``/summary``; all on the timeline ``sim_time``, the record's own seconds. The model's angle
    includes the sensor's zero error.

    In a run longer than 20,000 samples every k-th is drawn, unless fewer than 24 of each swing
    would remain. If the trajectory was not fitted, the best method's model is simulated from the
    first peak; if no method is applicable, the record is shown alone. The record's pendulum does
    not move between readings: in a gap, or between peaks alone.

    Parameters
    ----------
    report : IdentificationReport
        Result of :func:`pendmap.identify`.
    path : str or path
        The file to write, ``.rrd``; an existing one is replaced.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown suffix, or times that a recording cannot hold.
    OSError
        If the file cannot be written.
    """
    shown = comparisons(report)
    runs.refuse_late(report.run.name, (one.time for one in shown))
    try:
        w0 = float(report.model.w0)
    except InputError:
        w0 = 1.0  # only sets the proportions of views
    tabs = [_views(f"run_{k}", one, w0) for k, one in enumerate(shown, 1)]
    front = tabs[0] if len(tabs) == 1 else rrb.Tabs(*tabs, active_tab=0)
    aside = rrb.TextDocumentView(origin="/summary", name="What was found")
    estimates = [(n, k, e.value) for n, m in report.methods.items() for k, e in m.estimates.items()]

    def log(stream: rr.RecordingStream) -> None:
        frame.text(stream, "summary", "\n".join(_page(report)))
        for number, one in enumerate(shown, 1):
            _log(stream, f"run_{number}", one, w0)

    return frame.save(
        path,
        frame.screen(front, aside, shares=[5, 2]),
        log,
        name=f"identification of {Path(report.experiment.path).name}",
        content=runs.content_of(
            estimates, (a for one in shown for a in (one.time, one.record, one.model))
        ),
        known=_known(report),
        own_layout=True,
    )


def _known(report: IdentificationReport) -> dict[str, float | str]:
    """Return the properties of a recording: the estimates of the best method."""
    known: dict[str, float | str] = {"kind": "identification"}
    best = report.sound
    if best is not None:
        known["method"] = best.method
        for name, each in best.estimates.items():
            known[name] = float(each.value)
            if each.ci95 is not None:
                known[f"{name}_low"], known[f"{name}_high"] = map(float, each.ci95)
    if report.joint is not None:
        known["rms"] = float(report.joint.fit.rms)
    return known


def _page(report: IdentificationReport) -> Iterator[str]:
    """Yield tables of the estimates with intervals, and all warnings."""
    best = report.sound
    if best is None:
        yield from ("**No method could be applied.**", "")
    else:
        yield from (f"## By {best.method.replace('_', ' ')}", "")
        yield from ("| parameter | value | 95 % interval | unit |", "|---|---|---|---|")
        for name, each in {**best.estimates, **best.derived}.items():
            yield f"| {name} | {_cells(each)} | {report.unit(name)} |"
    if report.joint is not None and report.joint.fit.rms:
        fit = report.joint.fit
        noise = ", ".join(f"{reading.sigma:.3g}" for reading in report.joint.readings)
        readings = counted(fit.samples, "reading")
        yield ""
        yield (
            f"Residuals: {fit.rms:.3g} rad rms in {readings}; noise seen without a model: "
            f"{noise} rad."
        )
    # One table per parameter: a single one would be too wide for a column of the window.
    for parameter in COMPARED:
        known = {n: m.estimates for n, m in report.methods.items() if parameter in m.estimates}
        if known:
            yield from ("", f"## {parameter} ({unit_of(parameter)}) by each method", "")
            yield from ("| method | value | 95 % interval |", "|---|---|---|")
            for method, estimates in known.items():
                yield f"| {method.replace('_', ' ')} | {_cells(estimates[parameter])} |"
    yield from ("", "## Warnings, and the record", "")
    # The lines of the estimates are already in the tables.
    yield from (f"- {line}" for line in as_text(report) if not line.startswith(" "))


def _cells(each: Estimate) -> str:
    return f"{written(each.value, each.stderr or 0.0)} | {interval(each)}"


def _views(root: str, one: Comparison, w0: float) -> rrb.Container:
    """Return the views of a run: pendulums and phase plane left; angle and residual right."""
    bounds = rrb.VisualBounds2D(x_range=[-REACH, REACH], y_range=[-REACH, REACH + 0.35])
    pendulums = rrb.Spatial2DView(
        origin=f"/{root}/pendulum",
        name="Record and model" if one.model.size else "Record",
        visual_bounds=bounds,
    )
    left: list[rrb.View] = [pendulums, _frame(one, w0).view(f"{root}/phase", "Phase plane")]
    around = CLOSE * math.tau / w0
    close = rrb.VisibleTimeRange(
        frame.TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-around),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=around),
    )
    right: list[rrb.View] = [
        runs.view(f"{root}/angle", f"{names.ANGLE}, {one.name}", axis_x=_whole(one)),
        runs.view(f"{root}/angle", f"{names.ANGLE}, near the cursor", time_ranges=[close]),
    ]
    if np.isfinite(one.residual).any():
        # The axis contains the residuals used and the band of the noise.
        least = max(1.5 * runs.BAND * one.sigma, 1e-12)
        reach = 1.05 * runs.MILLI * max(float(np.nanmax(np.abs(one.residual))), least)
        axes = {"axis_x": _whole(one), "axis_y": rrb.ScalarAxis(range=(-reach, reach))}
        right.append(runs.view(f"{root}/residual", "Record less model (mrad)", **axes))
    return rrb.Horizontal(
        rrb.Vertical(*left), rrb.Vertical(*right), column_shares=[3, 4], name=one.name
    )


def _whole(one: Comparison) -> rrb.TimeAxis:
    """Return a time axis that contains the whole record."""
    if not one.time.size:
        return rrb.TimeAxis()
    low, high = float(one.time[0]), float(one.time[-1])
    pad = max(0.02 * (high - low), 1e-3)
    ends = (rr.TimeRangeBoundary.absolute(seconds=at) for at in (low - pad, high + pad))
    return rrb.TimeAxis(view_range=rr.TimeRange(*ends))


def _frame(one: Comparison, w0: float) -> frame.Frame:
    """Return a frame with record and model: the whole circle, or small swings enlarged."""
    known = np.isfinite(one.record) & ~one.left_out
    theta = np.concatenate([one.record[known], one.model[np.isfinite(one.model)]])
    speed = np.concatenate([one.speed[known], one.model_speed])
    widest = float(np.max(np.abs(plane.wrapped(theta)), initial=0.0))
    reach = math.pi if not 0 < widest < SMALL else MARGIN * widest
    speeds = speed[np.isfinite(speed)]
    speeds = plane.padded(speeds if speeds.size else np.zeros(1))
    return frame.Frame.phase((-reach, reach), speeds, Units(w0, si=True))


def _log(stream: rr.RecordingStream, root: str, one: Comparison, w0: float) -> None:
    """Log one run: angles and peaks, the residual with the noise, pendulums, the phase plane."""
    out, angle, left = one.left_out, f"{root}/angle", f"{root}/residual"
    record = replace(RECORD, width=0.0) if one.sparse else RECORD
    runs.series(stream, f"{angle}/model", one.model_time, one.model, MODEL)
    runs.series(stream, f"{angle}/record", one.time, one.record, record)
    if not one.sparse:
        runs.series(stream, f"{angle}/peaks", one.peaks.time, one.peaks.amplitude, PEAKS)
    runs.series(stream, f"{angle}/left_out", one.time[out], one.record[out], LEFT_OUT)
    known = np.isfinite(one.residual)
    look = RESIDUAL if one.sparse else replace(RESIDUAL, size=1.0)
    runs.residual(stream, f"{left}/residual", one.time[known], one.residual[known], look)
    if known.any() and one.sigma:
        runs.noise(stream, left, one.time, one.sigma)
    _pendulums(stream, f"{root}/pendulum", one)
    _frame(one, w0).log(stream, f"{root}/phase")
    _phase(stream, f"{root}/phase/data", one)


def _pendulums(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log both pendulums on one pivot: the model broad, the record thin on top."""
    runs.pivots(stream, path, [0.0])
    parts = [(RECORD, one.time, one.record, THIN)]
    if one.model.size:
        parts.append((MODEL, one.model_time, one.model, BROAD))
    for look, time, theta, size in parts:
        runs.pendulum(stream, f"{path}/data/{look.name}", time, theta, look, size)
    places = [(REACH * x, REACH + 0.1) for x in (-0.5, 0.5)][: len(parts)]
    named = [(look.name, look.colour) for look, *_ in parts]
    bobs = [bob for *_, (_, bob, _) in parts]
    frame.legend(stream, f"{path}/axes/legend", places, named, size=bobs, below=0.05)


def _phase(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log the model's whole curve, the record's points, and the moving points of both."""
    known = np.isfinite(one.record) & np.isfinite(one.speed) & ~one.left_out
    places = np.stack([plane.wrapped(one.record[known]), one.speed[known]], axis=1)
    if known.any():
        small = rr.Radius.ui_points(2.5 if one.sparse else 0.7)
        spots = rr.Points2D(places.astype(np.float32), colors=[RECORD.colour], radii=small)
        stream.log(f"{path}/record", spots, static=True)
        now = Look(RECORD.colour, 5.0, 42.0)
        columns.points(stream, f"{path}/record_now", one.time[known], places, now)
    if not one.model.size:
        return
    there = np.isfinite(one.model)
    curve = plane.broken_at_wrap(one.model[there], one.model_speed[there]).astype(np.float32)
    lines = rr.LineStrips2D([curve], colors=[MODEL.colour], radii=rr.Radius.ui_points(1.0))
    stream.log(f"{path}/curve", lines, static=True)
    at = np.stack([plane.wrapped(one.model[there]), one.model_speed[there]], axis=1)
    now = Look(MODEL.colour, 8.0, 41.0)
    columns.points(stream, f"{path}/model_now", one.model_time[there], at, now)
