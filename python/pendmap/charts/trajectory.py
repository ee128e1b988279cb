"""Chart of one trajectory: time history, energy, phase plane, Poincare section."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.trajectory import energy
from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import QUIET, Level, Line, Mark, Points, Span
from pendmap.files import facts
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.charts.marks import Ends, Floats

LATE: Final = 0.2
"""Last share of a trajectory, drawn dark: the motion after the transient."""
FLAT: Final = 0.1  # Range below which a history is drawn as a straight line, rad
SIZES: Final = ((500, 2.6), (20_000, 1.3), (math.inf, 0.6))
"""Sizes of the points of a section by the greatest number of points for each."""
UPSIDE_DOWN: Final = 2.0  # Energy over m g l of a pendulum at rest in the inverted position
MOST_DRAWN: Final = 20_000
"""Bins of a curve against time, drawn by its lowest and highest values."""
MOST_PERIODS: Final = 200
"""Number of periods above which only the last half of this number is drawn in the phase plane."""
_SIZES: Final = {"history": (8.6, 3.6), "energy": (8.6, 3.6)}  # Inches of a figure of one part
_EARLY, _LATE, _REST = "#93a7c1", "#1d3557", "#f8edd6"


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return the four parts; late parts of curves are dark."""
    del cells
    units, time = Units.of(facts(dataset)), dataset["time"].values
    ends = (float(time[0]), float(time[-1])) if time[-1] > time[0] else None
    below = Axis(names.clock(units), ends)
    sides = names.phase_plane((-math.pi, math.pi), holding(dataset["velocity"].values), units)
    rows = [
        [_history(dataset, below if layer else Axis("", ends))],
        [_energy(dataset, below)],
        [_phase(dataset, sides), _section(dataset, sides)],
    ]
    look: dict[str, Any] = {"heights": (0.32, 0.2, 0.48), "size": (8.6, 8.2)}
    chart = Chart("Trajectory", names.with_start(facts(dataset)), rows, **look)
    return chart.only(layer, _SIZES.get(layer or "", (5.6, 5.3)))


def _history(dataset: xr.Dataset, clock: Axis) -> Panel:
    marks, ends = _against_time(dataset, dataset["theta"].values)
    spans = resting(dataset)
    if len(spans):
        marks.append(Span(spans, colour=_REST, name="at rest"))
    title = "time history (dark: the last fifth)"
    return Panel("history", title, clock, Axis(names.ANGLE, ends, "angle"), marks)


def _energy(dataset: xr.Dataset, clock: Axis) -> Panel:
    values = energy(dataset["theta"].values, dataset["velocity"].values, facts(dataset))
    (marks, ends), title = _against_time(dataset, values), "energy"
    if ends[0] < UPSIDE_DOWN < ends[1]:  # above it the pendulum can rotate
        marks.append(Level(UPSIDE_DOWN, colour=QUIET, width=0.8, dash=(4.0, 3.0), order=0.0))
        title = "energy (dashed: upside down at rest)"
    return Panel("energy", title, clock, Axis("E / (m g l)", ends), marks)


def _against_time(dataset: xr.Dataset, values: Floats) -> tuple[list[Mark], Ends]:
    """Return a curve against time, its last part dark, and limits; long ones by their extremes."""
    time, late = dataset["time"].values, _late(dataset)
    marks: list[Mark] = []
    for part, colour in ((slice(None, late + 1), _EARLY), (slice(late, None), _LATE)):
        curve = plane.envelope(time[part], values[part], MOST_DRAWN)
        marks.append(Line(*curve, colour=colour, width=1.0))
    low, high = holding(values)
    return marks, (low - FLAT, high + FLAT) if high - low < FLAT else (low, high)


def resting(dataset: xr.Dataset) -> Floats:
    """Return the sticking intervals within the times shown, from and to, shape (n, 2)."""
    if "event_kind" not in dataset:
        return np.empty((0, 2))
    kinds, times = dataset["event_kind"].values, dataset["event_time"].values
    first, last = (float(dataset["time"].values[end]) for end in (0, -1))
    begins, releases = times[kinds == "stick"], times[kinds == "release"]
    ends = np.append(releases, np.inf)[np.searchsorted(releases, begins)]
    spans = np.clip(np.stack([begins, ends], axis=1), first, last)
    within: Floats = spans[spans[:, 0] < spans[:, 1]]
    return within


def _phase(dataset: xr.Dataset, sides: tuple[Axis, Axis]) -> Panel:
    theta, velocity = dataset["theta"].values, dataset["velocity"].values
    late, first, which = _late(dataset), 0, ""
    if dataset.sizes["period"] > MOST_PERIODS:
        beginning = dataset["section_time"].values[-1 - MOST_PERIODS // 2]
        late = first = int(np.searchsorted(dataset["time"].values, beginning))
        which = f", the last {MOST_PERIODS // 2} periods"
    parts = ((slice(first, late + 1), _EARLY, 0.5), (slice(late, None), _LATE, 0.7))
    marks: list[Mark] = []
    for part, colour, width in parts:
        curve = plane.broken_at_wrap(theta[part], velocity[part])
        marks.append(Line(*curve.T, colour=colour, width=width))
    if (facts(dataset).get("stuck") or np.ptp(theta) == 0.0) and velocity[-1] == 0.0:
        marks.append(Points(plane.wrapped(theta[-1:]), velocity[-1:], colour=_LATE, size=3.5))
    return Panel("phase", f"phase plane{which}", *sides, marks)


def _section(dataset: xr.Dataset, sides: tuple[Axis, Axis]) -> Panel:
    theta, velocity = dataset["section_theta"].values, dataset["section_velocity"].values
    beginning = dataset["time"].values[_late(dataset)]
    late = np.asarray(dataset["section_time"].values >= beginning, bool)
    size = next(size for most, size in SIZES if theta.size <= most)
    marks = [
        Points(theta[which], velocity[which], colour=colour, size=size)
        for which, colour in ((~late, _EARLY), (late, _LATE))
    ]
    return Panel("section", "Poincaré section, once a period", *sides, marks)


def _late(dataset: xr.Dataset) -> int:
    """Return the first index of the last part."""
    time = dataset["time"].values
    return int(np.searchsorted(time, time[-1] - LATE * (time[-1] - time[0])))
