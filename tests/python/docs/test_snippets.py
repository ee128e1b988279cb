"""Recipes, notebooks and the gallery run; what is stored of them is whole."""

from __future__ import annotations

import contextlib
import io
import json
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

DOCS = Path(__file__).resolve().parents[3] / "docs"
GALLERY = runpy.run_path(str(DOCS / "pictures" / "gallery.py"))
SNIPPETS = GALLERY["snippets"]()
NOTEBOOKS = sorted(DOCS.glob("notebooks/*.ipynb"))
LARGEST = {".png": 200_000, ".ipynb": 400_000}  # bytes
HEAD, *PARTS = re.split(r"^## ", (DOCS / "cells.md").read_text("utf-8"), flags=re.MULTILINE)
CELLS = {
    part.splitlines()[0]: re.findall(r"^```python\n(.*?)^```", part, re.MULTILINE | re.DOTALL)
    for part in PARTS
}
CHECKS = {
    "Draw results into subplots": "right.get_title() == 'periods to settle' and left.get_xlabel()",
    "Loop over the drive's amplitude": "printed[:28] == \"0.4 {'oscillation 2:0': 1.0}\"",
    "A trajectory as a DataFrame": (
        "np.ptp(table.velocity**2 / 2 + 1 - np.cos(table.theta) - table.energy) < 1e-12"
    ),
    "Many maps with joblib": "(maps[1].label == pendmap.basins(models[1], 40).label).all()",
    "Identify the damping": (
        "np.allclose(np.diag(report.correlation), 1.0) and np.isfinite(theta).all()"
        " and report.to_dataframe().unit['c_over_m'] == '1/s'"
    ),
    "Save a result and open it again": "pendmap.pendulum_of(result) == pendmap.Pendulum(p=0.6)",
    "Select from a parameter map": (
        "pendmap.pendulum_of(cell) == pendmap.Pendulum(p=1.0, omega=2.0)"
        " and abs(cell.exponent - pendmap.basins(pendmap.Pendulum(), 60).exponent.max()) < 1e-6"
    ),
    "The exponent against the amplitude": (
        "result.entry_exponent[result.p.values[result.entry_cell] > 1.95].max() > 0.2"
    ),
    "Compare with scipy": "float(printed) < 1e-9",
    "A bar while it computes": "callable(run.progress) and result.label.size > 0",
    "Draw by the accessor": "ax.get_title() == 'phase plane'",
    "Many starts at once": "runs.theta.sizes == {'start': 5, 'time': 201}",
    "A window of one's own": "np.allclose(result.theta, np.linspace(-0.5, 0.5, 80), atol=1e-12)",
    "Map the pendulum that was identified": (
        "abs(abs(result.velocity).max() / (3 * rig.w0) - 1) < 0.05 and result.fraction.sum() > 0.9"
    ),
    "What the model lacks, as a table": (
        "printed.startswith('named') and 'quadratic_drag' in found.ranking.head(3).index"
    ),
    "A figure for a journal's column": "abs(fig.get_figwidth() - 86 / 25.4) < 1e-9",
}
"""What holds after each cell, in its names; ``printed`` is what it prints."""


@pytest.fixture(scope="module")
def cell_records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the records that the page asks for."""
    folder = tmp_path_factory.mktemp("cells")
    for line in re.findall(r"^pendmap (.*)$", HEAD, flags=re.MULTILINE):
        words = [sys.executable, "-m", "pendmap", *shlex.split(line)]
        subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=600)
    return folder


def test_there_are_sixteen_short_cells_and_each_has_a_check() -> None:
    assert list(CELLS) == list(CHECKS)
    assert len(CELLS) == 16
    for title, blocks in CELLS.items():
        (code,) = blocks
        lines = [line for line in code.splitlines() if line and "import" not in line]
        assert len(lines) <= 8, title


@pytest.mark.manual
@pytest.mark.parametrize("title", CELLS)
def test_a_cell_gives_what_it_says(
    title: str, cell_records: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(cell_records)
    names: dict[str, Any] = {"np": np}
    with mpl.rc_context(), contextlib.redirect_stdout(io.StringIO()) as out:
        exec(CELLS[title][0], names)  # noqa: S102 (our own page)
        names["printed"] = out.getvalue()
        assert eval(CHECKS[title], names)  # noqa: S307 (our own check)
    plt.close("all")


@pytest.mark.manual
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_without_an_error(path: Path) -> None:
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = runpy.run_path(str(path.parent / "run.py"))["executed"](path)
    kinds = {out["output_type"] for cell in notebook.cells for out in cell.get("outputs", [])}
    assert "error" not in kinds


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_stored_notebook_has_all_outputs_and_no_secrets_of_a_machine(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    outputs = [out for cell in cells for out in cell["outputs"]]
    assert any("image/png" in out.get("data", {}) for out in outputs)
    for out in outputs:
        assert out["output_type"] != "error"
        assert out.get("name") != "stderr", out["text"]
    assert len(text) < LARGEST[".ipynb"]
    assert not re.search(r"/(tmp|home|root|work|Users)/|[A-Z]:\\\\", text)
    code = "".join(line for cell in cells for line in cell["source"])
    assert not re.search(r"from pendmap\.|import pendmap\.|pendmap\.\w+\._|_core", code)


def test_what_a_page_cites_or_names_exists() -> None:
    bibliography = "".join(path.read_text(encoding="utf-8") for path in DOCS.glob("*.bib"))
    entries = set(re.findall(r"^@\w+\{([^,]+),", bibliography, re.MULTILINE))
    for page in (*DOCS.glob("*.md"), *(DOCS / "theory").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        for keys in re.findall(r"\{cite:p\}`([^`]+)`", text):
            assert {key.strip() for key in keys.split(",")} <= entries, keys
        for name in re.findall(r"`((?:src|tests|benchmarks|python)/[\w/.]+)`", text):
            assert (DOCS.parent / name).exists(), name


def test_every_picture_of_the_gallery_has_a_snippet_and_is_small() -> None:
    pictures = {path.name: path.stat().st_size for path in DOCS.glob("pictures/gallery_*.png")}
    assert set(pictures) == set(SNIPPETS)
    assert max(pictures.values()) < LARGEST[".png"]


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the folders with the records that snippets of the gallery read."""
    folders: dict[str, Path] = GALLERY["experiments"](tmp_path_factory.mktemp("gallery"))
    return folders


@pytest.mark.manual
@pytest.mark.parametrize("name", SNIPPETS)
def test_a_snippet_of_the_gallery_draws_a_figure(name: str, records: dict[str, Path]) -> None:
    with mpl.rc_context():
        plt.style.use("pendmap.figures")
        figure = GALLERY["draw"](SNIPPETS[name], records)
    assert any(ax.has_data() for ax in figure.axes)
    plt.close("all")
