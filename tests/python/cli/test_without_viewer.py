"""Commands where the extra pendmap[viewer] is not installed: neither rerun nor pyarrow."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import pytest

from conftest import Run, run_command

if TYPE_CHECKING:
    import subprocess
    from pathlib import Path


@pytest.fixture
def bare(tmp_path: Path) -> Run:
    """Return a function that runs `pendmap` in the folder `here`, with both packages hidden."""
    (tmp_path / "here").mkdir()
    hide = "import sys\nsys.modules |= dict.fromkeys(['rerun', 'pyarrow'])\n"
    (tmp_path / "sitecustomize.py").write_text(hide)
    run = functools.partial(run_command, tmp_path / "here")

    def go(*words: object, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        return run(*words, env={"PYTHONPATH": str(tmp_path)} | (env or {}))

    return go


@pytest.mark.parametrize(
    "words",
    [
        ("basins", "--p", 0.6, "--grid", 20),
        ("melnikov",),
        ("identify", "decay"),
    ],
)
def test_a_recording_by_default_is_left_out_and_named(
    bare: Run, tmp_path: Path, words: tuple[object, ...]
) -> None:
    if "decay" in words:
        assert bare("rig", "free_decay", "--out", "decay").returncode == 0
    before = set((tmp_path / "here").iterdir())
    run = bare(*words)
    assert (run.returncode, run.stderr) == (0, "")
    new = {path.name for path in set((tmp_path / "here").iterdir()) - before}
    result = f"{words[0]}.toml" if words[0] == "identify" else f"{words[0]}.nc"
    assert new == {result, f"{words[0]}.png"}
    said = [line for line in run.stdout.splitlines() if "viewer" in line]
    assert said == [f"Left out: {words[0]}.rrd, which needs the extra pendmap[viewer]"]
    assert "viewer" not in bare(*words, "--out", result).stdout  # nothing is left out


@pytest.mark.parametrize(
    "words",
    [
        ("basins", "--view"),
        ("simulate", "--live"),
        ("view", "x.rrd"),
        ("diagnose", "decay.csv", "--rerun", "x.rrd"),
    ],
)
def test_what_needs_the_viewer_is_refused_in_one_line(
    bare: Run, tmp_path: Path, words: tuple[str, ...]
) -> None:
    run = bare(*words)
    assert run.returncode == 2
    assert len(run.stderr.splitlines()) == 1
    assert "recordings and the viewer need the extra pendmap[viewer] (" in run.stderr
    assert run.stdout == ""
    assert list((tmp_path / "here").iterdir()) == []


def test_a_parquet_file_is_refused_in_one_line(bare: Run, tmp_path: Path) -> None:
    (tmp_path / "here" / "a.parquet").write_bytes(b"PAR1")
    run = bare("look", "a.parquet")
    assert run.returncode == 2
    text = "a.parquet: a Parquet file needs the extra pendmap[viewer] (pyarrow)"
    assert run.stderr.startswith(f"pendmap: {text}")
    assert len(run.stderr.splitlines()) == 1
