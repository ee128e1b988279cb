"""Results in Axes of one's own, and in files."""

from __future__ import annotations

import math
import pickle
import struct
import tracemalloc
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt

import motions
import pendmap
import synthetic
from drawn import plain, titles
from pendmap import InputError, Pendulum, plot, render
from pendmap.charts import registry
from pendmap.charts.chart import Axis, Panel
from pendmap.charts.legend import entries
from pendmap.charts.marks import Points
from pendmap.render import drawing, style

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MAP = synthetic.painted(synthetic.USUAL[:3])
MOTION = motions.swing(periods=8, steps=20)


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


def test_a_figure_can_be_pickled() -> None:
    figure, every = plt.subplots(1, 2, layout="constrained")
    plot(MAP, every[0], legend=True)
    plot(pendmap.tongues(Pendulum(), np.linspace(1.5, 2.5, 9)), every[1])
    again = pickle.loads(pickle.dumps(figure))  # noqa: S301 (our own bytes)
    again.canvas.draw()
    assert [axes.get_title() for axes in again.axes] == [axes.get_title() for axes in figure.axes]


def test_users_choose_colours_and_names_of_attractors() -> None:
    few = synthetic.painted(synthetic.USUAL[:4], (30, 40))
    axes = plot(few, colors={"rest": "white"}, names={"rest": "hanging"}, legend=True)
    texts = [plain(one.get_text()) for one in axes.get_legend().get_texts()]
    assert any(text.startswith("hanging, ") for text in texts)
    assert (np.asarray(axes.images[0].get_array()) == 255).all(axis=2).any()


def test_a_map_of_a_sweep_looks_like_the_map_alone() -> None:
    swept = pendmap.sweep(Pendulum(gamma=0.05), {"p": [0.6, 1.2, 2.0]}, grid=12)
    for p in swept.p.values:
        alone = pendmap.basins(Pendulum(gamma=0.05, p=float(p)), 12)
        both = [
            {(one.name.partition(" ")[0], one.colour, one.marker) for one in entries(member)}
            for member in (registry.ready(swept.sel(p=p)), alone)
        ]
        assert both[1] <= both[0] or both[0] <= both[1], both


def test_title_and_legend_are_optional() -> None:
    few = synthetic.painted(synthetic.USUAL[:10], (30, 40))
    assert plain(plot(few).get_title()) == "basins of attraction"
    assert plot(few, title=False, legend=False).get_title() == ""
    assert plot(few, title="mine").get_title() == "mine"
    _, axes = plt.subplots(figsize=(2.0, 1.0))
    assert plot(few, axes).get_legend() is None  # it would be higher than half the panel
    assert plot(few, legend=True).get_legend() is not None


def test_a_legend_does_not_narrow_its_column() -> None:
    figure, every = plt.subplots(1, 2, figsize=(5.0, 2.6), layout="constrained")
    orbits = pendmap.orbit(Pendulum(p=0.6), 1, 1)
    for axes in every:
        plot(orbits, axes, legend=True)
    figure.draw_without_rendering()
    for axes in every:
        legend = axes.get_legend()
        assert axes.get_window_extent().width > 0.33 * figure.bbox.width
        assert legend.get_window_extent().width < 1.2 * axes.get_window_extent().width
        assert legend.get_window_extent().y0 >= 0.0


def test_a_second_result_grows_in_the_same_axes() -> None:
    far = motions.swing(periods=2, steps=20)
    far = far.assign(theta=far.theta + 9.0)
    _, axes = plt.subplots()
    plot(MOTION, axes, title="both")
    before = axes.get_xlim()
    plot(far, axes)
    assert axes.get_xlim() == before
    assert axes.get_ylim()[0] < float(MOTION.theta.min())
    assert axes.get_ylim()[1] > float(far.theta.max())
    plot(MAP, axes, legend=True)
    assert (axes.get_title(), axes.get_xlabel()) == ("both", "$τ$")
    first = {text.get_text() for text in axes.get_legend().get_texts()}
    plot(pendmap.lyapunov(Pendulum(p=0.6)), axes, legend=True)
    assert first < {text.get_text() for text in axes.get_legend().get_texts()}


def test_the_density_of_chaos_has_the_cells_of_its_axis() -> None:
    cells = np.array([0.0, 0.1, 0.2, 1.2, 2.2, 3.2])
    rng = np.random.default_rng(0)
    x = np.repeat([0.05, 0.15, 1.7, 2.7], 700)  # none in the third cell
    _, axes = plt.subplots()
    chaos = Points(x, rng.uniform(-1, 1, x.size), cells=cells)
    drawing.panel_into(axes, Panel("a", "", Axis("", (0.0, 3.2)), Axis("", (-1.0, 1.0)), [chaos]))
    (mesh,) = axes.collections
    corners = mesh.get_coordinates()
    np.testing.assert_allclose(corners[0, :, 0], cells)
    shown = mesh.get_array()[..., 3].max(axis=0) > 0
    assert shown.tolist() == [True, True, False, True, True]


@pytest.mark.parametrize(
    ("result", "look", "says"),
    [
        (3, {}, "cannot draw 3; kinds that can be: "),
        (MAP, {"layer": "no"}, "'no' in this map; it has labels, settle, turns"),
        (
            pendmap.tongues(Pendulum(), [1.5, 2.0]),
            {"layer": "no"},
            "in this figure; it has omega-p",
        ),
        (MAP, {"layer": "settle", "colormap": "no"}, "no colour map 'no'; .* viridis"),
        (MAP, {"legend": "upper right"}, "legend must be a bool"),
        (MAP, {"colors": {"rets": "white"}}, "one of rest, rotation 1:"),
        (MAP, {"names": {"rets": "hanging"}}, "one of rest, rotation 1:"),
        (MAP, {"colors": {"rest": "no colour"}}, "rest must have a colour"),
        (MOTION, {"names": {"rest": "hanging"}}, "there are none"),
    ],
)
def test_bad_input_is_refused(result: Any, look: dict[str, Any], says: str) -> None:  # noqa: ANN401
    with pytest.raises(InputError, match=says):
        plot(result, **look)


@pytest.mark.parametrize(("result", "width"), [(MAP, 86), (MAP, 178), (MOTION, 86)])
def test_a_figure_has_the_width_of_a_column(result: Any, width: float) -> None:  # noqa: ANN401
    figure = render.figure_of(result, width=width, title=False)
    wide, high = figure.get_size_inches()
    assert wide == pytest.approx(width / 25.4)
    assert high < 3.2 * wide
    assert not figure.get_suptitle()
    figure.canvas.draw()
    panels = [one for one in figure.axes if one.get_label() != "<colorbar>"]
    assert len({round(one.get_position().x0, 2) for one in panels}) == (1 if width == 86 else 2)
    for axes in panels:
        assert axes.xaxis.label.get_fontsize() == (8.0 if width == 86 else 9.0)
        assert axes.get_window_extent().width / figure.dpi > 1.2


def test_the_style_is_that_of_the_files() -> None:
    assert style.typeset("q ($10^{-6}$ 1/rad), p = YΩ²/g") == "q ($10^{-6}$ 1/rad), $p$ = $YΩ^2/g$"
    with plt.style.context("pendmap.figures"):
        assert mpl.rcParams["font.size"] == style.RC["font.size"] == 9.0
        assert MOTION.pendmap.plot(layer="phase").xaxis.label.get_fontsize() == 9.0


@pytest.mark.parametrize(
    ("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_files_are_complete_and_reproducible(tmp_path: Path, suffix: str, magic: bytes) -> None:
    dataset = synthetic.painted()
    first = render.draw(dataset, tmp_path / f"a.{suffix}")
    second = render.draw(dataset, str(tmp_path / f"b.{suffix}"))
    assert first.read_bytes().startswith(magic)
    assert first.read_bytes() == second.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"a.{suffix}", f"b.{suffix}"]


@pytest.mark.parametrize("size", [(7.5, 5.0), (0.5, 1.0), (100.0, 2.0)])
def test_size_and_resolution_are_as_requested(tmp_path: Path, size: tuple[float, float]) -> None:
    file = render.draw(synthetic.painted(), tmp_path / "a.png", size=size, dpi=80)
    assert struct.unpack(">II", file.read_bytes()[16:24]) == (80 * size[0], 80 * size[1])


def test_one_layer_is_drawn_alone_in_a_colour_map() -> None:
    figure = render.figure_of(synthetic.painted(), layer="settle", colormap="cividis")
    assert len(titles(figure)) == 1
    assert figure.axes[0].images[-1].cmap.name == "cividis"


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("a.jpg", {}, r"suffix must be \.png or \.svg or \.pdf, got '\.jpg'"),
        ("a", {}, r"suffix must be .*, got ''"),
        ("a.png", {"layer": "labels", "colormap": "viridis"}, "attractor"),
        ("a.png", {"size": (math.nan, 5.0)}, "nan"),
        ("a.png", {"size": (30.0, 5.0), "dpi": 1000}, "20000 pixels"),
        ("a.png", {"dpi": 5}, "dpi 5"),
        ("a.png", {"width": 0}, "width must be positive"),
        ("a.png", {"width": 86, "size": (3, 3)}, "and no size given"),
        ("no/a.png", {}, "folder does not exist"),
        ("a.png", {"dpi": math.nan}, "dpi nan"),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(
    tmp_path: Path, name: str, options: dict[str, object], says: str
) -> None:
    with pytest.raises((InputError, FileNotFoundError), match=says):
        render.draw(synthetic.painted(), tmp_path / name, **options)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_large_maps_are_converted_in_parts(tmp_path: Path) -> None:
    peaks = []
    for side in (1200, 2600):
        dataset = synthetic.painted(synthetic.USUAL[:3], (side, side), undecided=4)
        dataset["label"] = dataset["label"].clip(max=3)  # where a wave is rounded to its end
        render.draw(dataset, tmp_path / "warm.png")
        tracemalloc.start()
        render.draw(dataset, tmp_path / "a.png")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 2600 * 2600, "more than one byte a cell beyond the thinned map"
