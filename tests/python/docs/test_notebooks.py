"""Notebooks run, and the stored ones have outputs without errors."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
LARGEST = 400_000  # bytes
named = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def cells(path: Path) -> list[dict[str, Any]]:
    """Return the code cells of a notebook."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return [cell for cell in content["cells"] if cell["cell_type"] == "code"]


def test_there_are_notebooks() -> None:
    assert len(NOTEBOOKS) >= 6


@pytest.mark.manual
@named
def test_a_notebook_runs_without_an_error(path: Path) -> None:
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = runpy.run_path(str(FOLDER / "run.py"))["executed"](path)
    kinds = {out["output_type"] for cell in notebook.cells for out in cell.get("outputs", [])}
    assert "error" not in kinds


@named
def test_a_stored_notebook_was_run_from_top_to_bottom(path: Path) -> None:
    counts = [cell["execution_count"] for cell in cells(path)]
    assert counts == list(range(1, len(counts) + 1))


@named
def test_a_stored_notebook_has_outputs_and_no_errors(path: Path) -> None:
    outputs = [out for cell in cells(path) for out in cell["outputs"]]
    assert any("image/png" in out.get("data", {}) for out in outputs)
    for out in outputs:
        assert out["output_type"] != "error"
        assert out.get("name") != "stderr", out["text"]


@named
def test_a_stored_notebook_is_small_and_names_no_folder_of_a_machine(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert path.stat().st_size < LARGEST
    assert not re.search(r"/(tmp|home|root|work|Users)/|[A-Z]:\\\\", text)


@named
def test_a_notebook_uses_the_public_names_alone(path: Path) -> None:
    code = "".join(line for cell in cells(path) for line in cell["source"])
    assert not re.search(r"from pendmap\.|import pendmap\.|pendmap\.\w+\._|_core", code)
