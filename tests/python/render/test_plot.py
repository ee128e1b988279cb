"""Results in Axes and figures of one's own."""

from __future__ import annotations

import functools
import pickle
import struct
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.text import Text

import motions
import pendmap
import synthetic
from decays import decay, record
from drawn import plain
from pendmap import InputError, Pendulum, plot, render
from pendmap.charts import palette, registry
from pendmap.charts.chart import Axis, Chart, Panel, Sheet
from pendmap.charts.legend import entries as legend_entries
from pendmap.charts.marks import Line, Points
from pendmap.comparison import compare
from pendmap.identification import IdentificationReport, identify
from pendmap.records import Experiment, Run
from pendmap.render import drawing, style

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MAP = synthetic.painted(synthetic.USUAL[:3])
MOTION = motions.swing(periods=8, steps=20)


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


@functools.cache
def experiment() -> Experiment:
    time, angle = record(decay(release=1.0, until=40.0), seconds=20)
    run = Run("swing", "swing.csv", "free", time, angle, np.ones(time.size, bool))
    return Experiment(Path("lab"), (run,))


@functools.cache
def identified() -> IdentificationReport:
    return identify(experiment(), methods=["trajectory", "combined"])


MODEL = Pendulum(p=0.6)
RESULTS: dict[str, Callable[[], Any]] = {
    "basins": lambda: MAP,
    "sweep": lambda: pendmap.sweep(MODEL, {"p": [0.5, 0.6]}, grid=pendmap.Grid.square(12)),
    "parameter_map": lambda: pendmap.parameter_map(
        Pendulum(), {"p": (0.3, 1.8, 5), "omega": (1.6, 2.4, 5)}, curves=True, starts=4
    ),
    "bifurcation": lambda: pendmap.bifurcation(Pendulum(), {"p": (0.5, 1.0, 8)}, starts=4),
    "orbit": lambda: pendmap.orbit(MODEL, 1, 1),
    "lyapunov": lambda: pendmap.lyapunov(MODEL),
    "lifetime": lambda: pendmap.lifetime(Pendulum(p=1.7), starts=200),
    "tongues": lambda: pendmap.tongues(Pendulum(), np.linspace(0.5, 3.0, 20)),
    "melnikov": lambda: pendmap.melnikov(Pendulum()),
    "trajectory": lambda: MOTION,
    "record": experiment,
    "identification": identified,
    "comparison": lambda: compare(identified().model, experiment()),
}
"""A result of each kind."""


@functools.cache
def result(name: str) -> Any:  # noqa: ANN401
    return RESULTS[name]()


@pytest.mark.parametrize("name", RESULTS)
@pytest.mark.parametrize("layout", ["constrained", None])
def test_every_part_is_drawn_into_the_axes_given_and_nothing_is_cut(
    name: str, layout: str | None
) -> None:
    """A figure without a layout gets that of matplotlib, with room for names and legends."""
    given = result(name)
    chart = registry.of_result(given)
    panels = [*chart.panels, *getattr(chart, "recorded", ())]
    drawn = 0
    for k, layer in enumerate(dict.fromkeys(panel.name for panel in panels)):
        size = [(6.4, 4.8), (4.0, 3.0), (9.0, 5.0), (3.4, 2.8)][k % 4]
        figure, every = plt.subplots(1, 1 + k % 2, figsize=size, squeeze=False, layout=layout)
        axes = every[0, -1]
        assert plot(given, axes, layer=layer) is axes
        drawn += 1
        figure.canvas.draw()
        assert axes.has_data() or not axes.axison
        assert not (k % 2 and every[0, 0].has_data())
        boxes = [one.get_tightbbox() for one in figure.axes if one.axison]
        boxes += [text.get_window_extent() for text in axes.texts if text.get_text()]
        legend = axes.get_legend()
        if legend is not None:
            boxes.append(legend.get_window_extent())
            assert len(legend.legend_handles) == len(legend.get_texts()) > 0
        for box in boxes:
            assert -1.5 < box.x0 < box.x1 < figure.bbox.width + 1.5, (layer, box)
            assert -1.5 < box.y0 < box.y1 < figure.bbox.height + 1.5, (layer, box)
        plt.close(figure)
    assert drawn


def test_a_figure_can_be_pickled() -> None:
    figure, every = plt.subplots(1, 2, layout="constrained")
    plot(MAP, every[0], legend=True)
    plot(pendmap.tongues(Pendulum(), np.linspace(1.5, 2.5, 9)), every[1])
    again = pickle.loads(pickle.dumps(figure))  # noqa: S301 (our own bytes)
    again.canvas.draw()
    assert [axes.get_title() for axes in again.axes] == [axes.get_title() for axes in figure.axes]


@pytest.mark.parametrize("name", RESULTS)
def test_recorded_curves_of_a_panel_have_names_and_colours_of_their_own(name: str) -> None:
    chart = registry.of_result(result(name))
    for panel in getattr(chart, "recorded", ()) or chart.panels:
        lines = [one for one in panel.marks if isinstance(one, Line) and one.path]
        known = {one.name: one.colour for one in panel.marks if one.name}
        for one in lines:
            assert len(lines) == 1 or one.colour in known.values(), (panel.name, one.path)
        words = [palette.in_words(known[name]) for name in {one.name for one in lines} - {""}]
        assert words.count("grey") < 2, (panel.name, known)


def test_users_choose_colours_and_names_of_attractors() -> None:
    few = synthetic.painted(synthetic.USUAL[:4], (30, 40))
    axes = plot(few, colors={"rest": "white"}, names={"rest": "hanging"}, legend=True)
    texts = [plain(one.get_text()) for one in axes.get_legend().get_texts()]
    assert any(text.startswith("hanging, ") for text in texts)
    shades = {
        tuple(shade) for shade in np.asarray(axes.images[0].get_array()).reshape(-1, 3).tolist()
    }
    assert (255, 255, 255) in shades
    for look in ({"colors": {"rets": "white"}}, {"names": {"rets": "hanging"}}):
        with pytest.raises(pendmap.InputError, match="one of rest, rotation 1:"):
            plot(few, **look)
    with pytest.raises(pendmap.InputError, match="rest must have a colour"):
        plot(few, colors={"rest": "no colour"})
    with pytest.raises(pendmap.InputError, match="there are none"):
        plot(MOTION, names={"rest": "hanging"})


def test_a_map_of_a_sweep_looks_like_the_map_alone() -> None:
    swept = pendmap.sweep(Pendulum(gamma=0.05), {"p": [0.6, 1.2, 2.0]}, grid=12)
    for p in swept.p.values:
        alone = pendmap.basins(Pendulum(gamma=0.05, p=float(p)), 12)
        looks = [
            {
                (one.name.partition(" ")[0], one.chaotic, one.colour, one.marker)
                for one in legend_entries(member)
            }
            for member in (registry.ready(swept.sel(p=p)), alone)
        ]
        assert looks[1] <= looks[0] or looks[0] <= looks[1], looks


def test_title_and_legend_are_optional() -> None:
    few = synthetic.painted(synthetic.USUAL[:10], (30, 40))
    assert plain(plot(few).get_title()) == "basins of attraction"
    assert plot(few, title=False).get_title() == ""
    assert plot(few, title="mine").get_title() == "mine"
    assert plot(few, legend=False).get_legend() is None
    assert plot(few, legend=True).get_legend() is not None
    _, axes = plt.subplots(figsize=(2.0, 1.0))
    assert plot(few, axes).get_legend() is None  # it would be higher than half the panel


def test_a_legend_does_not_narrow_its_column() -> None:
    figure, every = plt.subplots(1, 2, figsize=(5.0, 2.6), layout="constrained")
    for axes in every:
        plot(result("orbit"), axes, legend=True)
    figure.draw_without_rendering()
    for axes in every:
        legend = axes.get_legend()
        assert axes.get_window_extent().width > 0.33 * figure.bbox.width
        assert legend.get_window_extent().width < 1.2 * axes.get_window_extent().width
        assert legend.get_window_extent().y0 >= 0.0


def test_a_second_result_grows_in_the_same_axes() -> None:
    long, far = motions.swing(periods=8, steps=20), motions.swing(periods=2, steps=20)
    far = far.assign(theta=far.theta + 9.0)
    _, axes = plt.subplots()
    plot(long, axes, title="both")
    before = axes.get_xlim()
    plot(far, axes)
    assert axes.get_xlim() == before
    assert axes.get_ylim()[0] < float(long.theta.min())
    assert axes.get_ylim()[1] > float(far.theta.max())
    plot(MAP, axes, legend=True)
    assert (axes.get_title(), axes.get_xlabel()) == ("both", "$τ$")
    first = {text.get_text() for text in axes.get_legend().get_texts()}
    plot(result("lyapunov"), axes, legend=True)
    assert first < {text.get_text() for text in axes.get_legend().get_texts()}


def test_labels_that_are_unreliable_say_so_without_a_title() -> None:
    doubtful = synthetic.painted(**synthetic.UNRELIABLE)
    _, axes = plt.subplots(figsize=(3.0, 3.0))
    plot(doubtful, axes, layer="labels", title=False)
    (warning,) = (t for t in axes.texts if "labels unreliable" in t.get_text())
    axes.figure.canvas.draw()
    assert warning.get_window_extent().x1 < axes.bbox.x1
    settle = plot(doubtful, legend=True)
    assert not settle.texts
    assert settle.get_legend() is None  # names are those of other parts


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


def test_powers_of_ten_are_raised() -> None:
    assert style.typeset("q ($10^{-6}$ 1/rad)") == "q ($10^{-6}$ 1/rad)"
    assert style.typeset("ln |δx|, p = YΩ²/g") == "ln |$δx$|, $p$ = $YΩ^2/g$"


def test_the_accessor_is_the_function() -> None:
    _, axes = plt.subplots()
    assert MOTION.pendmap.plot(axes, layer="phase") is axes


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: plot(3), "cannot draw 3; kinds that can be: "),
        (lambda: plot(MAP, layer="no"), "'no' in this map; it has labels, settle, turns"),
        (lambda: plot(experiment(), layer="no"), "no layer 'no' in this figure; it has"),
        (lambda: plot(identified(), layer="no"), "it has"),
        (lambda: plot(MAP, layer="settle", colormap="no"), "no colour map 'no'"),
        (lambda: plot(MAP, legend="upper right"), "legend must be a bool"),
        (lambda: render.figure_of(MAP, width=0), "width must be positive"),
        (lambda: render.figure_of(MAP, width=86, size=(3, 3)), "and no size given"),
    ],
)
def test_bad_input_is_refused(call: Callable[[], object], said: str) -> None:
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        call()


@pytest.mark.parametrize(("given", "width"), [(MAP, 86), (MAP, 178), (MOTION, 86)])
def test_a_figure_has_the_width_of_a_column(given: Any, width: float, tmp_path: Path) -> None:  # noqa: ANN401
    file = render.draw(given, tmp_path / "a.png", width=width, title=False, dpi=254)
    wide, high = struct.unpack(">II", file.read_bytes()[16:24])
    assert wide == 10 * width
    assert high < 32 * width
    figure = render.figure_of(given, width=width, title=False)
    assert not figure.get_suptitle()
    figure.canvas.draw()
    panels = [one for one in figure.axes if one.get_label() != "<colorbar>"]
    assert len({round(one.get_position().x0, 2) for one in panels}) == (1 if width == 86 else 2)
    for axes in panels:
        assert axes.xaxis.label.get_fontsize() == (8.0 if width == 86 else 9.0)
        assert axes.get_window_extent().width / figure.dpi > 1.2


def test_the_heading_of_a_part_of_a_sheet_is_never_cut() -> None:
    axis = Axis("", (0.0, 1.0))
    words = "run_05, held out: rms 9.19 mrad, 2.77 times the noise of 3.31 mrad, in 17 windows"
    part = Chart(words, "", [[Panel("a", "", axis, axis, [])]], size=(6.5, 3.0))
    figure = drawing.draw(Sheet("", "", [[part, replace(part, title="short")]]), width=6.0)
    figure.canvas.draw()
    boxes = {text.get_text(): text.get_window_extent() for text in figure.findobj(Text)}
    assert boxes[words].height > 1.5 * boxes["short"].height
    for name in (words, "short"):
        assert 0 < boxes[name].x0 < boxes[name].x1 < figure.bbox.width
        assert boxes[name].y1 < figure.bbox.height


def test_the_style_is_that_of_the_files() -> None:
    with plt.style.context("pendmap.figures"):
        assert mpl.rcParams["font.size"] == style.RC["font.size"] == 9.0
        assert plot(MAP).xaxis.label.get_fontsize() == 9.0
