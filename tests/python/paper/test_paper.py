"""``pendmap paper``: the figures of the paper, by number."""

from __future__ import annotations

import csv
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner

from pendmap.cli.paper import command
from pendmap.paper import figures, motions

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run
    from pendmap import Rig


def test_a_figure_has_several_names() -> None:
    for name in ("4", "figure 4", "Figure_4", "fig.4", "fig4"):
        assert figures.wanted(name) == ["4"]
    assert figures.wanted("table 1") == figures.wanted("table1") == ["table1"]
    assert figures.wanted("all") == [*"123456789", "table1"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("0", "must be one of the paper's (1, 2, 3, 4, 5, 6, 7, 8, 9, table1 and all), got '0'"),
        ("all --plot a.png", "--plot must have one figure, it is one file"),
        ("3 --plot a.png --out there", "one of --plot and --out must be left out, got both"),
        ("3 --out nowhere/there", "nowhere/there: No such file or directory"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(
    pendmap_command: Run, tmp_path: Path, words: str, complaint: str
) -> None:
    run = pendmap_command("paper", *words.split())
    assert (run.returncode, run.stderr.count("\n")) == (2, 1)
    assert complaint in run.stderr
    assert not list(tmp_path.iterdir())


def test_one_figure(pendmap_command: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = pendmap_command("paper", "figure", "3", "--json")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == {"files": ["figure_3.png"]}
    assert [path.name for path in tmp_path.iterdir()] == ["figure_3.png"]
    monkeypatch.setattr(figures, "_COLUMNS", 12)
    assert figures.draw("1", tmp_path / "1.svg").stat().st_size > 10_000


def test_the_table_is_printed(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("paper", "table1", "--seed", 1, "--plot", "table.pdf")
    assert run.returncode == 0, run.stderr
    for words in ("trajectory", "log_decrement", "16.95 %", "Written: table.pdf, table.csv"):
        assert words in run.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["table.csv", "table.pdf"]
    with (tmp_path / "table.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["what"] for row in rows] == ["period", "period", "peak", "peak"]
    assert float(rows[2]["measured"]) == pytest.approx(1.2, abs=0.05)
    assert float(rows[2]["trajectory_percent"]) < 0.1 < float(rows[2]["combined_percent"])


@pytest.mark.thorough
def test_all_figures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motions, "SECONDS", 60.0)  # 2500 s take the rig minutes
    monkeypatch.setattr(motions, "TUMBLED", 30.0)
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke(command, ["all", "--out", "out", "--json"])
    assert run.exit_code == 0, run.output
    files = json.loads(run.stdout)["files"]
    names = [*(f"figure_{k}.png" for k in range(1, 10)), "table_1.csv"]
    assert files == [f"out/{name}" for name in names]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(names)
    assert all((tmp_path / name).stat().st_size > 300 for name in files)


def test_figure_2_is_persistent_tumbling_chaos_at_the_papers_points() -> None:
    """Each trajectory rotates both ways, never settles, and fills a section of dimension > 1."""
    runs = figures.tumbling(2000)
    points = [(1.03, 0.87), (1.7, 0.87), (1.5, 1.8)]
    assert [(run["p"].item(), run["omega"].item()) for run in runs] == points
    for run in runs:
        assert run["gamma"].item() == 0.1
        assert run.sizes["period"] == 1501
        turned = np.diff(np.round(run.theta.values[::48] / math.tau))
        assert (turned > 0).sum() > 50 < (turned < 0).sum()
        late = np.stack([run.section_theta.values, run.section_velocity.values], axis=1)[-1000:]
        cells = {tuple(cell) for cell in np.floor(late / 0.1).astype(int).tolist()}
        assert len(cells) > 200
    assert [len(row) for row in figures.tumbling_chart(runs).rows] == [3, 3, 3]


@pytest.fixture(scope="module")
def model() -> Rig:
    return figures.report(0).methods["combined_repaired"].rig


@pytest.mark.thorough
def test_figure_8_compares_steady_states_of_the_requested_kinds(
    model: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rig and model reach the same two oscillations of period 2 and two rotations."""
    monkeypatch.setattr(motions, "SECONDS", 250.0)
    states = [one.steady for one in motions.steady_states(model)]
    kinds = [steady.measured.name for steady in states if steady is not None]
    assert kinds == ["oscillation 2:0"] * 2 + ["rotation 1:+1"] * 2
    for steady in states:
        assert steady is not None
        assert steady.reached[0].share == 1.0
        assert abs(steady.overestimate) < 0.01
        assert steady.rms < 0.02


@pytest.mark.thorough
def test_figure_9_compares_tumbling_by_its_statistics(model: Rig) -> None:
    """The rig's run is consistent with the identified model's ensemble; no paths coincide."""
    for one in motions.tumbling(model):
        names = ["wells visited", "escapes from a well", "angle covered", "time to settle"]
        assert [each.name for each in one.statistics] == [*names, "greatest velocity"]
        assert min(each.chance for each in one.statistics) > 0.01
        escapes, settled = (one.statistics[k] for k in (1, 3))
        # The number of escapes of one chaotic run depends on rounding; these bounds do not:
        assert escapes.median > 20
        assert 10 < settled.median < 250
        assert np.isinf(settled.ensemble).mean() < 0.05
        assert 10 < settled.measured < 300
