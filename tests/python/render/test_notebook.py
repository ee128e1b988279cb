"""Representations of results in a notebook: a line and a table, no arrays."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from decays import decay, record
from pendmap import Rig
from pendmap.comparison import compare
from pendmap.formatting import Readable
from pendmap.identification import identify
from pendmap.records import Experiment, Run

TIME, ANGLE = record(decay(release=1.0, until=40.0), seconds=20)
TRUSTED = np.ones(TIME.size, bool)
RUNS = tuple(Run(name, f"{name}.csv", "free", TIME, ANGLE, TRUSTED) for name in ("a<b", "c"))
THERE = Experiment(Path("lab"), RUNS[:1])


def rows(page: str) -> list[list[str]]:
    """Return the cells of all tables of a page, which must be well formed."""
    whole = ET.fromstring(f"<page>{page.replace('<br>', '')}</page>")  # noqa: S314 (our own page)
    return [[cell.text or "" for cell in row] for row in whole.iter("tr")]


def test_an_identification_is_a_line_and_its_tables() -> None:
    report = identify(THERE)
    line = repr(report)
    assert line.startswith("<IdentificationReport a<b: trajectory: w0 = 6.1999")
    assert line.endswith("; 8 methods, 1 run>")
    assert len(line) < 200
    text = str(report)
    assert "Tr (rad/s^2)" in text
    assert "array(" not in text
    shown = rows(report._repr_html_())
    assert shown[0][:3] == ["method", "w0 (rad/s)", "c/m (1/s)"]
    assert [row[0] for row in shown[1:9]] == list(report.methods)
    assert shown[1][1] in text
    assert repr(report.methods["trajectory"]).startswith("<Identification trajectory: w0 = 6.1999")
    assert "3 are needed" in repr(report.methods["de_paula"])


def test_a_comparison_is_a_line_and_its_table() -> None:
    found = compare(Rig(w0=6.2, c_over_m=0.0496, Tr=0.08), Experiment(Path("lab"), RUNS))
    assert repr(found).startswith("<Comparison lab: 2 runs, rms up to 0.9")
    assert repr(found.runs[0]).startswith("<RunComparison a<b: rms 0.001")
    shown = rows(found._repr_html_())
    assert [row[0] for row in shown if row[0][:1] in "rabc"] == ["run", "a<b", "c"]
    assert str(found).splitlines()[1].split()[0] == "a<b"


def test_columns_are_as_wide_as_they_need() -> None:
    class Result(Readable):
        def text_parts(self) -> tuple[list[tuple[list[str], list[list[str]]]], list[str]]:
            return [(["a", "long"], [["123", "x"], ["4", "y"]]), (["none"], [])], ["end & <more>"]

    assert str(Result()) == "a    long\n123  x\n4    y\n\nend & <more>"
    assert "end &amp; &lt;more&gt;" in Result()._repr_html_()
    with pytest.raises(TypeError):
        Readable()  # type: ignore[abstract]
