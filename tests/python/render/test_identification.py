"""Charts of an identification, and its representation in a notebook."""

from __future__ import annotations

import dataclasses
import functools
import math
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from decays import decay, record
from drawn import named, written
from pendmap import render
from pendmap.charts import half_cycles, identification, marks
from pendmap.comparison import compare
from pendmap.identification import IdentificationReport, Peaks, identify
from pendmap.identification.methods.combined import recursion
from pendmap.records import Experiment, Run

OFFSET = math.radians(0.05)
PANELS = ["record", "fit", "residual", "envelope"]
SIZES = recursion(0.2, 0.004, 0.002, 30)
SIGN = (-1.0) ** np.arange(30)


@functools.cache
def report(
    seconds: float = 85.0, offset: float = OFFSET, rate: float = 100.0, release: float = 3.0
) -> IdentificationReport:
    made = decay(release=release)
    time, theta = record(made, seconds=seconds, rate=rate, offset=offset)
    run = Run("a<b", "run.csv", "free", time, theta, np.ones(time.size, bool))
    return identify(Experiment(Path("run.csv"), (run,)))


def test_a_zero_error_makes_triplets_alternate_until_it_is_removed() -> None:
    peaks = Peaks.of(np.arange(30.0), SIZES * SIGN + OFFSET)
    raw = half_cycles.triplets_of(peaks)
    assert np.all(raw.delta[raw.odd] < 0)
    assert np.all(raw.delta[~raw.odd] > 0.05)
    without = half_cycles.triplets_of(peaks, OFFSET)
    assert without.delta == pytest.approx(0.004, abs=1e-10)
    assert list(without.odd[:3]) == [False, True, False]


def test_the_errors_of_triplets_are_those_of_repeated_readings() -> None:
    rng = np.random.default_rng(3)
    peaks = Peaks.of(np.arange(30.0), SIZES * SIGN)
    errors = np.full(30, 1e-4)
    triplets = half_cycles.triplets_of(dataclasses.replace(peaks, stderr_amplitude=errors))
    drawn = [
        half_cycles.triplets_of(
            Peaks.of(np.arange(30.0), SIZES * SIGN + 1e-4 * rng.standard_normal(30))
        ).delta
        for _ in range(2000)
    ]
    assert np.std(drawn, axis=0) == pytest.approx(triplets.stderr, rel=0.1)


def test_half_cycles_are_numbered_by_their_peaks() -> None:
    for whole in (report(), report(offset=2 * math.tau)):
        course = half_cycles.Course.of(whole.run, whole.peaks)
        assert abs(float(np.mean(course.theta))) < 0.1
        # Between an odd peak, which is negative here, and the next one the angle increases.
        inner = course.half == 7
        assert np.sum(inner) > 40
        assert course.theta[inner][-1] > course.theta[inner][0]


def test_the_velocity_of_a_record_with_few_samples_a_half_cycle_is_drawn() -> None:
    rough = report(seconds=40.0, rate=21.0, release=1.0)
    first = next(panel for panel in half_cycles.part(rough).panels if panel.name == "velocity")
    speeds = [mark.y for mark in first.marks if isinstance(mark, marks.Line)]
    fastest = np.nanmax(np.abs(np.concatenate(speeds)))
    # Energy of the largest swing, without damping.
    largest = 2 * rough.best.rig.w0 * math.sin(float(np.abs(rough.peaks.amplitude).max()) / 2)
    assert fastest == pytest.approx(largest, rel=0.1)


def test_only_methods_that_apply_are_drawn_and_the_table_has_their_estimates() -> None:
    short = report(seconds=15.0, offset=0.0)
    assert [p.name for p in identification.sheet(short).panels] == PANELS
    assert not {"log decrement", "energy balance"} & set(named(render.figure_of(short)))
    figure = render.figure_of(short, layer="all")
    names = named(figure)
    assert "trajectory" in names
    assert not {"log decrement", "combined, as printed"} & set(names)
    assert "not applicable" in written(figure)
    (table, *_) = identification.table(report()).panels[0].marks
    assert isinstance(table, marks.Table)
    assert table.rows[0][0] == "trajectory"
    assert float(table.rows[0][1].partition("(")[0]) == pytest.approx(6.2, abs=1e-3)


def rows(page: str) -> list[list[str]]:
    """Return the cells of all tables of a page, which must be well formed."""
    whole = ET.fromstring(f"<page>{page.replace('<br>', '')}</page>")  # noqa: S314 (our own page)
    return [[cell.text or "" for cell in row] for row in whole.iter("tr")]


def test_in_a_notebook_a_result_is_a_line_and_its_tables_without_arrays() -> None:
    whole = report()
    assert repr(whole).startswith("<IdentificationReport a<b: trajectory: w0 = 6.")
    assert repr(whole).endswith("; 6 methods, 1 run>")
    text, shown = str(whole), rows(whole._repr_html_())
    assert "Tr (rad/s^2)" in text
    assert "array(" not in text
    assert shown[0][:3] == ["method", "w0 (rad/s)", "c/m (1/s)"]
    assert [row[0] for row in shown[1:7]] == list(whole.methods)
    assert shown[1][1] in text
    comparison = compare(whole.model, Experiment(Path("lab"), (whole.run,)))
    assert repr(comparison).startswith("<Comparison lab: 1 run, rms ")
    assert [row[0] for row in rows(comparison._repr_html_())[:2]] == ["run", "a<b"]
