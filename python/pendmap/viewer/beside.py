"""One run in the recording of a diagnosis: the record, the old model and the new one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import names
from pendmap.viewer import columns, frame, series
from pendmap.viewer.columns import Look
from pendmap.viewer.comparison import drawn_at
from pendmap.viewer.decay import BAND, MILLI, MINUS, SIGMA
from pendmap.viewer.series import Series

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun

Floats = npt.NDArray[np.float64]

RECORD: Final = Series("record", (128, 128, 128), 1.0)
BEFORE: Final = Series("before", (213, 94, 0), 1.6)
AFTER: Final = Series("after", (0, 114, 178), 1.6)

APART: Final = 2.5
"""Lengths of the arm between two pivots."""

THIN, BROAD = (0.8, 4.0, 3.0), (3.0, 10.0, 1.0)
"""Radii of arm and bob, in points of the screen, and which lies on top: the greater one."""

SEEN: Final = 0.3
"""Angle by which the old model's pendulum stands off where it is off by three times its residual's
root mean square, rad."""

MOST: Final = 1000.0
"""How much larger deviations are drawn at most."""


@dataclass(frozen=True)
class Beside:
    """A record (s, rad) and what two models leave of it (rad), with the noise of a reading.

    A row without numbers ends what is before a gap; what does not count is no number.
    """

    name: str
    time: Floats
    record: Floats
    before: Floats
    after: Floats
    sigma: float


def beside(found: Discrepancy) -> list[Beside]:
    """Return all runs, those that were held back whole after the others."""
    data, base, best = found.data, found.base, found.best
    fits, w0 = (base.fitted.fit, best.fitted.fit), found.base.fitted.fit.model.w0
    held = (base.hold_out.fit, best.hold_out.fit)
    made = []
    for k, run in enumerate(data.fitted):
        left = [_left(run, fit, k) for fit in fits]
        if data.inside and data.fitted_of[k] in data.held_of:
            # The stretches held back lie within the run, and the motion passes through them.
            place = data.held_of.index(data.fitted_of[k])
            back = [_left(data.held[place], fit, place) for fit in held]
            left = [np.where(np.isfinite(b), b, a) for a, b in zip(left, back, strict=True)]
        made.append(_drawn(run, left, run.name, w0))
    if not data.inside:
        for k, run in enumerate(data.held):
            left = [_left(run, fit, k) for fit in held]
            made.append(_drawn(run, left, f"{run.name}, held out", w0))
    return made


def _left(run: FitRun, fit: TrajectoryFit, place: int) -> Floats:
    known = np.isfinite(fit.curves[place][0])
    if run.trusted is not None:
        known &= run.trusted
    return np.where(known, fit.residuals[place], math.nan)


def _drawn(run: FitRun, left: list[Floats], name: str, w0: float) -> Beside:
    kept, cuts, instants = drawn_at(run.time, w0)
    record, before, after = (
        np.insert(column[kept], cuts, math.nan) for column in (run.theta, *left)
    )
    sigma = float(np.sqrt(np.mean(np.square(run.sigma))))
    return Beside(name, instants, record, before, after, sigma)


def magnified(shown: list[Beside]) -> float:
    """Return how much larger deviations of the pendulums are drawn: 1, 2, 5, 10, ..."""
    sizes = [float(np.sqrt(np.nanmean(one.before**2))) for one in shown if _known(one.before)]
    wanted = SEEN / (3 * max([*sizes, 1e-12]))
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(np.clip(max(m * power for m in (1, 2, 5) if m * power <= wanted), 1.0, MOST))


def _known(values: Floats) -> bool:
    return bool(np.isfinite(values).any())


def views(root: str, one: Beside, larger: float) -> rrb.Container:
    """Return the views of a run: three pendulums above, angles and residuals beneath."""
    times = f", deviations {larger:g} times larger" if larger > 1 else ""
    pendulums = rrb.Spatial2DView(
        origin=f"/{root}/pendulum",
        name=f"Record, old model, new model{times}",
        visual_bounds=rrb.VisualBounds2D(x_range=[-APART / 2, 2.5 * APART], y_range=[-1.15, 1.5]),
    )
    angle = rrb.TimeSeriesView(
        origin=f"/{root}/angle", name=f"{names.ANGLE}, {one.name}", plot_legend=_LEGEND
    )
    residual = rrb.TimeSeriesView(
        origin=f"/{root}/residual", name="Record less model (mrad)", plot_legend=_LEGEND
    )
    return rrb.Vertical(pendulums, angle, residual, row_shares=[5, 3, 4], name=one.name)


_LEGEND: Final = rrb.Corner2D.RightTop


def log(stream: rr.RecordingStream, root: str, one: Beside, larger: float) -> None:
    """Log one run."""
    series.log(stream, f"{root}/angle/record", one.time, one.record, RECORD)
    for look, left in ((BEFORE, one.before), (AFTER, one.after)):
        series.log(stream, f"{root}/angle/{look.name}", one.time, one.record - left, look)
    _residuals(stream, f"{root}/residual", one)
    _pendulums(stream, f"{root}/pendulum", one, larger)


def _residuals(stream: rr.RecordingStream, path: str, one: Beside) -> None:
    """Log what both models leave, and between which lines noise alone would leave 95 % of it."""
    for look, left in ((BEFORE, one.before), (AFTER, one.after)):
        known = np.isfinite(left)
        if not known.any():
            continue
        rms = MILLI * math.sqrt(float(np.mean(left[known] ** 2)))
        said = Series(f"{look.name}, {rms:.3g} mrad rms", look.colour, 1.2)
        series.log(stream, f"{path}/{look.name}", one.time, MILLI * left, said)
    ends = one.time[[0, -1]]
    for name, sign, said_sign in (("above", 1, "+"), ("below", -1, MINUS)):
        band = np.full(2, MILLI * sign * BAND * one.sigma)
        text = f"{said_sign}{BAND:g} {SIGMA} of the noise, {said_sign}{abs(band[0]):.3g} mrad"
        series.log(stream, f"{path}/{name}", ends, band, Series(text, frame.INK, 1.5))


def _pendulums(stream: rr.RecordingStream, path: str, one: Beside, larger: float) -> None:
    """Log three pendulums side by side; behind those of the models the record's, thin."""
    turned = rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0]))
    stream.log(f"{path}/data", turned, static=True)
    # A model's angle is drawn as the record's, and how far it is off that many times larger.
    columns_of = ((RECORD, np.zeros_like(one.record)), (BEFORE, one.before), (AFTER, one.after))
    pivots = []
    for place, (look, left) in enumerate(columns_of):
        pivot = np.array([APART * place, 0.0])
        root = f"{path}/data/{look.name}"
        if place:
            _pendulum(stream, f"{root}/record", pivot, one.time, one.record, RECORD, THIN)
        theta = one.record - larger * left
        _pendulum(stream, root, pivot, one.time, theta, look, BROAD)
        pivots.append([float(pivot[0]), 0.0])
    stream.log(
        f"{path}/axes/pivots",
        rr.Points2D(pivots, colors=[frame.INK], radii=rr.Radius.ui_points(3.0)),
        static=True,
    )
    below = [[x, 1.2] for x, _ in pivots]
    frame.write(stream, f"{path}/axes/names", below, ["record", "old model", "new model"])


def _pendulum(  # noqa: PLR0913, PLR0917 (where, when, how)
    stream: rr.RecordingStream,
    root: str,
    pivot: Floats,
    time: Floats,
    theta: Floats,
    look: Series,
    size: tuple[float, float, float],
) -> None:
    """Log a pendulum: an arm and a bob of this size, what has the greater order on top."""
    arm, bob, order = size
    known = np.isfinite(theta)
    at = pivot + np.stack([np.sin(theta), -np.cos(theta)], axis=1)[known]
    lines = np.stack([np.broadcast_to(pivot, at.shape), at], axis=1)
    columns.strips(stream, f"{root}/arm", time[known], lines, Look(look.colour, arm, order))
    columns.points(stream, f"{root}/bob", time[known], at, Look(look.colour, bob, order + 1))
