"""The recording of one trajectory: the moving pendulum, phase plane, Poincare section, state."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.errors import InputError
from pendmap.model.units import TIME, VELOCITY, Units
from pendmap.pictures import names, plane
from pendmap.viewer import columns, frame
from pendmap.viewer.columns import FASTEST, LATEST, Look

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

__all__ = ["blueprint", "log"]

Floats = npt.NDArray[np.float64]

ARM = (120, 130, 145)
BOB = (213, 94, 0)
CURVE = (120, 150, 190)
PIVOT = (0, 158, 115)
TRAIL = (230, 159, 0)

TRAIL_POINTS = 48
"""Points of the bob's trail, which is one forcing period long."""

TRAILS = 20000
"""Trails that are logged at most; the trail of a longer trajectory moves on in larger steps."""

MANY = 1000
"""Points of a section above which they are drawn smaller."""

_STATE: dict[str, tuple[Callable[[Units], str], tuple[int, int, int]]] = {
    "theta": (lambda _: names.ANGLE, (0, 114, 178)),
    "omega": (names.speed, (213, 94, 0)),
    "energy": (lambda _: "energy", (0, 158, 115)),
}


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: pendulum and summary left; phase plane, section and state right."""
    around = _frame(dataset)
    so_far = rrb.VisibleTimeRange(
        frame.TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    reach = 1.25 + _stroke(dataset)
    pendulum = rrb.Spatial2DView(
        origin="/pendulum",
        name="Pendulum",
        visual_bounds=rrb.VisualBounds2D(x_range=[-reach, reach], y_range=[-reach, reach]),
    )
    state = [
        rrb.TimeSeriesView(origin=f"/state/{name}", name=text(around.units))
        for name, (text, _) in _STATE.items()
    ]
    left = rrb.Vertical(
        pendulum,
        rrb.TextDocumentView(origin="/summary", name="Summary"),
        row_shares=[3, 2],
    )
    planes = rrb.Horizontal(
        around.view("phase", "Phase plane"),
        around.view(
            "poincare", "Poincar\N{LATIN SMALL LETTER E WITH ACUTE} section", time_ranges=[so_far]
        ),
    )
    right = rrb.Vertical(planes, rrb.Tabs(*state, active_tab=0), row_shares=[3, 2])
    return frame.screen(left, right, shares=[2, 5])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log everything in columns, on the timeline ``sim_time`` and, once a period, on ``period``."""
    time = dataset["time"].values.astype(float)
    theta = dataset["theta"].values.astype(float)
    velocity = dataset["velocity"].values.astype(float)
    units = Units.of(dataset.attrs)
    _refuse_beyond(time, velocity)
    clock = "The time of the viewer is nondimensional: 1 s is \N{GREEK SMALL LETTER TAU} = 1."
    if units.si:
        clock = "The time of the viewer is that of the rig."
    frame.summary(stream, dataset, clock)
    around = _frame(dataset)
    for root in ("phase", "poincare"):
        around.log(stream, root)
    _state(stream, time, theta, velocity, units)
    _pendulum(stream, dataset, time, theta)
    _phase(stream, time, theta, velocity)
    _section(stream, dataset)


def _refuse_beyond(time: Floats, velocity: Floats) -> None:
    """Refuse what a recording cannot hold: its places are single precision, its times ns."""
    fastest = float(np.max(np.abs(velocity), initial=0.0))
    if fastest > FASTEST:
        raise InputError(f"velocity reaches {fastest:g}: a recording holds up to {FASTEST:g}")
    if time.size and time[-1] > LATEST:
        raise InputError(f"until is {time[-1]:g}: a recording holds up to {LATEST:g}")


def _frame(dataset: xr.Dataset) -> frame.Frame:
    speeds = plane.padded(dataset["velocity"].values)
    return frame.Frame((-math.pi, math.pi), speeds, Units.of(dataset.attrs))


def _stroke(dataset: xr.Dataset) -> float:
    """Return the amplitude of the pivot's motion in lengths of the pendulum, p / omega^2."""
    omega = float(dataset.attrs["omega"])
    return abs(float(dataset.attrs["p"])) / omega**2 if omega else 0.0


def _state(
    stream: rr.RecordingStream, time: Floats, theta: Floats, velocity: Floats, units: Units
) -> None:
    """Log angle, velocity and energy theta'^2 / 2 + 1 - cos theta, 0 at rest, 2 upside down.

    The energy is over m g l, in all units.
    """
    energy = 0.5 * units.bare(velocity, VELOCITY) ** 2 + 1.0 - np.cos(theta)
    for name, values in (("theta", theta), ("omega", velocity), ("energy", energy)):
        said, colour = _STATE[name]
        text = said(units)
        path = f"state/{name}"
        stream.log(path, rr.SeriesLines(colors=[colour], names=[text], widths=[1.5]), static=True)
        stream.send_columns(path, [columns.at(time)], rr.Scalars.columns(scalars=values))


def _pendulum(stream: rr.RecordingStream, dataset: xr.Dataset, time: Floats, theta: Floats) -> None:
    """Log the pendulum in lengths of its arm, x to the right, y upward, the angle from hanging.

    The effective gravity 1 + p cos(omega tau + phase) is that of a pivot at height
    -(p / omega^2) cos(omega tau + phase).
    """
    omega, phase = float(dataset.attrs["omega"]), float(dataset.attrs.get("phase", 0.0))
    stroke = math.copysign(_stroke(dataset), float(dataset.attrs["p"]))
    tau = Units.of(dataset.attrs).bare(time, TIME)
    height = -stroke * np.cos(omega * tau + phase)
    pivot = np.stack([np.zeros_like(height), height], axis=1)
    bob = pivot + np.stack([np.sin(theta), -np.cos(theta)], axis=1)
    stream.log("pendulum/data", rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0])), static=True)
    rail = [[[0.0, -abs(stroke) - 0.05], [0.0, abs(stroke) + 0.05]]]
    thin = rr.Radius.ui_points(0.75)
    stream.log(
        "pendulum/axes/rail", rr.LineStrips2D(rail, colors=[frame.INK], radii=thin), static=True
    )
    columns.points(stream, "pendulum/data/pivot", time, pivot, Look(PIVOT, 4.0))
    columns.points(stream, "pendulum/data/bob", time, bob, Look(BOB, 9.0))
    arm = np.stack([pivot, bob], axis=1)
    columns.strips(stream, "pendulum/data/arm", time, arm, Look(ARM, 2.0))
    turns = omega or 1.0
    samples = (
        2 * math.pi / turns / max(float(np.median(np.diff(tau))), 1e-12) if time.size > 1 else 1
    )
    every = max(1, math.ceil(samples / TRAIL_POINTS))
    chosen = np.arange(0, time.size, max(1, -(-time.size // TRAILS)))
    back = every * np.arange(min(TRAIL_POINTS, max(2, math.ceil(samples / every))))[::-1]
    trail = bob[np.maximum(chosen[:, None] - back[None, :], 0)]
    columns.strips(stream, "pendulum/data/trail", time[chosen], trail, Look(TRAIL, 1.5))


def _phase(stream: rr.RecordingStream, time: Floats, theta: Floats, velocity: Floats) -> None:
    """Log the whole curve, broken where the angle wraps, and the point that runs along it."""
    curve = plane.broken_at_wrap(theta, velocity).astype(np.float32)
    lines = rr.LineStrips2D([curve], colors=[CURVE], radii=rr.Radius.ui_points(0.6))
    stream.log("phase/data/curve", lines, static=True)
    now = np.stack([plane.wrapped(theta), velocity], axis=1)
    columns.points(stream, "phase/data/now", time, now, Look(BOB, 6.0))


def _section(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log one point a period; the view shows those up to the cursor, so the section grows."""
    time = dataset["section_time"].values.astype(float)
    at = np.stack([dataset["section_theta"].values, dataset["section_velocity"].values], axis=1)
    size = 1.4 if time.size > MANY else 2.5
    period = rr.TimeColumn("period", sequence=dataset["period"].values.astype(np.int64))
    columns.points(stream, "poincare/data/points", time, at, Look(BOB, size), period)
