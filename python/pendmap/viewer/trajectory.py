"""Recording of one trajectory: moving pendulum, phase plane, Poincare section, state."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.analysis.trajectory import energy
from pendmap.charts import names, plane
from pendmap.charts.chart import Panel, holding
from pendmap.errors import InputError
from pendmap.files import facts
from pendmap.units import TIME, Units
from pendmap.viewer import recording
from pendmap.viewer.marks import Place
from pendmap.viewer.recording import FASTEST, TIMELINE, Look

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import xarray as xr

    from pendmap.charts.marks import Floats

    Attributes = Mapping[Any, Any]

ARM = (120, 130, 145)
BOB = (213, 94, 0)
LINE = (120, 150, 190)
PIVOT = (0, 158, 115)
TRAIL = (230, 159, 0)
TRAIL_POINTS = 48  # Greatest number of points of the bob's trail, which is one forcing period long
MOVING = 50_000
"""Greatest number of positions of the pendulum; of a longer trajectory every k-th sample moves."""
BINS = 100_000  # Bins of a long series, which is logged by its lowest and highest values
CURVE = 20_000  # Samples of the phase curve, counted from the end
_STATE: dict[str, tuple[Callable[[Units], str], tuple[int, int, int]]] = {
    "theta": (lambda _: names.ANGLE, (0, 114, 178)),
    "omega": (names.speed, (213, 94, 0)),
    "energy": (lambda _: "energy E / (m g l)", (0, 158, 115)),
}


def motion_of(dataset: xr.Dataset) -> Floats:
    """Return times, angles and velocities of a trajectory, shape (3, n)."""
    return np.stack([dataset[name].values for name in ("time", "theta", "velocity")], dtype=float)


def layout(attrs: Attributes, around: Sequence[Place]) -> rrb.Blueprint:
    """Return the layout for a trajectory with these attributes, in given frames."""
    begin, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    so_far = rrb.VisibleTimeRange(TIMELINE, start=begin, end=now)
    reach = 1.25 + _stroke(attrs)
    pendulum = rrb.Spatial2DView(
        origin="/pendulum",
        name="Pendulum",
        visual_bounds=rrb.VisualBounds2D(x_range=[-reach, reach], y_range=[-reach, reach]),
    )
    state = [
        rrb.TimeSeriesView(origin=f"/state/{name}", name=text(Units.of(attrs)))
        for name, (text, _) in _STATE.items()
    ]
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    left = rrb.Vertical(pendulum, summary, row_shares=[3, 2])
    phase, section = around
    planes = rrb.Horizontal(phase.view(), section.view(time_ranges=[so_far]))
    right = rrb.Vertical(planes, rrb.Tabs(*state, active_tab=0), row_shares=[3, 2])
    return recording.screen(left, right, shares=[2, 5])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log everything in columns, on the timeline ``sim_time`` and, once a period, ``period``."""
    attrs, motion = facts(dataset), motion_of(dataset)
    time, _, velocity = motion
    refuse_beyond(time, velocity)
    still(stream, places(attrs, velocity))
    every = -(-time.size // MOVING)
    long = f"This is a long run: of each {every} samples the pendulum moves at one."
    page(stream, dataset, *([long] if every > 1 else []))
    series(stream, attrs, motion, BINS)
    moving_parts(stream, attrs, motion, every=every)
    curve(stream, motion)
    at, *point = (dataset[f"section_{name}"].values for name in ("time", "theta", "velocity"))
    section(stream, at.astype(float), np.array(point), dataset["period"].values)


def page(stream: rr.RecordingStream, dataset: xr.Dataset, *further: str) -> None:
    """Log the summary of the trajectory, and further paragraphs."""
    si = Units.of(facts(dataset)).si
    clock = "that of the rig" if si else "nondimensional: 1 s is τ = 1"
    lines = str(dataset.attrs.get("summary", "")).splitlines()
    lines += [f"The time of the viewer is {clock}.", *further]
    recording.text(stream, "summary", "\n\n".join(lines))


def refuse_beyond(time: Floats, velocity: Floats) -> None:
    """Raise InputError for velocities or times that a recording cannot hold."""
    fastest = float(np.max(np.abs(velocity), initial=0.0))
    if fastest > FASTEST:
        raise InputError(f"velocity reaches {fastest:g}: a recording holds up to {FASTEST:g}")
    recording.refuse_late("until", [time])


def places(attrs: Attributes, velocity: Floats) -> list[Place]:
    """Return phase plane and section in frames that contain these velocities."""
    units, theta, speeds = Units.of(attrs), (-math.pi, math.pi), holding(velocity)
    sides, ratio = names.phase_plane(theta, speeds, units), names.proportion(theta, speeds, units)
    titles = {"phase": "Phase plane", "poincare": "Poincaré section"}
    return [Place.of(Panel(name, title, *sides, ()), ratio) for name, title in titles.items()]


def _stroke(attrs: Attributes) -> float:
    """Return the amplitude of the pivot's motion in pendulum lengths, p / omega^2."""
    omega = float(attrs["omega"])
    return abs(float(attrs["p"])) / omega**2 if omega else 0.0


def still(stream: rr.RecordingStream, around: Sequence[Place]) -> None:
    """Log the static parts: frames, and the direction of the pendulum's y axis."""
    for place in around:
        place.log_frame(stream)
    stream.log("pendulum/data", recording.UPWARD, static=True)


def series(stream: rr.RecordingStream, attrs: Attributes, motion: Floats, bins: int) -> None:
    """Log angle, velocity and energy against time, by their extremes in each of ``bins`` bins."""
    units, (time, theta, velocity) = Units.of(attrs), motion
    every = (theta, velocity, energy(theta, velocity, attrs))
    for (name, (text, colour)), values in zip(_STATE.items(), every, strict=True):
        at, shown = plane.envelope(time, values, bins)
        recording.series(stream, f"state/{name}", at, shown, Look(colour, 1.5, name=text(units)))


def moving_parts(
    stream: rr.RecordingStream, attrs: Attributes, motion: Floats, *, since: int = 0, every: int = 1
) -> None:
    """Log the pendulum in arm lengths, x to the right, y upward, and its phase point."""
    time, theta, velocity = motion
    omega, phase = float(attrs["omega"]), float(attrs.get("phase", 0.0))
    stroke = math.copysign(_stroke(attrs), float(attrs["p"]))
    tau = Units.of(attrs).bare(time, TIME)
    height = -stroke * np.cos(omega * tau + phase)
    pivot = np.stack([np.zeros_like(height), height], axis=1)
    bob = pivot + np.stack([np.sin(theta), -np.cos(theta)], axis=1)
    new = np.arange(since, time.size, every)
    recording.points(stream, "pendulum/data/pivot", time[new], pivot[new], Look(PIVOT, 4.0))
    recording.points(stream, "pendulum/data/bob", time[new], bob[new], Look(BOB, 9.0))
    arm = np.stack([pivot[new], bob[new]], axis=1)
    recording.strips(stream, "pendulum/data/arm", time[new], arm, Look(ARM, 2.0))
    trail = bob[np.maximum(new[:, None] - behind(attrs, time), 0)]
    recording.strips(stream, "pendulum/data/trail", time[new], trail, Look(TRAIL, 1.5))
    now = np.stack([plane.wrapped(theta[new]), velocity[new]], axis=1)
    recording.points(stream, "phase/data/now", time[new], now, Look(BOB, 6.0))


def behind(attrs: Attributes, time: Floats) -> npt.NDArray[np.int64]:
    """Return the sample offsets of the trail's points, falling to 0, over about one period."""
    tau = Units.of(attrs).bare(time, TIME)
    step = float(np.median(np.diff(tau))) if time.size > 1 else math.inf
    samples = 2 * math.pi / (float(attrs["omega"]) or 1.0) / max(step, 1e-12)
    every = max(1, math.ceil(samples / TRAIL_POINTS))
    count = min(TRAIL_POINTS, max(2, math.ceil(samples / every)))
    return every * np.arange(count, dtype=np.int64)[::-1]


def curve(stream: rr.RecordingStream, motion: Floats) -> None:
    """Log the end of the curve in the phase plane, broken where the angle wraps."""
    points = plane.broken_at_wrap(*motion[1:, -CURVE:]).astype(np.float32)
    lines = rr.LineStrips2D([points], colors=[LINE], radii=rr.Radius.ui_points(0.6))
    stream.log("phase/data/curve", lines, static=True)


def section(
    stream: rr.RecordingStream, time: Floats, points: Floats, period: npt.NDArray[np.int64]
) -> None:
    """Log one point per period; the view shows those up to the cursor, so the section grows."""
    at = np.stack([plane.wrapped(points[0]), points[1]], axis=1)
    number = rr.TimeColumn("period", sequence=period.astype(np.int64))
    recording.points(stream, "poincare/data/points", time, at, Look(BOB, 1.8), number)
