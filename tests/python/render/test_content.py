"""Content of the figures of maps and trajectories."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.colors import LogNorm
from matplotlib.patches import Rectangle

import motions
import pendmap
import synthetic
from drawn import made, named, plain, subtitle, titles, written
from pendmap._core import Attractor
from pendmap.charts import legend, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]


def test_labels_come_first_and_settle_time_second() -> None:
    figure = made(synthetic.painted(synthetic.USUAL[:4]))
    assert titles(figure) == ["basins of attraction", "settle time"]
    assert "periods to settle" in written(figure)
    assert "\N{GREEK SMALL LETTER GAMMA} = 0.1,  p = 1,  \N{GREEK SMALL LETTER OMEGA} = 2" in (
        subtitle(figure)
    )
    settle = figure.axes[1].images[-1]
    assert isinstance(settle.norm, LogNorm)
    assert plain(figure.axes[0].get_xlabel()) == "\N{GREEK SMALL LETTER THETA} (rad)"
    ticks = [tick.get_text() for tick in figure.axes[0].get_xticklabels()]
    assert ticks == ["\N{MINUS SIGN}π", "\N{MINUS SIGN}π/2", "0", "π/2", "π"]


def test_without_drive_there_is_no_frequency() -> None:
    figure = made(synthetic.painted(synthetic.USUAL[:2], p=0.0, torque=0.5, phase=0.3))
    said = subtitle(figure)
    assert said.startswith("\N{GREEK SMALL LETTER GAMMA} = 0.1,  p = 0,  torque = 0.5;")
    assert "periods of 2\N{GREEK SMALL LETTER PI} to settle" in written(figure)


def test_legend_names_share_error_and_twin() -> None:
    dataset = synthetic.painted(synthetic.USUAL[:3], (30, 40))
    texts = [entry.text for entry in legend.entries(dataset)]
    share, stderr = (100 * float(dataset[v].values[1]) for v in ("fraction", "stderr"))
    twin = "twin of rotation 1:\N{MINUS SIGN}1"
    assert texts[1] == f"rotation 1:+1, {share:.1f} \N{PLUS-MINUS SIGN} {stderr:.1f} %, {twin}"
    assert texts[0].startswith("rest, ")
    assert "twin" not in texts[0]


def test_undecided_and_failed_are_in_the_legend_only_if_present() -> None:
    figure = made(synthetic.painted(shape=(10, 10), undecided=7, failed=3))
    assert {"undecided, 7 %", "failed, 3 %"} < set(named(figure))
    assert not [t for t in named(made(synthetic.painted())) if t.startswith(("undec", "fail"))]


def test_attractors_are_marked_with_their_copies() -> None:
    dataset = synthetic.painted(
        synthetic.USUAL[:4], theta=(-2 * math.pi, 2 * math.pi), velocity=(-1.0, 3.0)
    )
    marks = {line.get_markerfacecolor(): line.get_xydata() for line in made(dataset).axes[0].lines}
    rest = np.asarray(marks[palette.colour(Attractor("rest", 1))])
    assert sorted(rest[:, 0]) == pytest.approx([-2 * math.pi, 0, 2 * math.pi])
    swing = np.asarray(marks[palette.colour(Attractor("oscillation", 2))])
    assert len(swing) == 4
    assert palette.colour(Attractor("rotation", 1, -1)) not in marks, (
        "its point lies outside the window"
    )


def test_unreliable_labels_come_last_and_marked() -> None:
    figure = made(synthetic.painted(**synthetic.UNRELIABLE))
    last = "basins of attraction (unreliable)"
    assert titles(figure) == ["settle time", "net turns until settled", last]
    warning = "labels unreliable: 20.7 % change under half the step or mirroring"
    assert warning in written(figure)
    assert warning in written(made(synthetic.painted(**synthetic.UNRELIABLE), "labels"))
    assert "unreliable" not in written(made(synthetic.painted()))


def test_a_single_chaotic_attractor_shows_turns_exponent_and_its_points() -> None:
    dataset = motions.chaotic(cells=24, periods=4)
    figure = made(dataset)
    assert titles(figure) == [
        "net turns after 4 periods",
        "finite-time exponent over 4 periods",
        "its attractor, once a period",
    ]
    assert named(figure) == ["tumbling chaos, 100 %"]
    turns = figure.axes[0].images[-1]
    low, high = turns.get_clim()
    assert low == -(high or 0.0) < 0.0
    assert (np.asarray(turns.get_array()) == dataset["net_turns"].values).all()


def test_without_damping_there_is_nothing_to_name() -> None:
    figure = made(motions.chaotic(gamma=0.0, p=0.6, omega=2.0, cells=24, periods=4))
    assert titles(figure) == ["net turns after 4 periods", "finite-time exponent over 4 periods"]
    assert named(figure) == []
    assert "No attractors without damping" in written(figure)


def test_the_parts_of_a_trajectory() -> None:
    dataset = motions.swing(periods=20, steps=30)
    figure = made(dataset)
    dashed = "energy (dashed: upside down at rest)"
    assert titles(figure) == [
        "time history (dark: the last fifth)",
        dashed,
        "phase plane",
        "Poincaré section, once a period",
    ]
    history, level, phase, section = figure.axes
    assert points(history) == dataset.sizes["time"] + 1
    early = np.asarray(level.lines[0].get_xydata())
    first = 0.5 * dataset.velocity.values**2 + 1 - np.cos(dataset.theta.values)
    assert early[:, 1] == pytest.approx(first[: len(early)])
    for line in phase.lines:
        xy = np.asarray(line.get_xydata())
        assert np.nanmax(np.abs(xy[:, 0])) <= math.pi + 1e-12
        assert np.nanmax(np.abs(np.diff(xy[:, 0]))) < 1.0, "a line crosses the plane at the wrap"
    assert points(section) == dataset.sizes["period"]


def test_rest_is_shaded_and_named() -> None:
    model = pendmap.Pendulum(p=2.2, omega=0.6, theta_r=0.8)
    run = pendmap.simulate(model, 1.0, 0.0, 40.0)
    figure = made(run)
    shades = [bar for bar in figure.axes[0].patches if isinstance(bar, Rectangle)]
    spans = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in shades]
    sticks = run.event_time.values[run.event_kind.values == "stick"]
    releases = run.event_time.values[run.event_kind.values == "release"]
    assert len(sticks) == 2
    assert [begin for begin, _ in spans] == pytest.approx(sticks)
    assert [end for _, end in spans] == pytest.approx([*releases, 40.0])
    assert named(figure) == ["at rest"]
    assert named(made(pendmap.simulate(pendmap.Pendulum(), 1.0, 0.0, 9.0))) == []


def points(axes: Axes) -> int:
    return sum(len(np.asarray(line.get_xydata())) for line in axes.lines)
