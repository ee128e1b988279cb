"""Results in Axes and figures of one's own."""

from __future__ import annotations

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
from pendmap.charts import palette, registry, selection
from pendmap.charts.chart import Axis, Chart, Panel, Sheet
from pendmap.charts.legend import entries as legend_entries
from pendmap.charts.marks import Line, Points
from pendmap.comparison import compare
from pendmap.identification import identify
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


def experiment() -> Experiment:
    time, angle = record(decay(release=1.0, until=40.0), seconds=20)
    run = Run("swing", "swing.csv", "free", time, angle, np.ones(time.size, bool))
    return Experiment(Path("lab"), (run,))


def results() -> dict[str, Callable[[], Any]]:
    """A result of each kind, by its name."""
    model = Pendulum(p=0.6)
    return {
        "basins": lambda: MAP,
        "sweep": lambda: pendmap.sweep(model, {"p": [0.5, 0.6]}, grid=pendmap.Grid.square(12)),
        "parameter_map": lambda: pendmap.parameter_map(
            Pendulum(), {"p": (0.5, 1.0, 4), "omega": (1.8, 2.2, 4)}
        ),
        "bifurcation": lambda: pendmap.bifurcation(Pendulum(), {"p": (0.5, 1.0, 8)}),
        "orbit": lambda: pendmap.orbit(model, 1, 1),
        "lyapunov": lambda: pendmap.lyapunov(model),
        "lifetime": lambda: pendmap.lifetime(Pendulum(p=1.7), starts=200),
        "tongues": lambda: pendmap.tongues(Pendulum(), np.linspace(0.5, 3.0, 30)),
        "melnikov": lambda: pendmap.melnikov(Pendulum()),
        "trajectory": lambda: MOTION,
        "record": experiment,
        "identification": lambda: identify(experiment()),
        "comparison": lambda: compare(identify(experiment()).model, experiment()),
    }


@pytest.mark.parametrize("name", results())
def test_a_result_is_drawn_into_the_axes_given(name: str) -> None:
    figure, (left, right) = plt.subplots(1, 2, layout="constrained")
    given = results()[name]()
    assert plot(given, right) is right
    figure.canvas.draw()
    assert right.has_data()
    assert not left.has_data()
    assert right.get_ylabel()
    assert right.get_xlabel() or right.get_xticklabels()[0].get_text()
    assert {axes for axes in figure.axes if axes.has_data()} <= {right, *figure.axes[2:]}


def layers_of(given: Any) -> list[str]:  # noqa: ANN401
    made = registry.of_result(given)
    panels = (*made.panels, *getattr(made, "recorded", ()))
    return list(dict.fromkeys(panel.name for panel in panels))


SIZES = [(6.4, 4.8), (4.0, 3.0), (9.0, 5.0), (3.4, 2.8)]  # Figures in inches


@pytest.mark.parametrize("name", results())
def test_no_text_or_legend_is_cut_off_by_a_figure_without_a_layout(name: str) -> None:
    given, drawn = results()[name](), 0
    for k, layer in enumerate(layers_of(given)):
        wide, high = SIZES[k % len(SIZES)]
        count = 1 + (k + len(name)) % 2
        figure, every = plt.subplots(1, count, figsize=(wide * count, high), squeeze=False)
        axes = every[0, -1]
        try:
            plot(given, axes, layer=layer)
        except InputError:  # a panel of recordings alone
            continue
        drawn += 1
        figure.canvas.draw()
        legend = axes.get_legend()
        boxes = [one.get_tightbbox() for one in figure.axes if one.axison]
        boxes += [text.get_window_extent() for text in axes.texts if text.get_text()]
        if legend is not None:
            boxes.append(legend.get_window_extent())
            assert all(text.get_text().strip() for text in legend.get_texts())
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


def test_other_axes_of_a_figure_stay_where_they_are() -> None:
    figure, every = plt.subplots(2, 2)
    before = [axes.get_position().bounds for axes in every.flat]
    plot(MAP, every[0, 0], legend=True)
    after = [axes.get_position().bounds for axes in every.flat]
    assert after[0] != before[0]
    assert after[1:] == before[1:]
    assert figure.get_layout_engine() is None
    assert not figure.legends


@pytest.mark.parametrize("layout", ["constrained", "tight", None])
@pytest.mark.parametrize("later", ["tight_layout", "subplots_adjust"])
def test_a_legend_is_kept_by_layouts_of_the_user(layout: str | None, later: str) -> None:
    figure, every = plt.subplots(2, 2, figsize=(9.0, 7.0), layout=layout)
    for axes in every.flat:
        plot(MOTION, axes, layer="phase")
        plot(MAP, axes, layer="settle", legend=True)
    if layout is None:
        before = every[0, 0].get_position().bounds
        getattr(figure, later)()
        assert every[0, 0].get_position().bounds != before  # Axes are still the layout's
    figure.canvas.draw()
    assert all(axes.get_tightbbox().y0 >= 0 for axes in every.flat)


def test_recorded_curves_of_a_panel_have_names_and_colours_of_their_own() -> None:
    model, ranges = Pendulum(), {"p": (0.3, 1.8, 6), "omega": (1.6, 2.4, 6)}
    made = [registry.of_result(make()) for make in results().values()]
    made.append(registry.of_result(pendmap.parameter_map(model, ranges, curves=True)))
    for chart in made:
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
            for member in (selection.shown(swept.sel(p=p)), alone)
        ]
        assert looks[1] <= looks[0] or looks[0] <= looks[1], looks


def test_a_panel_has_the_limits_ticks_and_names_of_the_figure() -> None:
    axes = plot(MOTION, layer="phase")
    assert axes.get_xlim() == pytest.approx((-np.pi, np.pi))
    assert axes.get_xlabel() == "$θ$ (rad)"
    assert axes.get_ylabel() == "$dθ/dτ$"
    curve = axes.lines[0].get_xydata()
    assert np.isin(np.round(MOTION["velocity"].values[:5], 12), np.round(curve[:, 1], 12)).all()


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
    found = pendmap.orbit(Pendulum(p=0.6), 2)
    figure, (left, right) = plt.subplots(1, 2, figsize=(5.0, 2.6), layout="constrained")
    for axes in (left, right):
        plot(found, axes, legend=True)
    figure.draw_without_rendering()
    for axes in (left, right):
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
    assert axes.get_title() == "both"
    plot(MAP, axes)
    assert axes.get_xlabel() == "$τ$"


def test_a_second_result_adds_to_the_legend() -> None:
    _, axes = plt.subplots(figsize=(6.0, 6.0))
    plot(pendmap.orbit(Pendulum(p=0.6), 1), axes, legend=True)
    first = {text.get_text() for text in axes.get_legend().get_texts()}
    plot(pendmap.lyapunov(Pendulum(p=0.6)), axes, legend=True)
    assert first < {text.get_text() for text in axes.get_legend().get_texts()}


def test_labels_that_are_unreliable_say_so_under_any_title() -> None:
    doubtful = synthetic.painted(**synthetic.UNRELIABLE)
    for title in (True, False, "mine"):
        _, axes = plt.subplots(figsize=(3.0, 3.0))
        plot(doubtful, axes, layer="labels", title=title)
        (warning,) = (t for t in axes.texts if "labels unreliable" in t.get_text())
        axes.figure.canvas.draw()
        assert warning.get_window_extent().x1 < axes.bbox.x1
    assert not plot(doubtful).texts  # the settle time


def test_the_leading_part_has_no_names_of_other_parts() -> None:
    doubtful = synthetic.painted(**synthetic.UNRELIABLE)
    assert plot(doubtful, legend=True).get_legend() is None
    assert plot(doubtful, layer="labels", legend=True).get_legend() is not None


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
    run = pendmap.simulate(Pendulum(), 1.0, 0.0, 20.0)
    _, axes = plt.subplots()
    assert run.pendmap.plot(axes, layer="phase") is axes
    assert run.pendmap.plot(ax=axes, layer="phase") is axes


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: plot(3), "cannot draw 3; kinds that can be: "),
        (lambda: plot(MAP, layer="no"), "'no' in this map; it has labels, settle, turns"),
        (lambda: plot(experiment(), layer="no"), "no layer 'no' in this figure; it has"),
        (lambda: plot(identify(experiment()), layer="no"), "it has"),
        (lambda: plot(MAP, layer="settle", colormap="no"), "no colour map 'no'"),
        (lambda: plot(MAP, legend="upper right"), "legend must be a bool"),
        (lambda: render.figure_of(MAP, width=0), "width must be positive"),
        (lambda: render.figure_of(MAP, width=86, size=(3, 3)), "and no size given"),
    ],
)
def test_bad_input_is_refused(call: Callable[[], object], said: str) -> None:
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        call()


@pytest.mark.parametrize("width", [86, 178])
@pytest.mark.parametrize("given", [MAP, MOTION, synthetic.painted(**synthetic.UNRELIABLE)])
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
