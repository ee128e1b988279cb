"""Charts of a decay's half cycles (figure 4) and of the decrements of its peaks (figure 5).

A zero error ``b`` of the angle makes the differences of successive peaks alternate by ``2 b``, and
so the decrements of triplets that begin at odd and at even peaks.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel, holding, nothing
from pendmap.charts.marks import NONE, QUIET, ZERO, Band, Level, Line, Mark, Points, bars
from pendmap.charts.palette import EVEN, MEASURED, NOISE, NOISE_SAID, ODD, look
from pendmap.charts.record import UNUSED
from pendmap.formatting import Estimate, estimate_text, typographic
from pendmap.identification.methods.combined import CUT, triplets
from pendmap.signal.robust import Z95
from pendmap.units import Units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.charts.marks import Ends, Floats
    from pendmap.identification import Identification, IdentificationReport, Peaks
    from pendmap.records import Run

NEAR: Final = 6  # Number of half cycles of a close view
POINTS: Final = 500  # Number of points of a close view at which the velocity is computed
SPAN: Final = 0.2  # Half width of the stretch of a cubic fit, over the length of a half cycle
REACH: Final = 1.35
"""Range of an axis of signed decrements, over the 90th percentile of their absolute values."""


@dataclasses.dataclass(frozen=True)
class Course:
    """A record relative to the turn in which it comes to rest, with numbers of half cycles."""

    time: Floats
    theta: Floats
    half: NDArray[np.int64]
    other_time: Floats
    other_theta: Floats

    @classmethod
    def of(cls, run: Run, peaks: Peaks) -> Course:
        """Return the course of a run; before the first peak and from the last one on it has -1."""
        good = run.trusted
        time, theta = run.time[good], run.theta[good]
        away = 0.0
        if len(peaks):
            at = np.interp(peaks.time, time, theta) - peaks.amplitude
            away = math.tau * round(float(np.median(at)) / math.tau)
        of_peak = np.where(np.diff(peaks.index) == 1, peaks.index[:-1], -1)
        half = np.array([-1, *of_peak, -1])[np.searchsorted(peaks.time, time, side="right")]
        return cls(time, theta - away, half, run.time[~good], run.theta[~good] - away)


def part(report: IdentificationReport) -> Chart:
    """Return the whole record, and angle and velocity at the first and the last peaks."""
    run, peaks = report.run, report.peaks
    course, title = Course.of(run, peaks), "The record and its half cycles"
    few = len(peaks) < 3  # noqa: PLR2004 (a half cycle on either side)
    whole = _whole(course, peaks, thin=few or not run.peaks_only)
    if few:
        return Chart(title, "", [[whole]], size=(8.6, 2.4))
    spans = {"the first half cycles": peaks.time[: NEAR + 1]}
    spans["the last half cycles"] = peaks.time[-1 - NEAR :]
    if len(peaks) <= 2 * NEAR + 1:
        spans = {"all of them": peaks.time}
    columns = [_near(report, course, *one) for one in spans.items()]
    rows = [[whole], *zip(*columns, strict=True)]
    heights = (1.1, 1.0, 0.8)[: len(rows)]  # peaks alone have no velocity
    return Chart(title, "", rows, heights=heights, size=(8.6, 0.7 + 1.6 * sum(heights)))


def _whole(course: Course, peaks: Peaks, *, thin: bool) -> Panel:
    """Return the whole record, as a line if ``thin``, else as its peaks alone."""
    marks: list[Mark] = [Points(course.other_time, course.other_theta, colour=UNUSED, size=1.2)]
    if thin:
        marks += _coloured(course.time, course.theta, course.half, 0.6)
    marks += _peaks(peaks, 1.6 if thin else 3.0, by_parity=not thin)
    theta = np.concatenate([course.theta, course.other_theta])
    more = "; grey: not for fitting" if course.other_time.size else ""
    title = f"the whole record, {len(peaks)} peaks{more}"
    clock = names.seconds(np.concatenate([course.time, course.other_time]))
    return Panel("whole", title, clock, names.angle(holding(theta)), marks)


def _near(report: IdentificationReport, course: Course, title: str, span: Floats) -> list[Panel]:
    """Return angle with peaks and crossings, and velocity, over these times."""
    run, peaks = report.run, report.peaks
    ends = holding(span, margin=0.02)
    bare = Axis("", ends, ticks=())
    near, some = _within(course.time, ends), peaks.select(_within(peaks.time, ends))
    wide = Z95 * some.stderr_amplitude
    cross = peaks.crossing_time[_within(peaks.crossing_time, ends)]
    name = "crossings of zero" if cross.size else ""
    lines = bars(some.time, some.amplitude - wide, some.amplitude + wide)
    angle = [
        Line(*lines, colour=MEASURED, width=0.8, order=3.0),
        *_peaks(some, 4.5, by_parity=run.peaks_only),
        ZERO,
        Points(cross, 0 * cross, colour=MEASURED, marker="|", size=8.0, edge_width=1.2, name=name),
    ]
    if not run.peaks_only:
        angle += _coloured(course.time[near], course.theta[near], course.half[near], 1.1)
    values = holding(course.theta[near], some.amplitude)
    panels = [Panel("angle", title, bare, names.angle(values), angle)]
    if not run.peaks_only:
        time, half, speed = _velocity(run, course, peaks, ends)
        up = names.angle(holding(speed), names.speed(Units(si=True)))
        marks = [*_coloured(time, speed, half, 1.1), ZERO]
        panels.append(Panel("velocity", "", bare, up, marks))
    panels[-1] = dataclasses.replace(panels[-1], x=Axis(names.TIME, ends))
    return panels


def _within(time: Floats, ends: Ends) -> NDArray[np.bool_]:
    return (time >= ends[0]) & (time <= ends[1])


def _coloured(time: Floats, values: Floats, half: NDArray[np.int64], width: float) -> list[Mark]:
    """Return a curve with each half cycle in the colour of its parity, the rest in grey."""
    parity = np.where(half < 0, -1, half % 2)
    marks: list[Mark] = []
    for which, colour, name in (
        (-1, UNUSED, ""),
        (0, EVEN, "even half cycles"),
        (1, ODD, "odd half cycles"),
    ):
        shown = parity == which
        shown |= np.concatenate([[False], shown[:-1]])  # one more sample joins the pieces
        look: dict[str, Any] = {"colour": colour, "width": width, "name": name}
        marks.append(Line(time, np.where(shown, values, np.nan), **look))
    return marks


def _peaks(peaks: Peaks, size: float, *, by_parity: bool = False) -> list[Mark]:
    look: dict[str, Any] = {"fill": "#ffffff", "edge_width": 0.4 + 0.11 * size, "order": 4.0}
    look["name"] = "peaks"
    marks: list[Mark] = []
    for odd, colour in ((False, EVEN), (True, ODD)):
        at = peaks.time[peaks.odd == odd], peaks.amplitude[peaks.odd == odd]
        marks.append(Points(*at, colour=colour if by_parity else MEASURED, size=size, **look))
    return marks


def _velocity(
    run: Run, course: Course, peaks: Peaks, ends: Ends
) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Return times, half cycles, and the measured velocity or else slopes of cubics."""
    near = _within(course.time, ends)
    time, half = course.time[near], course.half[near]
    if run.velocity is not None:
        return time, half, run.velocity[run.trusted][near]
    every = max(1, time.size // POINTS)
    time, half = time[::every], half[::every]
    # A cubic needs five samples, also where the record has few to a half cycle.
    least = 2.5 * float(np.median(np.diff(course.time)))
    reach = max(SPAN * float(np.median(np.diff(peaks.time[_within(peaks.time, ends)]))), least)
    speed = np.full(time.size, math.nan)
    for k, at in enumerate(time):
        some = np.abs(course.time - at) <= reach
        if np.count_nonzero(some) > 4:  # noqa: PLR2004 (coefficients of a cubic)
            speed[k] = np.polyfit(course.time[some] - at, course.theta[some], 3)[2]
    return time, half, speed


# Figure 5.


@dataclasses.dataclass(frozen=True)
class Triplets:
    """Decrements of three successive peaks (eq. 2.7), with the size of the middle peak in rad."""

    size: Floats
    delta: Floats
    stderr: Floats
    odd: NDArray[np.bool_]


def triplets_of(peaks: Peaks, zero: float = 0.0) -> Triplets:
    """Return the triplets of neighbouring peaks, with a zero error (rad) subtracted from angles."""
    turned = peaks.turned
    size, error = np.abs(turned.amplitude - zero), turned.stderr_amplitude
    if size.size < 3:  # noqa: PLR2004
        return Triplets(NONE, NONE, NONE, np.empty(0, bool))
    delta, _ = triplets(size)
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = 1 / (size[:-2] - size[1:-1]), 1 / (size[1:-1] - size[2:])
        parts = (error[:-2] * first, error[1:-1] * (first + second), error[2:] * second)
    stderr = np.sqrt(sum(part**2 for part in parts)) / math.pi
    falling = (size[:-2] > size[1:-1]) & (size[1:-1] > size[2:])
    delta = np.where(falling, delta, np.nan)
    row = turned.index[2:] - turned.index[:-2] == 2  # noqa: PLR2004
    return Triplets(size[1:-1][row], delta[row], stderr[row], (turned.index[:-2] % 2 == 1)[row])


def decrements(report: IdentificationReport) -> Chart:
    """Return absolute and signed decrements, as recorded and without the zero error.

    A line has the decrement of a fitted model, a band about it the noise of the readings.
    """
    raw, title = triplets_of(report.peaks), "The decrement δ of each three peaks"
    if not raw.size.size:
        return nothing(title, "Fewer than three peaks in a row.")
    able = [method for method in report.methods.values() if method.applicable]
    zero = next((one.estimates["offset"] for one in able if "offset" in one.estimates), None)
    columns = [("as recorded", "", raw)]
    if zero is not None:
        error = None if zero.stderr is None else 1e3 * zero.stderr
        removed = typographic(estimate_text(Estimate(1e3 * zero.value, error)))
        without = triplets_of(report.peaks, zero.value)
        columns.append(("zero error removed", f", {removed} mrad removed", without))
    models = [one for one in able if {"w0", "c_over_m"} <= set(one.estimates)]
    fitted = [one for one in models if "offset" in one.estimates] or models
    level = _delta(fitted[0]) if fitted else 0.0
    known = np.concatenate([some.delta[np.isfinite(some.delta)] for _, _, some in columns])
    sizes = np.abs(np.append(known[known != 0], [level] if level else []))
    sizes = sizes if sizes.size else np.array([1e-3, 1.0])
    low = max(float(np.percentile(sizes, 2)), float(sizes.max()) * 1e-4)
    low = min(low, abs(level)) if level else low
    # Most of the triplets are between these ends; those beyond are drawn at them.
    far = REACH * float(np.percentile(np.abs(known), 90)) if known.size else 1.0
    far = max(far, 4 * abs(level), 1e-6)
    sides = Axis("|δ|", (low / 1.6, float(sizes.max()) * 1.6), "log"), Axis("δ", (-far, far))
    ends = (max(float(raw.size.min()) / 1.25, 1e-9), float(raw.size.max()) * 1.15)
    panels = []
    for text, removed, some in columns:
        lost = int(np.isnan(some.delta).sum())
        count = f": {lost} of {some.delta.size} have none" if lost else ""
        for up, heading in zip(sides, (f"|δ|, {text}{count}", f"δ{removed}"), strict=True):
            across = Axis("middle peak |θ| (rad)", ends, "log")
            across = Axis("", ends, "log", ticks=()) if up is sides[0] else across
            marks = [*_points(some, up), *([ZERO] if up is sides[1] else [])]
            marks += _model(some, fitted[0], up) if fitted else []
            panels.append(Panel(f"{up.name} {text}", heading, across, up, marks))
    return Chart(title, "", [panels[0::2], panels[1::2]], size=(8.6, 5.0))


def _delta(method: Identification) -> float:
    """Return ``zeta / sqrt(1 - zeta^2)`` of an identification."""
    zeta = method["c_over_m"] / (2 * method["w0"])
    return zeta / math.sqrt(max(1 - zeta**2, 1e-12))


def _points(some: Triplets, up: Axis) -> list[Mark]:
    low, high = up.ends or (-math.inf, math.inf)
    value = np.abs(some.delta) if up.scale == "log" else some.delta
    marks: list[Mark] = []
    for odd, colour, marker in ((False, EVEN, "s"), (True, ODD, "o")):
        which = (some.odd == odd) & np.isfinite(value)
        x, y = some.size[which], value[which]
        inside = (y >= low) & (y <= high)
        look: dict[str, Any] = {"colour": colour, "order": 3.0}
        spots: dict[str, Any] = {"marker": marker, "size": 3.0, "edge_width": 0.8}
        spots |= {"name": f"from an {'odd' if odd else 'even'} peak"} | look
        marks.append(Points(x[inside], y[inside], fill=colour if odd else "#ffffff", **spots))
        for beyond, edge, arrow in ((y > high, high, "^"), (y < low, low, "v")):
            at = np.full(int(beyond.sum()), edge)
            marks.append(Points(x[beyond], at, marker=arrow, size=3.6, clip=False, **look))
    return marks


def _model(some: Triplets, method: Identification, up: Axis) -> list[Mark]:
    """Return the decrement of a model, the band of the noise about it, and the cut at 12°."""
    level, (floor, _) = _delta(method), up.ends or (-math.inf, math.inf)
    order = np.argsort(some.size)
    wide = Z95 * some.stderr[order]
    level = abs(level) if up.scale == "log" else level
    low, high = np.maximum(level - wide, floor), level + wide
    noise = NOISE_SAID if np.any(wide > 0) else ""
    name = f"δ of {look(method.method).label} = {level:.3g}"
    return [
        Level(level, colour=MEASURED, width=1.0, dash="--", name=name),
        Level(CUT, axis="x", colour=QUIET, dash=":", name="12°"),
        Band(some.size[order], low, high, colour=NOISE, alpha=0.7, order=1.0, name=noise),
    ]
