"""The recipes of docs/cells.md run, and give what they say."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

import pendmap

pytestmark = pytest.mark.manual

PAGE = Path(__file__).resolve().parents[3] / "docs" / "cells.md"
HEAD, *PARTS = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
CELLS = {
    part.splitlines()[0]: re.findall(r"^```python\n(.*?)^```", part, re.MULTILINE | re.DOTALL)
    for part in PARTS
}


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the records that the page asks for."""
    folder = tmp_path_factory.mktemp("cells")
    for line in re.findall(r"^pendmap (.*)$", HEAD, flags=re.MULTILINE):
        words = [sys.executable, "-m", "pendmap", *shlex.split(line)]
        subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=600)
    return folder


class Cell:
    """Runs a cell of the page by its title; keeps what it printed."""

    def __init__(self) -> None:
        self.printed = ""

    def __call__(self, title: str) -> dict[str, Any]:
        """Return the names that the cell defines."""
        (code,) = CELLS[title]
        names: dict[str, Any] = {}
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(code, names)  # noqa: S102 (our own page)
        self.printed = out.getvalue()
        return names


@pytest.fixture
def cell(records: Path, monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401 (a generator)
    """Return a function that runs a cell in the folder with the records."""
    monkeypatch.chdir(records)
    with mpl.rc_context():
        yield Cell()
    plt.close("all")


def test_there_are_sixteen_short_cells_and_each_has_a_test() -> None:
    tests = Path(__file__).read_text(encoding="utf-8")
    assert len(CELLS) == 16
    for title, blocks in CELLS.items():
        (code,) = blocks
        lines = [line for line in code.splitlines() if line and "import" not in line]
        assert len(lines) <= 8, title
        assert f'cell("{title}")' in tests


def test_results_are_drawn_into_the_given_subplots(cell: Cell) -> None:
    names = cell("Draw results into subplots")
    assert names["left"].get_xlabel()
    assert names["right"].get_title() == "periods to settle"


def test_shares_in_a_loop_have_the_names_of_attractors(cell: Cell) -> None:
    cell("Loop over the drive's amplitude")
    first, second, _ = cell.printed.splitlines()
    assert first == "0.4 {'oscillation 2:0': 1.0}"
    assert second.startswith("0.6 {'oscillation 2:0': 0.8")
    assert "'rotation 1:-1'" in second


def test_a_trajectory_is_a_table_over_time(cell: Cell) -> None:
    names = cell("A trajectory as a DataFrame")
    table = names["table"]
    assert list(table.columns) == ["theta", "velocity", "energy"]
    assert table.index.name == "time"
    energy = table.velocity**2 / 2 + 1 - np.cos(table.theta)
    np.testing.assert_allclose(table.energy, energy, atol=1e-12)
    assert cell.printed.splitlines()[0].split() == ["theta", "velocity", "energy"]


def test_maps_of_other_processes_are_those_of_this_one(cell: Cell) -> None:
    names = cell("Many maps with joblib")
    own = pendmap.basins(names["models"][1], 40, run=pendmap.RunOptions(threads=1))
    np.testing.assert_array_equal(names["maps"][1].label, own.label)


def test_identified_parameters_are_those_of_the_rig(cell: Cell) -> None:
    names = cell("Identify the damping")
    report, theta = names["report"], names["theta"]
    table = report.to_dataframe()
    assert list(table.columns) == ["value", "stderr", "low", "high", "unit"]
    assert (table.low <= table.value).all()
    assert table.unit["c_over_m"] == "1/s"
    correlation = report.correlation
    np.testing.assert_allclose(np.diag(correlation), 1.0)
    np.testing.assert_allclose(correlation, correlation.T, atol=1e-12)
    assert np.isfinite(np.asarray(theta)).all()
    assert "c_over_m" in cell.printed


def test_a_reopened_result_has_its_model(cell: Cell) -> None:
    names = cell("Save a result and open it again")
    assert pendmap.pendulum_of(names["result"]) == pendmap.Pendulum(p=0.6)
    assert cell.printed.startswith("Pendulum(gamma=0.1, p=0.6, omega=2.0")


def test_a_selected_cell_of_a_map_has_the_attractors_of_its_model(cell: Cell) -> None:
    names = cell("Select from a parameter map")
    model = pendmap.pendulum_of(names["cell"])
    assert model == pendmap.Pendulum(p=1.0, omega=2.0)
    found = pendmap.basins(model, 60)
    assert int(names["cell"].attractors) == found.attractor.size
    assert float(names["cell"].exponent) == pytest.approx(float(found.exponent.max()), abs=1e-6)


def test_exponents_are_positive_where_the_diagram_has_chaos(cell: Cell) -> None:
    result = cell("The exponent against the amplitude")["result"]
    p = result.p.values[result.entry_cell.values]
    exponent = result.entry_exponent.values
    assert exponent[p < 1.3].max() < 0
    assert exponent[p > 1.95].max() > 0.2


def test_scipy_follows_the_trajectory_to_its_tolerance(cell: Cell) -> None:
    cell("Compare with scipy")
    assert float(cell.printed) < 1e-9


def test_a_bar_follows_a_map_to_its_end(cell: Cell) -> None:
    names = cell("A bar while it computes")
    assert callable(names["run"].progress)
    plain = pendmap.basins(pendmap.Pendulum(p=1.7), 200)
    np.testing.assert_array_equal(names["result"].label, plain.label)


def test_the_accessor_draws_the_part_that_is_asked_for(cell: Cell) -> None:
    ax = cell("Draw by the accessor")["ax"]
    assert "rad" in ax.get_xlabel()
    assert ax.get_title() == "phase plane"


def test_many_starts_have_a_dimension(cell: Cell) -> None:
    names = cell("Many starts at once")
    runs = names["runs"]
    assert runs.theta.sizes == {"start": 5, "time": 201}
    one = pendmap.simulate(pendmap.Pendulum(p=0.0), names["starts"][2], 0.0, t_eval=runs.time)
    np.testing.assert_allclose(runs.theta.isel(start=2), one.theta, atol=1e-8)


def test_the_cells_of_a_window_are_at_the_given_places(cell: Cell) -> None:
    result = cell("A window of one's own")["result"]
    np.testing.assert_allclose(result.theta, np.linspace(-0.5, 0.5, 80), atol=1e-12)
    np.testing.assert_allclose(result.velocity, np.linspace(0.8, 1.6, 60), atol=1e-12)


def test_the_identified_pendulum_is_mapped_in_its_units(cell: Cell) -> None:
    names = cell("Map the pendulum that was identified")
    result = names["result"]
    assert result.attrs["units"] == "SI"
    assert float(abs(result.velocity).max()) == pytest.approx(3 * names["rig"].w0, rel=0.05)
    assert float(result.fraction.sum()) > 0.9


def test_the_diagnosis_names_the_effect_that_was_hidden(cell: Cell) -> None:
    found = cell("What the model lacks, as a table")["found"]
    assert cell.printed.splitlines()[0] == "named"
    assert "quadratic_drag.q" in found.to_dataframe().index
    assert "quadratic_drag" in found.ranking.head(3).index


def test_a_figure_of_a_column_is_86_mm_wide(cell: Cell) -> None:
    names = cell("A figure for a journal's column")
    assert names["fig"].get_figwidth() == pytest.approx(86 / 25.4)
    assert names["ax"].get_title() == ""
    assert Path("column.pdf").stat().st_size > 0
