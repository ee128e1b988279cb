"""The figure of an identification: its content for each kind of record, and room for all text."""

from __future__ import annotations

import dataclasses
import functools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.legend import Legend
from matplotlib.text import Text

import pendmap
from decays import decay, record
from drawn import assert_room
from pendmap.charts import chart as charts
from pendmap.charts import half_cycles, identification, marks, palette
from pendmap.charts.names import signed
from pendmap.formatting import estimate_text, typographic
from pendmap.identification import Estimate, IdentificationReport, Peaks, identify
from pendmap.identification.methods.combined import recursion
from pendmap.paper import pendulum
from pendmap.records import Experiment, Run
from pendmap.render import drawing, style

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

OFFSET = math.radians(0.05)


def as_report(time: Any, theta: Any, **given: Any) -> IdentificationReport:  # noqa: ANN401
    run = Run("run", "run.csv", "free", time, theta, np.ones(time.size, bool), **given)
    return identify(Experiment(Path("run.csv"), (run,)))


def peaks_of(count: int | None) -> IdentificationReport:
    made = decay()
    return as_report(made.peak_time[:count], made.peak[:count], peaks_only=True)


RECORDS: dict[str, Callable[[], IdentificationReport]] = {
    "whole": lambda: as_report(*record(decay(), offset=OFFSET, counts=4096)),
    "ends above 12 degrees": lambda: as_report(*record(decay(), seconds=15.0)),
    "rests two turns away": lambda: as_report(*record(decay(), seconds=85.0, offset=2 * math.tau)),
    "short": lambda: as_report(*record(decay(release=1.0), seconds=1.2)),
    "still": lambda: as_report(np.arange(300) / 100, 1e-3 * np.sin(np.arange(300)) ** 3),
    "peaks": lambda: peaks_of(None),
    "four peaks": lambda: peaks_of(4),
    "two peaks": lambda: peaks_of(2),
}


@functools.cache
def report(name: str) -> IdentificationReport:
    return RECORDS[name]()


@functools.cache
def drawn(name: str, size: tuple[float, float] | None = None, **given: Any) -> Figure:  # noqa: ANN401
    with rc_context(style.RC):
        sheet = identification.sheet(report(name), **given)
        figure = drawing.draw(sheet, size=size, dpi=100.0)
        figure.canvas.draw()
    return figure


@pytest.mark.parametrize("name", RECORDS)
def test_no_text_is_cut_or_covered(name: str) -> None:
    assert_room(drawn(name))


@pytest.mark.parametrize("part", list(identification.PARTS))
def test_every_part_is_drawn_alone(part: str) -> None:
    assert_room(drawn("ends above 12 degrees", parts=(part,), title="Figure", subtitle=""))


@pytest.mark.parametrize("size", [(4.0, 4.0), (16.0, 12.0)])
def test_text_has_room_in_any_size(size: tuple[float, float]) -> None:
    figure = drawn("whole", size=size)
    assert tuple(figure.get_size_inches()) == size
    assert_room(figure)


def test_unknown_parts_are_refused() -> None:
    with pytest.raises(pendmap.InputError, match="must be among record, decrement"):
        drawn("whole", parts=("decays",))


def test_the_pendulum_is_drawn() -> None:
    with rc_context(style.RC):
        figure = drawing.draw(pendulum.chart(), dpi=100.0)
        figure.canvas.draw()
    assert_room(figure)


def test_a_zero_error_makes_triplets_alternate_until_it_is_removed() -> None:
    sizes = recursion(0.2, 0.004, 0.002, 30)
    peaks = Peaks.of(np.arange(30.0), sizes * (-1.0) ** np.arange(30) + OFFSET)
    raw = half_cycles.triplets_of(peaks)
    assert np.all(raw.delta[raw.odd] < 0)
    assert np.all(raw.delta[~raw.odd] > 0.05)
    without = half_cycles.triplets_of(peaks, OFFSET)
    assert without.delta == pytest.approx(0.004, abs=1e-10)
    assert list(without.odd[:3]) == [False, True, False]


def test_the_errors_of_triplets_are_those_of_repeated_readings() -> None:
    rng = np.random.default_rng(3)
    sizes = recursion(0.2, 0.004, 0.002, 30)
    sign = (-1.0) ** np.arange(30)
    peaks = Peaks.of(np.arange(30.0), sizes * sign)
    found = half_cycles.triplets_of(dataclasses.replace(peaks, stderr_amplitude=np.full(30, 1e-4)))
    drawn_ = [
        half_cycles.triplets_of(
            Peaks.of(np.arange(30.0), sizes * sign + 1e-4 * rng.standard_normal(30))
        ).delta
        for _ in range(2000)
    ]
    assert np.std(drawn_, axis=0) == pytest.approx(found.stderr, rel=0.1)


def test_half_cycles_are_numbered_by_their_peaks() -> None:
    for name in ("whole", "rests two turns away"):
        found = report(name)
        course = half_cycles.Course.of(found.run, found.peaks)
        assert abs(float(np.mean(course.theta))) < 0.1
        # Between an odd peak, which is negative here, and the next one the angle increases.
        inner = course.half == 7
        assert np.sum(inner) > 40
        assert course.theta[inner][-1] > course.theta[inner][0]


def test_the_velocity_of_a_record_with_few_samples_a_half_cycle_is_drawn() -> None:
    found = as_report(*record(decay(release=1.0), seconds=40.0, rate=21.0))
    first = next(panel for panel in half_cycles.part(found).panels if panel.name == "velocity")
    speeds = [mark.y for mark in first.marks if isinstance(mark, marks.Line)]
    fastest = np.nanmax(np.abs(np.concatenate(speeds)))
    # Energy of the largest swing, without damping.
    largest = 2 * found.best.rig.w0 * math.sin(float(np.abs(found.peaks.amplitude).max()) / 2)
    assert fastest == pytest.approx(largest, rel=0.1)


def test_only_methods_that_apply_are_drawn() -> None:
    names = {
        text.get_text()
        for box in drawn("ends above 12 degrees").findobj(Legend)
        if isinstance(box, Legend)
        for text in box.get_texts()
    }
    assert "trajectory" in names
    assert not {"log decrement", "combined, as printed"} & names
    words = " ".join(
        t.get_text() for t in drawn("ends above 12 degrees").findobj(Text) if isinstance(t, Text)
    )
    assert "not applicable" in words
    printed = palette.drawn(["combined", "combined_odd_ends", "de_paula"])
    assert printed == ["combined", "de_paula"]
    assert palette.drawn(["combined_odd_ends", "de_paula"])[0] == "combined_odd_ends"


def test_the_table_has_the_estimates() -> None:
    found = report("whole")
    (table, *_) = identification.table(found).panels[0].marks
    assert isinstance(table, marks.Table)
    rows = table.rows
    assert {len(row) for row in rows} == {len(table.head)}
    assert rows[0][0] == "trajectory"
    assert float(rows[0][1].partition("(")[0]) == pytest.approx(6.2, abs=1e-3)
    said = typographic(estimate_text(Estimate(-0.0123456, 0.00123)))
    assert said == "\u22120.0123(12)"


@pytest.mark.parametrize("scale", [1e-9, 1e6])
@pytest.mark.parametrize("spread", [1.0, 1e3, 1e7])
def test_labels_over_many_powers_of_ten_have_room(scale: float, spread: float) -> None:
    near = scale * np.sin(np.arange(50.0))
    up, lines = signed([near, -near * spread], "error")
    panel = charts.Panel("error", "", charts.Axis("x", (0.0, 1.0)), up, lines)
    with rc_context(style.RC):
        chart = charts.Chart("Errors", "", [[panel]], size=(4.0, 2.5))
        figure = drawing.draw(chart, dpi=100.0)
        figure.draw_without_rendering()
    assert_room(figure)
    assert len([t for t in figure.axes[0].get_yticklabels() if t.get_text()]) >= 3
