"""``pendmap paper``: the figures of the paper, by number."""

from __future__ import annotations

import csv
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner

import pendmap
from drawn import written
from pendmap import render, virtual_rig
from pendmap.charts import comparison
from pendmap.cli.paper import command
from pendmap.paper import figures as paper_figures
from pendmap.paper import motions as paper_motions
from pendmap.render import drawing

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run
    from pendmap.charts.chart import Chart


@pytest.mark.parametrize("name", ["4", "figure 4", "Figure_4", "fig.4", "fig4"])
def test_a_figure_has_several_names(name: str) -> None:
    assert paper_figures.wanted(name) == ["4"]
    assert paper_figures.wanted("table 1") == paper_figures.wanted("table1") == ["table1"]
    assert paper_figures.wanted("all") == [*"123456789", "table1"]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("0", "got '0'"),
    ],
)
def test_unknown_figures_are_refused_in_one_line(
    pendmap_command: Run, tmp_path: Path, name: str, says: str
) -> None:
    run = pendmap_command("paper", name)
    assert run.returncode == 2
    assert says in run.stderr
    assert (
        "must be one of the paper's (1, 2, 3, 4, 5, 6, 7, 8, 9, table1 and all), got" in run.stderr
    )
    assert run.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_one_figure(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("paper", "3")
    assert run.returncode == 0, run.stderr
    assert run.stdout == "Written: figure_3.png\n"
    assert [path.name for path in tmp_path.iterdir()] == ["figure_3.png"]
    run = pendmap_command("paper", "figure", "3", "--plot", "a.svg", "--json")
    assert json.loads(run.stdout) == {"files": ["a.svg"]}


@pytest.mark.thorough
def test_all_figures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper_motions, "SECONDS", 60.0)  # 2500 s take the rig minutes
    monkeypatch.setattr(paper_motions, "TUMBLED", 30.0)
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke(command, ["all", "--out", "out", "--json"])
    assert run.exit_code == 0, run.output
    files = json.loads(run.stdout)["files"]
    names = [*(f"figure_{k}.png" for k in range(1, 10)), "table_1.csv"]
    assert files == [f"out/{name}" for name in names]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(names)
    assert all((tmp_path / name).stat().st_size > 300 for name in files)
    with (tmp_path / "out" / "table_1.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["what"] for row in rows] == ["period", "period", "peak", "peak"]
    assert float(rows[2]["measured"]) == pytest.approx(1.2, abs=0.05)
    assert float(rows[2]["trajectory_percent"]) < 0.1 < float(rows[2]["combined_percent"])


def test_the_table_is_printed(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("paper", "table1", "--seed", 1, "--plot", "table.pdf")
    assert run.returncode == 0, run.stderr
    for words in ("trajectory", "log_decrement", "16.95 %", "Written: table.pdf, table.csv"):
        assert words in run.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["table.csv", "table.pdf"]
    with (tmp_path / "table.csv").open(encoding="utf-8") as file:
        assert [row["what"] for row in csv.DictReader(file)] == ["period", "period", "peak", "peak"]


def test_options_that_do_not_go_together(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("paper", "all", "--plot", "a.png")
    assert run.returncode == 2
    assert "--plot must have one figure, it is one file" in run.stderr
    run = pendmap_command("paper", "3", "--plot", "a.png", "--out", "there")
    assert run.returncode == 2
    assert "one of --plot and --out must be left out, got both" in run.stderr
    run = pendmap_command("paper", "10", "--out", "there")
    assert run.returncode == 2
    assert not list(tmp_path.iterdir())
    run = pendmap_command("paper", "3", "--out", "nowhere/there")
    assert run.returncode == 2
    assert "nowhere/there: No such file or directory" in run.stderr
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("mine")
    run = pendmap_command("paper", "3", "--out", "file")
    assert run.returncode == 2
    assert "'file' is a file" in run.stderr
    assert run.stderr.count("\n") == 1


def test_the_same_seed_gives_the_same_record() -> None:
    one, same, other = (virtual_rig.paper_decay(seed)[1] for seed in (3, 3, 4))
    assert one.tobytes() == same.tobytes() != other.tobytes()
    with pytest.raises(pendmap.InputError, match="one figure"):
        paper_figures.draw("all", "a.png")


def test_figure_2_is_persistent_tumbling_chaos_at_the_papers_points() -> None:
    """Each trajectory rotates both ways, never settles, and fills a section of dimension > 1."""
    runs = paper_figures.tumbling(2000)
    points = [(1.03, 0.87), (1.7, 0.87), (1.5, 1.8)]
    assert [(run["p"].item(), run["omega"].item()) for run in runs] == points
    for run in runs:
        assert run["gamma"].item() == 0.1
        assert run.sizes["period"] == 1501
        assert float(run.section_time[0]) == pytest.approx(float(run.time[0]))
        turned = np.diff(np.round(run.theta.values[::48] / math.tau))
        assert (turned > 0).sum() > 50 < (turned < 0).sum()
        late = np.stack([run.section_theta.values, run.section_velocity.values], axis=1)[-1000:]
        cells = {tuple(cell) for cell in np.floor(late / 0.1).astype(int).tolist()}
        assert len(cells) > 200


def test_figure_2_has_a_column_for_each_point(tmp_path: Path) -> None:
    runs = paper_figures.tumbling(600)
    sheet = drawing.draw(paper_figures.tumbling_chart(runs, "Figure 2"), dpi=100)
    assert len(sheet.axes) == 9
    sections = sheet.axes[6:]
    for axes, run in zip(sections, runs, strict=True):
        drawn = sum(len(line.get_xydata()) for line in axes.lines)
        assert drawn == run.sizes["period"]
    small = drawing.draw(paper_figures.tumbling_chart(runs), size=(2.0, 2.0), dpi=100)
    assert tuple(small.get_size_inches()) == (2.0, 2.0)
    assert paper_figures.draw("2", tmp_path / "2.png").stat().st_size > 50_000


@pytest.mark.parametrize(("key", "rows"), [("1", [1]), ("2", [3, 3, 3]), ("3", [1])])
def test_each_figure_has_its_own_panels(
    key: str, rows: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    charts: list[Chart] = []
    monkeypatch.setattr(render, "draw", lambda chart, _: charts.append(chart))
    paper_figures.draw(key, tmp_path / "a.png")
    (chart,) = charts
    assert chart.title.startswith(f"Figure {key}: ")
    assert [len(row) for row in chart.rows] == rows


@pytest.fixture(scope="module")
def model() -> pendmap.Rig:
    return paper_figures.report(0).methods["combined_repaired"].rig


@pytest.mark.thorough
def test_figure_8_compares_steady_states_of_the_requested_kinds(
    model: pendmap.Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rig and model reach the same two oscillations of period 2 and two rotations."""
    monkeypatch.setattr(paper_motions, "SECONDS", 250.0)
    runs = paper_motions.steady_states(model)
    kinds = [one.steady.measured.name for one in runs if one.steady is not None]
    assert kinds == ["oscillation 2:0"] * 2 + ["rotation 1:+1"] * 2
    for one in runs:
        assert one.steady is not None
        assert one.steady.reached[0].share == 1.0
        assert abs(one.steady.overestimate) < 0.01
        assert one.steady.rms < 0.02
    figure = drawing.draw(comparison.steady(runs, "Steady", "rig"))
    figure.savefig(tmp_path / "8.svg")
    drawn = written(figure)
    assert drawn.count("rotation 1:+1") == 2
    assert "identified model" in drawn


@pytest.mark.thorough
def test_figure_9_compares_tumbling_by_its_statistics(model: pendmap.Rig, tmp_path: Path) -> None:
    """The rig's run is consistent with the identified model's ensemble; no paths coincide."""
    runs = paper_motions.tumbling(model)
    for one in runs:
        assert [each.name for each in one.statistics] == [
            "wells visited",
            "escapes from a well",
            "angle covered",
            "time to settle",
            "greatest velocity",
        ]
        assert min(each.chance for each in one.statistics) > 0.01
        escapes, settled = (one.statistics[k] for k in (1, 3))
        # The number of escapes of one chaotic run depends on rounding; these bounds do not:
        assert escapes.median > 20
        assert 10 < settled.median < 250
        assert np.isinf(settled.ensemble).mean() < 0.05
        assert 10 < settled.measured < 300
    figure = drawing.draw(comparison.tumbling(runs, "Tumbling", "rig"))
    figure.savefig(tmp_path / "9.svg")
    drawn = written(figure)
    assert drawn.count("record (95 % of the ensemble)") == 2
    assert drawn.count("a member") >= 4
