"""Recordings of runs: time series, residuals with the noise, moving pendulums."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.errors import InputError
from pendmap.formatting import MINUS
from pendmap.viewer import columns, frame
from pendmap.viewer.columns import Look

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pendmap.charts.marks import Floats

SIGMA = "\N{GREEK SMALL LETTER SIGMA}"
BAND: Final = 2.0  # Half width of the band of noise, standard deviations
MILLI: Final = 1e3  # Residuals are in mrad, which needs fewer digits on the axis
LEGEND: Final = rrb.Corner2D.RightTop  # Corner of a legend, which a decay leaves free


@dataclass(frozen=True)
class Series:
    """Name and colour of a time series; lines have a width, points a size."""

    name: str
    colour: tuple[int, int, int]
    width: float = 0.0
    size: float = 3.0


def content_of(found: object, arrays: Iterable[Floats]) -> str:
    """Return an identifier of the recorded content, which changes with readings and estimates."""
    digest = hashlib.blake2b(repr(found).encode(), digest_size=12)
    for each in arrays:
        digest.update(np.ascontiguousarray(each).data)
    return digest.hexdigest()


def refuse_late(name: object, times: Iterable[Floats]) -> None:
    """Raise InputError for times that a recording cannot hold."""
    latest = max(float(np.max(np.abs(time), initial=0.0)) for time in times)
    if latest > columns.LATEST:
        raise InputError(
            f"{name}: time is {latest:g} s: a recording holds up to {columns.LATEST:g} s"
        )


def view(path: str, name: str, **axes: Any) -> rrb.TimeSeriesView:  # noqa: ANN401 (of the view)
    """Return the view of the time series under a path."""
    return rrb.TimeSeriesView(origin=f"/{path}", name=name, plot_legend=LEGEND, **axes)


def series(
    stream: rr.RecordingStream, path: str, time: Floats, values: Floats, look: Series
) -> None:
    """Log a time series, if not empty; a line is thinned to its lowest and highest values."""
    if not time.size:
        return
    style: rr.SeriesLines | rr.SeriesPoints = (
        rr.SeriesLines(
            colors=[look.colour],
            names=[look.name],
            widths=[look.width],
            aggregation_policy=rr.components.AggregationPolicy.MinMax,
        )
        if look.width
        else rr.SeriesPoints(colors=[look.colour], names=[look.name], marker_sizes=[look.size])
    )
    stream.log(path, style, static=True)
    stream.send_columns(path, [columns.at(time)], rr.Scalars.columns(scalars=values))


def residual(
    stream: rr.RecordingStream, path: str, time: Floats, left: Floats, look: Series
) -> None:
    """Log a residual (rad) in mrad, with its root mean square in the name."""
    known = left[np.isfinite(left)]
    if known.size:
        rms = MILLI * math.sqrt(float(np.mean(known**2)))
        named = replace(look, name=f"{look.name}, {rms:.3g} mrad rms")
        series(stream, path, time, MILLI * left, named)


def noise(stream: rr.RecordingStream, path: str, time: Floats, sigma: float) -> None:
    """Log the lines between which noise alone would keep 95 % of a residual."""
    for name, sign, said in (("above", 1, "+"), ("below", -1, MINUS)):
        band = np.full(2, MILLI * sign * BAND * sigma)
        text = f"{said}{BAND:g} {SIGMA} of the noise, {said}{abs(band[0]):.3g} mrad"
        series(stream, f"{path}/{name}", time[[0, -1]], band, Series(text, frame.INK, 1.5))


def pendulum(  # noqa: PLR0913, PLR0917 (where, when, how)
    stream: rr.RecordingStream,
    root: str,
    time: Floats,
    theta: Floats,
    look: Series,
    size: tuple[float, float, float],
    pivot: float = 0.0,
) -> None:
    """Log a pendulum: radii of arm and bob in points, and drawing order (greater is on top)."""
    arm, bob, order = size
    known = np.isfinite(theta)
    at = np.stack([pivot + np.sin(theta), -np.cos(theta)], axis=1)[known]
    lines = np.stack([np.broadcast_to((pivot, 0.0), at.shape), at], axis=1)
    columns.strips(stream, f"{root}/arm", time[known], lines, Look(look.colour, arm, order))
    columns.points(stream, f"{root}/bob", time[known], at, Look(look.colour, bob, order + 1))


def pivots(stream: rr.RecordingStream, path: str, places: Iterable[float]) -> None:
    """Log the pivots at these positions, and the upward y axis of the pendulums."""
    upward = rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0]))
    stream.log(f"{path}/data", upward, static=True)
    at = [[place, 0.0] for place in places]
    spots = rr.Points2D(at, colors=[frame.INK], radii=rr.Radius.ui_points(3.0))
    stream.log(f"{path}/axes/pivots", spots, static=True)
