"""One run in the recording of an identification: its entities, and the views of them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import names, plane
from pendmap.units import Units
from pendmap.viewer import columns, frame, series
from pendmap.viewer.columns import Look
from pendmap.viewer.series import Series

if TYPE_CHECKING:
    from pendmap.viewer.comparison import Comparison

Floats = npt.NDArray[np.float64]

# The model is drawn broad, and the record thin upon it: so both are seen where they agree.
RECORD: Final = Series("record", (230, 159, 0), 1.2)
MODEL: Final = Series("model", (0, 114, 178), 4.0)
PEAKS: Final = Series("peaks", (213, 94, 0))
RESIDUAL: Final = Series("record less model", (0, 158, 115))
LEFT_OUT: Final = Series("not for fitting", (204, 121, 167))

MINUS, SIGMA = "\N{MINUS SIGN}", "\N{GREEK SMALL LETTER SIGMA}"

BAND: Final = 2.0
"""Half the width of the band that noise alone would fill, in standard deviations."""

MILLI: Final = 1e3
"""Residuals are in mrad: the axis would have too many digits otherwise."""

LEGEND: Final = rrb.Corner2D.RightTop
"""A decay leaves room there."""

CLOSE: Final = 4.0
"""Swings that the close view shows on either side of the cursor."""

SMALL, MARGIN = 2.0, 1.15
"""Swings under the first, rad, get a phase plane that is wider than they are by the second."""

REACH: Final = 1.15
"""Half the width of the view of the pendulums, in lengths of the arm."""


def views(root: str, one: Comparison, w0: float) -> rrb.Container:
    """Return the views of a run: pendulums and phase plane left; angle and residual right."""
    modelled = one.model.size > 0
    pendulums = rrb.Spatial2DView(
        origin=f"/{root}/pendulum",
        name="Record and model" if modelled else "Record",
        visual_bounds=rrb.VisualBounds2D(x_range=[-REACH, REACH], y_range=[-REACH, REACH + 0.35]),
    )
    left: list[rrb.View] = [pendulums, _frame(one, w0).view(f"{root}/phase", "Phase plane")]
    around = CLOSE * math.tau / w0
    close = rrb.VisibleTimeRange(
        frame.TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-around),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=around),
    )
    right: list[rrb.View] = [
        rrb.TimeSeriesView(
            origin=f"/{root}/angle",
            name=f"{names.ANGLE}, {one.name}",
            axis_x=_whole(one),
            plot_legend=LEGEND,
        ),
        rrb.TimeSeriesView(
            origin=f"/{root}/angle",
            name=f"{names.ANGLE}, near the cursor",
            time_ranges=[close],
            plot_legend=LEGEND,
        ),
    ]
    if np.isfinite(one.residual).any():
        right.append(
            rrb.TimeSeriesView(
                origin=f"/{root}/residual",
                name="Record less model (mrad)",
                axis_x=_whole(one),
                plot_legend=LEGEND,
                axis_y=_scale(one),
            )
        )
    return rrb.Horizontal(
        rrb.Vertical(*left), rrb.Vertical(*right), column_shares=[3, 4], name=one.name
    )


def _whole(one: Comparison) -> rrb.TimeAxis:
    """Return an axis that holds the whole record."""
    if not one.time.size:
        return rrb.TimeAxis()
    low, high = float(one.time[0]), float(one.time[-1])
    pad = max(0.02 * (high - low), 1e-3)
    ends = (rr.TimeRangeBoundary.absolute(seconds=at) for at in (low - pad, high + pad))
    return rrb.TimeAxis(view_range=rr.TimeRange(*ends))


def _scale(one: Comparison) -> rrb.ScalarAxis:
    """Return an axis that holds the residuals that count and the noise's band."""
    reach = MILLI * max(float(np.nanmax(np.abs(one.residual))), 1.5 * BAND * one.sigma, 1e-12)
    return rrb.ScalarAxis(range=(-1.05 * reach, 1.05 * reach))


def _frame(one: Comparison, w0: float) -> frame.Frame:
    """Return a frame that holds record and model: the whole circle, or small swings enlarged."""
    known = np.isfinite(one.record) & ~one.left_out
    theta = np.concatenate([one.record[known], one.model[np.isfinite(one.model)]])
    speed = np.concatenate([one.speed[known], one.model_speed])
    widest = float(np.max(np.abs(plane.wrapped(theta)), initial=0.0))
    reach = math.pi if not 0 < widest < SMALL else MARGIN * widest
    speeds = speed[np.isfinite(speed)]
    speeds = plane.padded(speeds if speeds.size else np.zeros(1))
    return frame.Frame.phase((-reach, reach), speeds, Units(w0, si=True))


def log(stream: rr.RecordingStream, root: str, one: Comparison, w0: float) -> None:
    """Log one run."""
    _angle(stream, f"{root}/angle", one)
    _residual(stream, f"{root}/residual", one)
    _pendulums(stream, f"{root}/pendulum", one)
    _frame(one, w0).log(stream, f"{root}/phase")
    _phase(stream, f"{root}/phase/data", one)


def _angle(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log both angles, the peaks, and what is not for fitting."""
    record = replace(RECORD, width=0.0) if one.sparse else RECORD
    series.log(stream, f"{path}/model", one.model_time, one.model, MODEL)
    series.log(stream, f"{path}/record", one.time, one.record, record)
    if not one.sparse:
        series.log(stream, f"{path}/peaks", one.peaks.time, one.peaks.amplitude, PEAKS)
    out = one.left_out
    series.log(stream, f"{path}/left_out", one.time[out], one.record[out], LEFT_OUT)


def _residual(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log what is left, and the lines between which noise alone would leave 95 % of it."""
    if not np.isfinite(one.residual).any():
        return
    known = np.isfinite(one.residual)
    rms = MILLI * math.sqrt(float(np.mean(one.residual[known] ** 2)))
    name = f"{RESIDUAL.name}, {rms:.3g} mrad rms"
    look = replace(RESIDUAL, name=name, size=RESIDUAL.size if one.sparse else 1.0)
    series.log(stream, f"{path}/residual", one.time[known], MILLI * one.residual[known], look)
    ends = one.time[[0, -1]]
    for name, sign, said in (("above", 1, "+"), ("below", -1, MINUS)) if one.sigma else ():
        band = np.full(2, MILLI * sign * BAND * one.sigma)
        text = f"{said}{BAND:g} {SIGMA} of the noise, {said}{abs(band[0]):.3g} mrad"
        line = Series(text, frame.INK, 1.5)
        series.log(stream, f"{path}/{name}", ends, band, line)


def _pendulums(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log both pendulums on one pivot: the model's broad, the record's thin and upon it."""
    turned = rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0]))
    stream.log(f"{path}/data", turned, static=True)
    parts = [(RECORD, one.time, one.record, (1.5, 7.0), 3.0)]
    if one.model.size:
        parts.append((MODEL, one.model_time, one.model, (4.5, 13.0), 1.0))
    for look, time, theta, (arm, bob), order in parts:
        there = np.isfinite(theta)
        at = np.stack([np.sin(theta), -np.cos(theta)], axis=1)[there]
        lines = np.stack([np.zeros_like(at), at], axis=1)
        root, colour = f"{path}/data/{look.name}", look.colour
        columns.strips(stream, f"{root}/arm", time[there], lines, Look(colour, arm, order))
        columns.points(stream, f"{root}/bob", time[there], at, Look(colour, bob, order + 1))
    pivot = rr.Points2D([[0.0, 0.0]], colors=[frame.INK], radii=rr.Radius.ui_points(3.0))
    stream.log(f"{path}/axes/pivot", pivot, static=True)
    places = [[REACH * x, REACH + 0.1] for x in (-0.5, 0.5)][: len(parts)]
    legend = rr.Points2D(
        places,
        colors=[part[0].colour for part in parts],
        radii=rr.Radius.ui_points([part[3][1] for part in parts]),
    )
    stream.log(f"{path}/axes/legend", legend, static=True)
    below = [[x, y + 0.05] for x, y in places]
    frame.write(stream, f"{path}/axes/legend/names", below, [part[0].name for part in parts])


def _phase(stream: rr.RecordingStream, path: str, one: Comparison) -> None:
    """Log the model's whole curve, the record's points, and the points that run along both."""
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
    columns.points(
        stream, f"{path}/model_now", one.model_time[there], at, Look(MODEL.colour, 8.0, 41.0)
    )
