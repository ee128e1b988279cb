"""Figures: what they show, that nothing overlaps or is cut, and that files are whole or absent."""

from __future__ import annotations

import itertools
import math
import struct
import subprocess
import sys
import tracemalloc
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pytest
import xarray as xr
from matplotlib import rc_context
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.text import Text

import synthetic
from pendmap import InputError, figures, palette
from pendmap.figures import basins, style, trajectory
from pendmap.pictures import layers, legend, plane

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

Floats = npt.NDArray[np.float64]
UNRELIABLE: dict[str, Any] = {"labels_reliable": 0, "unreliable": 0.207}

# Machado, Oliveira and Fernandes (2009): protanopia, deuteranopia, tritanopia, on linear RGB.
DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
COEXISTING = (
    ("rest", "rotation 1:+1", "rotation 1:-1", "oscillation 2:0", "undecided", "failed"),
    ("rest", "rotation 1:+1", "rotation 1:-1", "oscillation 1:0 (+)", "oscillation 1:0 (-)"),
    ("oscillation 2:0", "rotation 1:+1", "rotation 1:-1", "rotation 2:+2", "rotation 2:-2"),
    ("rest", "inverted rest", "rotation 1:+1", "rotation 1:-1", "tumbling chaos", "undecided"),
    ("rotating chaos +", "rotating chaos -", "tumbling chaos", "oscillation 2:0", "failed"),
    ("oscillation 4:0 (+)", "oscillation 4:0 (-)", "rotation 1:+1", "rotation 1:-1", "undecided"),
    ("rest", "oscillation 1:0", "oscillation 2:0", "oscillation 3:0", "tumbling chaos"),
)


def perceived(name: str, deficiency: str) -> npt.NDArray[np.float64]:
    """Return a colour in Ottosson's OKLab, times 100, as it is seen."""
    channel = np.array(palette.rgb(name)) / 255
    linear = np.where(channel <= 0.04045, channel / 12.92, ((channel + 0.055) / 1.055) ** 2.4)
    seen = np.clip(DEFICIENCIES[deficiency] @ linear, 0, 1)
    to_cones = np.array(
        [
            [0.4122214708, 0.5363325363, 0.0514459929],
            [0.2119034982, 0.6806995451, 0.1073969566],
            [0.0883024619, 0.2817188376, 0.6299787005],
        ]
    )
    to_lab = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    lab: npt.NDArray[np.float64] = 100 * to_lab @ np.cbrt(to_cones @ seen)
    return lab


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("names", COEXISTING, ids=lambda names: names[0])
def test_colours_that_coexist_are_told_apart(names: tuple[str, ...], deficiency: str) -> None:
    for one, other in itertools.combinations(names, 2):
        gap = np.linalg.norm(perceived(one, deficiency) - perceived(other, deficiency))
        assert gap > 5.0, (one, other, gap)


def test_colours_go_by_name_alone() -> None:
    assert palette.colour("rest") == "#474747"
    assert palette.colour("rotation 1:\N{MINUS SIGN}1") == palette.colour("rotation 1:-1")
    assert palette.colour("inverted_rest") == palette.colour("inverted rest")
    assert palette.colour("a name of its own", "tumbling_chaos") == palette.colour("tumbling chaos")
    assert palette.colour("rotation 1:+1", "tumbling_chaos") == palette.colour("rotation 1:+1")
    assert palette.colour("no such thing") == palette.UNNAMED
    for name in itertools.chain(*COEXISTING):
        red, green, blue = palette.rgb(name)
        assert f"#{red:02x}{green:02x}{blue:02x}" == palette.colour(name)
        assert palette.describe(name).replace(" ", "").isalpha()


def test_signed_colours_are_white_at_zero_and_symmetric_in_lightness() -> None:
    low, zero, high, beyond = palette.diverging([-1.0, 0.0, 1.0, 7.0]).astype(int)
    assert zero.min() > 240
    assert low[2] > low[0]
    assert high[0] > high[2]
    assert (beyond == high).all()


# What the figures show


def made(dataset: xr.Dataset, layer: str | None = None) -> Figure:
    draw = {"basins": basins.figure, "trajectory": trajectory.figure}[dataset.attrs["kind"]]
    with rc_context(style.RC):
        figure = draw(dataset, layer=layer, size=None, dpi=100.0, colormap=None)
        figure.canvas.draw()
    return figure


def titles(figure: Figure) -> list[str]:
    found = (axes.get_title(loc="left") for axes in figure.axes)
    return [text.removeprefix(f"({text[1:2]}) ") for text in found if text]


def named(figure: Figure) -> list[str]:
    return [text.get_text() for box in figure.legends for text in box.get_texts()]


def written(figure: Figure) -> str:
    texts = (found.get_text() for found in figure.findobj(Text) if isinstance(found, Text))
    return " ".join(" ".join(texts).split())


def test_labels_lead_and_settle_time_stands_beside_them() -> None:
    figure = made(synthetic.painted(synthetic.USUAL[:4]))
    assert titles(figure) == ["basins of attraction", "settle time"]
    assert "periods to settle" in written(figure)
    assert "\N{GREEK SMALL LETTER GAMMA} = 0.1,  p = 1,  \N{GREEK SMALL LETTER OMEGA} = 2" in (
        figure.texts[1].get_text()
    )
    settle = figure.axes[1].images[-1]
    assert isinstance(settle.norm, LogNorm)
    assert figure.axes[0].get_xlabel() == "\N{GREEK SMALL LETTER THETA} (rad)"
    ticks = [tick.get_text() for tick in figure.axes[0].get_xticklabels()]
    assert ticks == ["\N{MINUS SIGN}π", "\N{MINUS SIGN}π/2", "0", "π/2", "π"]


def test_without_drive_there_is_no_frequency() -> None:
    figure = made(synthetic.painted(synthetic.USUAL[:2], p=0.0, torque=0.5, phase=0.3))
    assert (
        figure.texts[1]
        .get_text()
        .startswith("\N{GREEK SMALL LETTER GAMMA} = 0.1,  p = 0,  torque = 0.5;")
    )
    assert "periods of 2\N{GREEK SMALL LETTER PI} to settle" in written(figure)


def test_legend_names_share_error_and_twin() -> None:
    dataset = synthetic.painted(synthetic.USUAL[:3], (30, 40))
    texts = named(made(dataset))
    assert len(texts) == 3
    share, stderr = (100 * float(dataset[v].values[1]) for v in ("fraction", "stderr"))
    assert texts[1] == (
        f"rotation 1:+1, {share:.1f} \N{PLUS-MINUS SIGN} {stderr:.1f} %,"
        " twin of rotation 1:\N{MINUS SIGN}1"
    )
    assert texts[0].startswith("rest, ")
    assert "twin" not in texts[0]


def test_undecided_and_failed_are_in_the_legend_only_if_present() -> None:
    both = named(made(synthetic.painted(shape=(10, 10), undecided=7, failed=3)))
    assert both[-2:] == ["undecided, 7 %", "failed, 3 %"]
    assert not [t for t in named(made(synthetic.painted())) if t.startswith(("undec", "fail"))]


def test_cells_have_their_attractors_colour_the_right_way_up() -> None:
    dataset = synthetic.painted(synthetic.USUAL[:5], (12, 9), undecided=2, failed=1)
    image = made(dataset).axes[0].images[0]
    drawn = np.asarray(image.get_array())
    assert image.origin == "lower"
    assert image.get_extent() == pytest.approx([-math.pi, math.pi, -3, 3])
    for (row, column), label in np.ndenumerate(dataset["label"].values):
        name = {0: "undecided", -1: "failed"}.get(
            int(label), str(dataset["attractor"].values[label - 1])
        )
        assert tuple(drawn[row, column]) == palette.rgb(name)


def test_attractors_are_marked_with_their_copies() -> None:
    dataset = synthetic.painted(
        synthetic.USUAL[:4], theta=(-2 * math.pi, 2 * math.pi), velocity=(-1.0, 3.0)
    )
    marks = {line.get_markerfacecolor(): line.get_xydata() for line in made(dataset).axes[0].lines}
    rest = np.asarray(marks[palette.colour("rest")])
    assert sorted(rest[:, 0]) == pytest.approx([-2 * math.pi, 0, 2 * math.pi])
    swing = np.asarray(marks[palette.colour("oscillation 2:0")])
    assert len(swing) == 4
    assert palette.colour("rotation 1:-1") not in marks, "its point lies outside the window"


def test_values_of_settle_time_and_cells_without_one() -> None:
    dataset = synthetic.painted(synthetic.USUAL[:3], (8, 8), undecided=3)
    settle = made(dataset).axes[1].images[-1]
    drawn: Floats = np.ma.filled(np.ma.asarray(settle.get_array()), np.nan)
    expected = dataset["settle_periods"].values
    assert (np.isnan(drawn) == (expected < 0)).all()
    assert (drawn[expected >= 0] == np.maximum(expected, 1)[expected >= 0]).all()


def test_unreliable_labels_come_last_small_and_marked() -> None:
    figure = made(synthetic.painted(**UNRELIABLE))
    assert titles(figure) == ["settle time", "net turns until settled", "basins of attraction"]
    warning = "labels unreliable: 20.7 % change under half the step or mirroring"
    assert warning in written(figure)
    boxes = [axes.get_window_extent() for axes in figure.axes if axes.get_title(loc="left")]
    assert boxes[2].width < 0.7 * boxes[0].width
    assert boxes[0].width == pytest.approx(boxes[1].width)
    assert warning in written(made(synthetic.painted(**UNRELIABLE), "labels"))
    assert "unreliable" not in written(made(synthetic.painted()))


def test_chaos_that_takes_all_shows_turns_exponent_and_its_points() -> None:
    dataset = synthetic.chaotic(cells=24, periods=4)
    figure = made(dataset)
    assert titles(figure) == [
        "net turns after 4 periods",
        "finite-time exponent over 4 periods",
        "its attractor, once a period",
    ]
    assert named(figure) == ["tumbling chaos, 100 % of the starts"]
    turns = figure.axes[0].images[-1]
    low, high = turns.get_clim()
    assert low == -(high or 0.0) < 0.0
    assert (np.asarray(turns.get_array()) == dataset["net_turns"].values).all()


def test_without_damping_there_is_nothing_to_name() -> None:
    figure = made(synthetic.chaotic(gamma=0.0, p=0.6, omega=2.0, cells=24, periods=4))
    assert titles(figure) == ["net turns after 4 periods", "finite-time exponent over 4 periods"]
    assert named(figure) == []
    assert "No attractors without damping" in written(figure)


def test_a_real_map_has_the_basins_of_the_smooth_point() -> None:
    dataset = synthetic.integrated(p=0.6, cells=30, periods=60)
    figure = made(dataset)
    drawn = np.asarray(figure.axes[0].images[0].get_array()).reshape(-1, 3)
    yellow = np.all(drawn == palette.rgb("oscillation 2:0"), axis=1).mean()
    blue = np.all(drawn == palette.rgb("rotation 1:-1"), axis=1).mean()
    red = np.all(drawn == palette.rgb("rotation 1:+1"), axis=1).mean()
    assert yellow == pytest.approx(0.83, abs=0.03)
    assert blue == red == pytest.approx(0.085, abs=0.02)


def test_the_parts_of_a_trajectory() -> None:
    dataset = synthetic.swing(periods=20, steps=30)
    figure = made(dataset)
    assert titles(figure) == ["time history", "phase plane", "Poincaré section, once a period"]
    history, phase, section = figure.axes
    assert points(history) == dataset.sizes["time"] + 1
    for line in phase.lines:
        xy = np.asarray(line.get_xydata())
        assert np.nanmax(np.abs(xy[:, 0])) <= math.pi + 1e-12
        assert np.nanmax(np.abs(np.diff(xy[:, 0]))) < 1.0, "a line crosses the plane at the wrap"
    assert points(section) == dataset.sizes["period"]


def points(axes: Axes) -> int:
    return sum(len(np.asarray(line.get_xydata())) for line in axes.lines)


# Layout: nothing cut, nothing covered

VARIANTS = {
    "usual": synthetic.painted(synthetic.USUAL[:4]),
    "one": synthetic.painted(synthetic.USUAL[:1], (1, 1)),
    "none": synthetic.painted((), (6, 5)),
    "three by two": synthetic.painted(synthetic.USUAL[:2], (3, 2)),
    "twelve": synthetic.painted(synthetic.USUAL, (60, 60), undecided=200, failed=100),
    "twelve unreliable": synthetic.painted(synthetic.USUAL, (60, 60), **UNRELIABLE),
    "wide": synthetic.painted(theta=(-4 * math.pi, 4 * math.pi), velocity=(-2.0, 2.0)),
    "wide unreliable": synthetic.painted(
        theta=(-4 * math.pi, 4 * math.pi), velocity=(-2.0, 2.0), **UNRELIABLE
    ),
    "flat unreliable": synthetic.painted(
        theta=(-1.6 * math.pi, 1.6 * math.pi), velocity=(-3.0, 3.0), **UNRELIABLE
    ),
    "tall": synthetic.painted(theta=(-0.3, 0.4), velocity=(-6.0, 6.0)),
    "two chaotic": synthetic.painted(synthetic.USUAL[10:12]),
    "chaos": synthetic.chaotic(cells=16, periods=3),
    "trajectory": synthetic.swing(periods=8, steps=20),
    "torque": synthetic.painted(phase=0.25, torque=-0.5),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_no_text_is_cut_or_covers_a_panel(variant: str) -> None:
    figure = made(VARIANTS[variant])
    whole = figure.bbox
    panels = [axes.get_window_extent() for axes in figure.axes]
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        box = text.get_window_extent()
        if not text.get_text().strip() or not text.get_visible() or box.width == 0:
            continue
        inside = whole.x0 - 1 <= box.x0 and box.x1 <= whole.x1 + 1
        assert inside, (text.get_text(), box)
        assert whole.y0 - 1 <= box.y0, (text.get_text(), box)
        assert box.y1 <= whole.y1 + 1, (text.get_text(), box)
        assert not any(overlap(box, panel) for panel in panels), text.get_text()
    others = [text.get_window_extent() for text in figure.findobj(Text) if shown(text)]
    for one, other in itertools.combinations(others, 2):
        assert not overlap(one, other)


def shown(text: object) -> bool:
    return isinstance(text, Text) and text.get_visible() and bool(text.get_text().strip())


def overlap(one: Bbox, other: Bbox) -> bool:
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return bool(wide > 1.5 and high > 1.5)


# Files


@pytest.mark.parametrize(
    ("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_files_are_written_whole_and_the_same_each_time(
    tmp_path: Path, suffix: str, magic: bytes
) -> None:
    dataset = synthetic.painted()
    first = figures.draw(dataset, tmp_path / f"a.{suffix}")
    second = figures.draw(dataset, str(tmp_path / f"b.{suffix}"))
    assert first.read_bytes().startswith(magic)
    assert first.read_bytes() == second.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"a.{suffix}", f"b.{suffix}"]


def test_size_and_resolution_are_kept(tmp_path: Path) -> None:
    file = figures.draw(synthetic.painted(), tmp_path / "a.png", size=(7.5, 5.0), dpi=80)
    assert struct.unpack(">II", file.read_bytes()[16:24]) == (600, 400)


@pytest.mark.parametrize("layer", ["labels", "label", "settle", "net_turns", "turns"])
def test_one_layer_alone(tmp_path: Path, layer: str) -> None:
    figures.draw(synthetic.painted(), tmp_path / "a.png", layer=layer, dpi=50)
    assert len(titles(made(synthetic.painted(), layer))) == 1


def test_the_colour_map_is_used(tmp_path: Path) -> None:
    plain = figures.draw(synthetic.painted(), tmp_path / "a.png", layer="settle", dpi=50)
    other = figures.draw(
        synthetic.painted(), tmp_path / "b.png", layer="settle", dpi=50, colormap="cividis"
    )
    assert plain.read_bytes() != other.read_bytes()


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("a.jpg", {}, r"'\.jpg'.*\.png, \.svg, \.pdf"),
        ("a", {}, r"suffix ''"),
        ("a.png", {"layer": "exponent"}, "'exponent'.*labels, settle, turns"),
        ("a.png", {"layer": "colour"}, "'colour'"),
        ("a.png", {"colormap": "rainbowish"}, "'rainbowish'.*viridis"),
        ("a.png", {"layer": "labels", "colormap": "viridis"}, "attractor"),
        ("a.png", {"size": (1.0, 1.0)}, r"\(1\.0, 1\.0\).*at least"),
        ("a.png", {"size": (math.nan, 5.0)}, "nan"),
        ("a.png", {"size": (200.0, 5.0)}, "at most"),
        ("a.png", {"size": (30.0, 5.0), "dpi": 1000}, "20000 pixels"),
        ("a.png", {"dpi": 5}, "dpi 5"),
        ("a.png", {"dpi": math.nan}, "dpi nan"),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(
    tmp_path: Path, name: str, options: dict[str, object], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        figures.draw(synthetic.painted(), tmp_path / name, **options)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_a_dataset_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"kind None.*basins, trajectory"):
        figures.draw(xr.Dataset(), tmp_path / "a.png")
    with pytest.raises(InputError, match="list of starts"):
        figures.draw(synthetic.painted().isel(theta=0, drop=True), tmp_path / "a.png")


def test_a_trajectory_has_its_own_layers(tmp_path: Path) -> None:
    dataset = synthetic.swing(periods=3, steps=20)
    figures.draw(dataset, tmp_path / "a.png", layer="section", dpi=50)
    with pytest.raises(InputError, match=r"'labels'.*history, phase, section"):
        figures.draw(dataset, tmp_path / "b.png", layer="labels")


def test_an_absent_folder_or_a_folder_in_the_way(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="folder does not exist"):
        figures.draw(synthetic.painted(), tmp_path / "no" / "a.png")
    (tmp_path / "b.png").mkdir()
    with pytest.raises(IsADirectoryError, match=r"b\.png"):
        figures.draw(synthetic.painted(), tmp_path / "b.png")


def test_an_interrupt_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.png"
    file.write_bytes(b"old")

    def interrupted(_figure: Figure, part: Path) -> None:
        part.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(style, "write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        figures.draw(synthetic.painted(), file)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_large_maps_are_never_converted_whole(tmp_path: Path) -> None:
    peaks = []
    for side in (1000, 4000):
        dataset = enlarged(synthetic.painted(synthetic.USUAL[:3], (10, 10), undecided=4), side)
        figures.draw(dataset, tmp_path / "warm.png")
        tracemalloc.start()
        figures.draw(dataset, tmp_path / "a.png")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 4000 * 4000, "more than one byte a cell beyond the thinned map"


def enlarged(dataset: xr.Dataset, side: int) -> xr.Dataset:
    """Return a map of ``side`` squared cells, its arrays in memory."""
    index = np.arange(side) * dataset.sizes["theta"] // side
    return (
        dataset.isel(theta=index, velocity=index)
        .assign_coords(
            theta=synthetic.centres(-math.pi, math.pi, side),
            velocity=synthetic.centres(-3, 3, side),
        )
        .load()
    )


def test_neither_library_is_loaded_before_it_is_needed() -> None:
    code = (
        "import sys; from pendmap import palette; from pendmap.pictures import legend, plane;"
        "assert not {'matplotlib', 'rerun'} & set(sys.modules);"
        "from pendmap import figures;"
        "assert not {'matplotlib.pyplot', 'rerun'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# The pieces


def test_thinning_keeps_at_most_the_limit_and_copies_nothing() -> None:
    array = xr.DataArray(np.arange(1000 * 70).reshape(1000, 70), dims=("velocity", "theta"))
    thin = plane.thinned(array, 100)
    assert thin.shape == (100, 70)
    assert np.shares_memory(thin, array.values)
    assert plane.thinned(array, 1000) is not None
    assert (plane.thinned(array, 1000) == array.values).all()


def test_a_curve_is_cut_exactly_at_the_wrap() -> None:
    theta = np.linspace(0.0, -7 * math.pi, 400)
    curve = plane.broken_at_wrap(theta, theta)
    gaps = np.flatnonzero(np.isnan(curve[:, 0]))
    assert len(gaps) == 4
    assert np.allclose(curve[gaps - 1, 0], -math.pi)
    assert np.allclose(curve[gaps + 1, 0], math.pi)
    assert np.allclose(curve[gaps - 1, 1], [-math.pi * k for k in (1, 3, 5, 7)])
    assert len(plane.broken_at_wrap([], [])) == 0


@pytest.mark.parametrize(
    ("window", "labels"),
    [
        ((-math.pi, math.pi), "-π -π/2 0 π/2 π"),
        ((0, 2 * math.pi), "0 π/2 π 3π/2 2π"),
        ((-math.pi / 2, math.pi / 2), "-π/2 -π/4 0 π/4 π/2"),
        ((-4 * math.pi, 4 * math.pi), "-4π -2π 0 2π 4π"),
        ((0.1, 0.2), "0.1 0.12 0.14 0.16 0.18 0.2"),
    ],
)
def test_angle_ticks(window: tuple[float, float], labels: str) -> None:
    ticks = plane.angle_ticks(*window)
    assert " ".join(label for _, label in ticks) == labels.replace("-", "\N{MINUS SIGN}")
    assert all(window[0] - 1e-9 <= at <= window[1] + 1e-9 for at, _ in ticks)


@pytest.mark.parametrize(
    ("share", "stderr", "text"),
    [
        (0.20921, 0.00131, "20.92 ± 0.13 %"),
        (0.5, 0.05, "50.0 ± 5.0 %"),
        (1.0, 0.0, "100 %"),
        (0.25, math.nan, "25 %"),
        (0.333, 0.19, "33 ± 19 %"),
    ],
)
def test_percent_has_the_digits_its_error_supports(share: float, stderr: float, text: str) -> None:
    assert legend.percent(share, stderr) == text


def test_layers_lead_as_the_map_demands() -> None:
    assert layers.layers(synthetic.painted()) == ("labels", "settle", "turns")
    assert layers.layers(synthetic.painted(**UNRELIABLE)) == ("settle", "turns", "labels")
    assert layers.layers(VARIANTS["chaos"]) == ("turns", "exponent")
    assert layers.layers(VARIANTS["two chaotic"]) == ("labels", "turns")


def test_a_legend_entry_has_the_colour_of_its_cells() -> None:
    dataset = synthetic.painted(synthetic.USUAL, undecided=3, failed=2)
    table = legend.colours(dataset)
    for entry in legend.entries(dataset):
        assert tuple(table[entry.id + 1] / 255) == pytest.approx(to_rgb(entry.colour))
