"""Chart of a decay record with its half cycles: angle, velocity and its sign (figure 4)."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import NONE, ZERO, Areas, Line, Mark, Points, bars
from pendmap.charts.methods import EVEN, MEASURED, ODD
from pendmap.charts.record import UNUSED
from pendmap.formatting import typographic
from pendmap.signal.robust import Z95
from pendmap.units import Units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.charts.marks import Ends, Floats
    from pendmap.identification import IdentificationReport, Peaks
    from pendmap.records import Run

TITLE: Final = "The record and its half cycles"
NEAR: Final = 6  # Number of half cycles of a close view
POINTS: Final = 500  # Number of points of a close view at which the velocity is computed
SPAN: Final = 0.2  # Half width of the stretch of a cubic fit, over the length of a half cycle


@dataclasses.dataclass(frozen=True)
class Course:
    """A record relative to the turn in which it comes to rest."""

    time: Floats
    theta: Floats
    half: NDArray[np.int64]
    other_time: Floats
    other_theta: Floats


def course_of(run: Run, peaks: Peaks) -> Course:
    """Return a run's samples with the numbers of their half cycles."""
    good = run.trusted
    time, theta = run.time[good], run.theta[good]
    away = 0.0
    if len(peaks):
        at = np.interp(peaks.time, time, theta) - peaks.amplitude
        away = math.tau * round(float(np.median(at)) / math.tau)
    # Before the first peak and from the last one on there is no half cycle.
    of_peak = np.where(np.diff(peaks.index) == 1, peaks.index[:-1], -1)
    half = np.array([-1, *of_peak, -1])[np.searchsorted(peaks.time, time, side="right")]
    return Course(time, theta - away, half, run.time[~good], run.theta[~good] - away)


def first_and_last(peaks: Peaks, count: int = NEAR) -> list[tuple[float, float]]:
    """Return the spans of the first and the last half cycles; one span if these are all."""
    time = peaks.time
    if time.size <= 2 * count + 1:
        return [(float(time[0]), float(time[-1]))]
    return [(float(time[0]), float(time[count])), (float(time[-1 - count]), float(time[-1]))]


def part(report: IdentificationReport) -> Chart:
    """Return the whole record, and angle, velocity and its sign at the first and the last peaks."""
    run, peaks = report.run, report.peaks
    course = course_of(run, peaks)
    few = len(peaks) < 3  # noqa: PLR2004 (a half cycle on either side)
    whole = _whole(course, peaks, thin=few or not run.peaks_only)
    if few:
        return Chart(TITLE, "", [[whole]], size=(8.6, 2.4))
    spans = first_and_last(peaks)
    titles = ["the first half cycles", "the last half cycles"][: len(spans)]
    titles = titles if len(spans) > 1 else ["all of them"]
    columns = [_near(report, course, *one) for one in zip(titles, spans, strict=True)]
    # Peaks alone have no velocity.
    middle, last, high = ([1.0], 0.35, 4.6) if run.peaks_only else ([1.0, 0.8], 0.28, 5.6)
    rows = [[whole], *zip(*columns, strict=True)]
    return Chart(TITLE, "", rows, heights=(1.1, *middle, last), size=(8.6, high))


def _whole(course: Course, peaks: Peaks, *, thin: bool) -> Panel:
    """Return the whole record, as a line if ``thin``, else as its peaks alone."""
    cross: dict[str, Any] = {"marker": "|", "edge_width": 1.2, "name": "crossings of zero"}
    circle: dict[str, Any] = {"fill": "#ffffff", "edge_width": 0.9, "name": "peaks"}
    marks: list[Mark] = [
        Line(NONE, NONE, colour=EVEN, width=2.0, name="even half cycles"),
        Line(NONE, NONE, colour=ODD, width=2.0, name="odd half cycles"),
        Points(NONE, NONE, colour=MEASURED, size=4.5, **circle),
        Points(course.other_time, course.other_theta, colour=UNUSED, size=1.2),
    ]
    if peaks.crossing_time.size:
        marks.append(Points(NONE, NONE, colour=MEASURED, size=7.0, **cross))
    if thin:
        marks += _coloured(course.time, course.theta, course.half, 0.6)
    marks += _peaks(peaks, 1.6 if thin else 3.0, by_parity=not thin)
    theta = np.concatenate([course.theta, course.other_theta])
    more = "; grey: not for fitting" if course.other_time.size else ""
    title = f"the whole record, {len(peaks)} peaks{more}"
    clock = names.seconds(np.concatenate([course.time, course.other_time]))
    return Panel("whole", title, clock, names.angle(holding(theta)), marks)


def _near(report: IdentificationReport, course: Course, title: str, span: Ends) -> list[Panel]:
    """Return angle, velocity and its sign over a span, from top to bottom."""
    run, peaks = report.run, report.peaks
    ends = holding(span, margin=0.02)
    bare = Axis("", ends, ticks=())
    angle, values = _angle(course, peaks, ends, only=run.peaks_only)
    panels = [Panel("angle", title, bare, names.angle(holding(values)), angle)]
    if not run.peaks_only:
        time, half, speed = _velocity(run, course, peaks, ends)
        up = names.angle(holding(speed), names.speed(Units(si=True)))
        marks = [*_coloured(time, speed, half, 1.1), ZERO]
        panels.append(Panel("velocity", "", bare, up, marks))
    signs = Axis("sign", (-1.35, 1.35), ticks=[(-1, typographic("-1")), (0, "0"), (1, "1")])
    return [*panels, Panel("sign", "", Axis(names.TIME, ends), signs, _sign(peaks))]


def _coloured(time: Floats, values: Floats, half: NDArray[np.int64], width: float) -> list[Mark]:
    """Return a curve with each half cycle in the colour of its parity, the rest in grey."""
    marks: list[Mark] = []
    for which, colour in (
        (half < 0, UNUSED),
        ((half >= 0) & (half % 2 == 0), EVEN),
        ((half >= 0) & (half % 2 == 1), ODD),
    ):
        # One more sample at the end joins the pieces.
        shown = which | np.concatenate([[False], which[:-1]])
        marks.append(Line(time, np.where(shown, values, np.nan), colour=colour, width=width))
    return marks


def _peaks(peaks: Peaks, size: float, *, by_parity: bool = False) -> list[Mark]:
    look: dict[str, Any] = {"fill": "#ffffff", "edge_width": 0.4 + 0.11 * size, "order": 4.0}
    return [
        Points(
            peaks.time[peaks.odd == odd],
            peaks.amplitude[peaks.odd == odd],
            colour=colour if by_parity else MEASURED,
            size=size,
            **look,
        )
        for odd, colour in ((False, EVEN), (True, ODD))
    ]


def _within(time: Floats, ends: Ends) -> NDArray[np.bool_]:
    return (time >= ends[0]) & (time <= ends[1])


def _angle(course: Course, peaks: Peaks, ends: Ends, *, only: bool) -> tuple[list[Mark], Floats]:
    """Return the angle with its peaks, their 95 % intervals and zero crossings, and all angles."""
    near, some = _within(course.time, ends), peaks.select(_within(peaks.time, ends))
    wide = Z95 * some.stderr_amplitude
    cross = peaks.crossing_time[_within(peaks.crossing_time, ends)]
    marks: list[Mark] = []
    if not only:
        marks += _coloured(course.time[near], course.theta[near], course.half[near], 1.1)
    lines = bars(some.time, some.amplitude - wide, some.amplitude + wide)
    marks += [
        Line(*lines, colour=MEASURED, width=0.8, order=3.0),
        *_peaks(some, 4.5, by_parity=only),
        ZERO,
        Points(cross, 0 * cross, colour=MEASURED, marker="|", size=8.0, edge_width=1.2),
    ]
    return marks, np.concatenate([course.theta[near], some.amplitude])


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
    low = np.searchsorted(course.time, time - reach)
    high = np.searchsorted(course.time, time + reach, side="right")
    for k, (a, b) in enumerate(zip(low, high, strict=True)):
        if b - a >= 5:  # noqa: PLR2004 (one more than a cubic has)
            scaled = (course.time[a:b] - time[k]) / reach
            powers = np.vander(scaled, 4, increasing=True)
            speed[k] = np.linalg.lstsq(powers, course.theta[a:b], rcond=None)[0][1] / reach
    return time, half, speed


def _sign(peaks: Peaks) -> list[Mark]:
    """Return the sign of the velocity, that of the change from each peak to the next."""
    marks: list[Mark] = [ZERO]
    for parity, colour in ((0, EVEN), (1, ODD)):
        whole = np.flatnonzero((np.diff(peaks.index) == 1) & (peaks.index[:-1] % 2 == parity))
        sign = np.sign(peaks.amplitude[whole + 1] - peaks.amplitude[whole])
        begin, end, none = peaks.time[whole], peaks.time[whole + 1], np.zeros(whole.size)
        corners = np.array([(begin, none), (end, none), (end, sign), (begin, sign)])
        marks.append(Areas(list(corners.transpose(2, 0, 1)), colour=colour, alpha=0.85))
    return marks
