"""Content of the figures of maps, trajectories and sweeps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import LogNorm

import motions
import pendmap
import synthetic
from drawn import made, named, plain, titles, written
from pendmap import Pendulum, plot
from pendmap._core import Attractor
from pendmap.charts import basin_sweep, legend, palette
from pendmap.charts.marks import Band, Image
from pendmap.charts.registry import ready
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

LINE = pendmap.sweep(Pendulum(gamma=0.1, omega=2.0), {"p": (0.4, 1.6, 9)}, grid=10)
PLANE = pendmap.sweep(
    Pendulum(gamma=0.1), {"p": (0.4, 0.8, 3), "omega": (1.8, 2.2, 4)}, grid=10, check=False
)


def test_a_map_has_its_parameters_layers_and_units() -> None:
    figure = made(synthetic.painted(synthetic.USUAL[:4]))
    assert titles(figure) == ["basins of attraction", "settle time"]
    assert "periods to settle" in written(figure)
    assert "γ = 0.1,  p = 1,  ω = 2" in subtitle(figure)
    assert isinstance(figure.axes[1].images[-1].norm, LogNorm)
    assert plain(figure.axes[0].get_xlabel()) == "θ (rad)"
    still = made(synthetic.painted(synthetic.USUAL[:2], p=0.0, torque=0.5, phase=0.3))
    assert subtitle(still).startswith("γ = 0.1,  p = 0,  torque = 0.5;")
    assert "periods of 2π to settle" in written(still)


def subtitle(figure: Figure) -> str:
    return plain(figure.subfigs[0].get_suptitle())


def test_legend_names_share_error_and_twin() -> None:
    dataset = synthetic.painted(synthetic.USUAL[:3], (30, 40))
    texts = [entry.text for entry in legend.entries(dataset)]
    share, stderr = (100 * float(dataset[v].values[1]) for v in ("fraction", "stderr"))
    assert texts[1] == f"rotation 1:+1, {share:.1f} ± {stderr:.1f} %, twin of rotation 1:−1"
    assert texts[0].startswith("rest, ")
    assert "twin" not in texts[0]
    some = synthetic.painted(shape=(10, 10), undecided=7, failed=3)
    assert {"undecided, 7 %", "failed, 3 %"} < set(named(made(some)))
    assert not [t for t in named(made(dataset)) if t.startswith(("undec", "fail"))]


def test_attractors_are_marked_with_their_copies() -> None:
    dataset = synthetic.painted(
        synthetic.USUAL[:4], theta=(-2 * math.pi, 2 * math.pi), velocity=(-1.0, 3.0)
    )
    marks = {line.get_markerfacecolor(): line.get_xydata() for line in made(dataset).axes[0].lines}
    rest = np.asarray(marks[palette.colour(Attractor("rest", 1))])
    assert sorted(rest[:, 0]) == pytest.approx([-2 * math.pi, 0, 2 * math.pi])
    swing = np.asarray(marks[palette.colour(Attractor("oscillation", 2))])
    assert len(swing) == 4
    assert palette.colour(Attractor("rotation", 1, -1)) not in marks, "outside the window"


def test_unreliable_labels_come_last_and_marked() -> None:
    doubtful = synthetic.painted(**synthetic.UNRELIABLE)
    figure = made(doubtful)
    last = "basins of attraction (unreliable)"
    assert titles(figure) == ["settle time", "net turns until settled", last]
    warning = "labels unreliable: 20.7 % change under half the step or mirroring"
    assert warning in written(figure)
    axes = plt.figure(figsize=(3.0, 3.0)).add_subplot()
    plot(doubtful, axes, layer="labels", title=False)
    axes.figure.canvas.draw()
    (text,) = (text for text in axes.texts if "labels unreliable" in text.get_text())
    assert text.get_window_extent().x1 < axes.bbox.x1
    settle = plot(doubtful, legend=True)
    assert not settle.texts
    assert settle.get_legend() is None  # names are those of other parts
    plt.close("all")


def test_a_map_without_labels_shows_turns_and_exponents() -> None:
    dataset = motions.chaotic(cells=24, periods=4)
    layers = ["net turns after 4 periods", "finite-time exponent over 4 periods"]
    figure = made(dataset)
    assert titles(figure) == [*layers, "its attractor, once a period"]
    assert named(figure) == ["tumbling chaos, 100 %"]
    turns = figure.axes[0].images[-1].get_array()
    assert (np.asarray(turns) == dataset["net_turns"].values).all()
    figure = made(motions.chaotic(gamma=0.0, p=0.6, omega=2.0, cells=24, periods=4))
    assert titles(figure) == layers
    assert named(figure) == []
    assert "No attractors without damping" in written(figure)


def test_the_parts_of_a_trajectory() -> None:
    dataset = motions.swing(periods=20, steps=30)
    figure = made(dataset)
    assert titles(figure) == [
        "time history (dark: the last fifth)",
        "energy (dashed: upside down at rest)",
        "phase plane",
        "Poincaré section, once a period",
    ]
    _, level, phase, section = figure.axes
    early = np.asarray(level.lines[0].get_ydata())
    energy = 0.5 * dataset.velocity.values**2 + 1 - np.cos(dataset.theta.values)
    assert early == pytest.approx(energy[: len(early)])
    for line in phase.lines:
        theta = np.asarray(line.get_xdata())
        assert np.nanmax(np.abs(theta)) <= math.pi + 1e-12
        assert np.nanmax(np.abs(np.diff(theta))) < 1.0, "a line crosses the plane at the wrap"
    assert sum(np.size(line.get_xdata()) for line in section.lines) == dataset.sizes["period"]


def test_shares_are_stacked_to_one() -> None:
    (panel,) = basin_sweep.chart(ready(LINE), layer="fraction").panels
    bands = {one.name: one.high - one.low for one in panel.marks if isinstance(one, Band)}
    np.testing.assert_allclose(sum(bands.values()), 1.0)
    for name, share in zip(LINE.attractor.values, LINE.fraction.values.T, strict=True):
        text = str(name).replace("-", "−")
        assert text not in bands or np.allclose(bands[text][::2], share, atol=1e-12)


def test_attractors_of_equal_names_have_different_colours() -> None:
    names = [f"oscillation 6:0 from p = {k}" for k in range(LINE.sizes["attractor"])]
    renamed = LINE.assign_coords(attractor=np.array(names))
    colours = [one.colour for one in basin_sweep.listed(renamed, None)]
    assert len(set(colours)) == len(colours)


@pytest.mark.parametrize("layer", ["entropy", "attractors", "undecided", "share 1"])
def test_layers_over_two_parameters(layer: str) -> None:
    (panel,) = basin_sweep.chart(ready(PLANE), layer=layer).panels
    (image,) = (mark for mark in panel.marks if isinstance(mark, Image))
    assert [side.name for side in (panel.x, panel.y)] == ["p", "ω"]
    shares = PLANE.fraction.isel(attractor=0)
    values = shares if layer == "share 1" else PLANE[basin_sweep.LAYERS[layer][0]]
    np.testing.assert_allclose(image.values, values.values.T)


@pytest.mark.usefixtures("strict_recordings")
def test_one_map_of_a_sweep_is_drawn_as_a_basin_map(tmp_path: Path) -> None:
    one = PLANE.sel(p=0.6, omega=2.2, method="nearest")
    axes = pendmap.plot(one)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$θ$ (rad)", "$dθ/dτ$")
    shades = axes.images[0].get_array()
    for label in np.unique(one.label):
        assert len(np.unique(shades[one.label.values == label], axis=0)) == 1
    assert len(np.unique(shades.reshape(-1, 3), axis=0)) == len(np.unique(one.label))
    back = recorded(one, tmp_path)
    assert "One map of a sweep, p = 0.6, omega = 2.2." in back.one("/summary", "TextDocument:text")
    for dataset in (LINE, PLANE):
        panels = basin_sweep.chart(ready(dataset)).recorded
        assert {f"/{panel.where}" for panel in panels} <= set(recorded(dataset, tmp_path).views)
