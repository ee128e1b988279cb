"""Components of figures: colours, thinning, wrapped curves, ticks, layers, legend, room."""

from __future__ import annotations

import itertools
import math

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pytest
import xarray as xr
from matplotlib import rc_context

import motions
import synthetic
from drawn import assert_room, made
from pendmap._core import Attractor
from pendmap.charts import basins, legend, palette, plane, registry
from pendmap.charts.chart import Axis
from pendmap.render import drawing, style


def test_a_pixel_shows_the_cell_at_its_centre() -> None:
    axes = {"velocity": np.arange(1000.0), "theta": np.arange(70.0)}
    cells = np.arange(1000 * 70).reshape(1000, 70)
    dataset = xr.Dataset({"label": (("velocity", "theta"), cells)}, coords=axes)
    thin = plane.pixels(dataset, dataset["label"], 300)
    assert thin.shape == (300, 70)
    assert (thin == cells[((np.arange(300) + 0.5) / 0.3).astype(int)]).all()
    assert np.shares_memory(plane.pixels(dataset, dataset["label"], 1000), cells)
    uneven = dataset.isel(velocity=[0, 1, 5])
    shown = plane.pixels(uneven, uneven["label"], 300)
    edges = plane.edges(uneven, "velocity")
    assert edges == pytest.approx([-0.5, 0.5, 3.0, 7.0])
    at = edges[0] + (np.arange(len(shown)) + 0.5) * (edges[-1] - edges[0]) / len(shown)
    assert (shown[:, 0] == np.where(at < 0.5, 0, np.where(at < 3.0, 70, 350))).all()


def test_a_curve_is_cut_exactly_at_the_wrap() -> None:
    theta = np.linspace(0.0, -7 * math.pi, 400)
    curve = plane.broken_at_wrap(theta, theta)
    gaps = np.flatnonzero(np.isnan(curve[:, 0]))
    assert len(gaps) == 4
    assert np.allclose(curve[gaps - 1, 0], -math.pi)
    assert np.allclose(curve[gaps + 1, 0], math.pi)
    assert np.allclose(curve[gaps - 1, 1], [-math.pi * k for k in (1, 3, 5, 7)])
    assert len(plane.broken_at_wrap([], [])) == 0


def test_angles_of_any_size_are_wrapped() -> None:
    far = np.array([math.pi, -math.pi, 1e16, -1e300, 1.7e308])
    within = plane.wrapped(far)
    assert (np.abs(within) <= math.pi).all()
    assert within[:2].tolist() == [math.pi, math.pi]
    curve = plane.broken_at_wrap(1e16 + np.arange(0.0, 40.0, 2.0), np.ones(20))
    assert np.nanmax(np.abs(curve[:, 0])) <= math.pi


@pytest.mark.parametrize(
    ("window", "labels"),
    [
        ((-math.pi, math.pi), "-π -π/2 0 π/2 π"),
        ((-math.pi / 2, math.pi / 2), "-π/2 -π/4 0 π/4 π/2"),
        ((-4 * math.pi, 4 * math.pi), "-4π -2π 0 2π 4π"),
        ((0.1, 0.2), "0.1 0.12 0.14 0.16 0.18 0.2"),
    ],
)
def test_ticks_of_angles_depend_on_the_width_of_the_window(
    window: tuple[float, float], labels: str
) -> None:
    _, ticks = plane.ticks(Axis("θ", scale="angle"), *window)
    assert " ".join(label for _, label in ticks) == labels.replace("-", "\N{MINUS SIGN}")


@pytest.mark.parametrize(
    ("low", "high", "most", "labels"),
    [
        (1.0, 135.0, 8, "1 2 5 10 20 50 100"),
        (1.0, 135.0, 5, "1 3 10 30 100"),
        (5.0, 9.0, 8, "5 6 7 8 9"),
        (1e-8, 1e3, 4, "$10^{-8}$ $10^{-5}$ 0.01 10"),
    ],
)
def test_ticks_of_a_logarithmic_axis_have_room(
    low: float, high: float, most: int, labels: str
) -> None:
    _, ticks = plane.ticks(Axis("n", scale="log"), low, high, most)
    assert " ".join(label for _, label in ticks) == labels


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


def test_the_first_layers_depend_on_the_map() -> None:
    assert basins.layers(synthetic.painted()) == ("labels", "settle", "turns")
    assert basins.layers(synthetic.painted(**synthetic.UNRELIABLE)) == ("settle", "turns", "labels")
    assert basins.layers(motions.chaotic(cells=16, periods=3)) == ("turns", "exponent")
    assert basins.layers(synthetic.painted(synthetic.USUAL[10:12])) == ("labels", "turns")


FLAT = {"theta": (-1.6 * math.pi, 1.6 * math.pi), "velocity": (-3.0, 3.0)}
MAPS = {
    "one": synthetic.painted(synthetic.USUAL[:1], (1, 1)),
    "twelve unreliable": synthetic.painted(synthetic.USUAL, (60, 60), **synthetic.UNRELIABLE),
    "flat unreliable": synthetic.painted(**FLAT, **synthetic.UNRELIABLE),
    "tall": synthetic.painted(theta=(-0.3, 0.4), velocity=(-6.0, 6.0)),
    "two chaotic": synthetic.painted(synthetic.USUAL[10:12]),
    "trajectory": motions.swing(periods=8, steps=20),
}
SHRUNK = {
    "usual": synthetic.painted(),
    "thin": synthetic.painted(theta=(0.0, 1e-12), velocity=(-1.0, 1.0), **synthetic.UNRELIABLE),
    "far": synthetic.painted(theta=(1e6, 1e6 + 1.0), velocity=(-1.0, 1.0)),
    "huge": synthetic.painted(theta=(1e300, 2e300), velocity=(-1.0, 1.0)),
    "chaos": motions.chaotic(cells=16, periods=3),
}


@pytest.mark.parametrize("name", MAPS)
def test_no_text_is_cut_or_covered(name: str) -> None:
    assert_room(made(MAPS[name]))


@pytest.mark.parametrize("name", SHRUNK)
def test_texts_have_room_in_a_smaller_figure(name: str) -> None:
    with rc_context(style.RC):
        chart = registry.build(SHRUNK[name])
        wide, high = drawing.draw(chart).get_size_inches()
        figure = drawing.draw(chart, size=(0.3 * wide, 0.3 * high), dpi=100.0)
        figure.canvas.draw()
    assert_room(figure)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (0.0, 1e-12),
        (1e300, 2e300),
        (-1e307, 1e307),
        (1e6, 1e6 + 1),
        (1e17, 1e17 + 64),
        (0.0, 1e-322),
        (-3e5, 3e5),
        (-math.pi, math.pi),
    ],
)
def test_there_is_a_handful_of_ticks_whatever_the_window(low: float, high: float) -> None:
    shift, ticks = plane.short_ticks(low, high, angle=True)
    assert 1 <= len(ticks) <= 8
    assert len({label for _, label in ticks}) == len(ticks)
    assert all(len(label) <= 8 for _, label in ticks)
    slack = 1e-6 * (high - low)
    assert all(low - slack <= shift + at <= high + slack for at, _ in ticks)


def test_indistinguishable_copies_are_left_out() -> None:
    circle = xr.Dataset()
    points = synthetic.USUAL[1].points
    assert len(plane.copies(circle, points, -10 * math.pi, 10 * math.pi)) == 10
    assert len(plane.copies(circle, points, 1e300, 2e300)) == 0


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
REST, TUMBLING = Attractor("rest", 1), Attractor("tumbling_chaos")
FORWARD, BACKWARD = Attractor("rotation", 1, 1), Attractor("rotation", 1, -1)
DOUBLED = Attractor("oscillation", 2)
COEXISTING = (
    (REST, FORWARD, BACKWARD, DOUBLED, "undecided", "failed"),
    (REST, FORWARD, BACKWARD, *(Attractor("oscillation", 1, lean=side) for side in (1, -1))),
    (DOUBLED, FORWARD, BACKWARD, Attractor("rotation", 2, 2), Attractor("rotation", 2, -2)),
    (REST, Attractor("inverted_rest", 1), FORWARD, BACKWARD, TUMBLING, "undecided"),
    (*(Attractor("rotating_chaos", w=w) for w in (1, -1)), TUMBLING, DOUBLED, "failed"),
    (*(Attractor("oscillation", 4, lean=side) for side in (1, -1)), FORWARD, BACKWARD, "undecided"),
    (REST, *(Attractor("oscillation", n) for n in (1, 2, 3)), TUMBLING),
)


def shade(one: Attractor | str) -> str:
    cells = {"undecided": palette.UNDECIDED, "failed": palette.FAILED}
    return cells[one] if isinstance(one, str) else palette.colour(one)


def perceived(one: Attractor | str, deficiency: str) -> npt.NDArray[np.float64]:
    """Return the perceived colour in Ottosson's OKLab, times 100."""
    channel = np.array(palette.parts(shade(one))) / 255
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
@pytest.mark.parametrize("every", COEXISTING)
def test_colours_that_coexist_are_distinguishable(
    every: tuple[Attractor | str, ...], deficiency: str
) -> None:
    for one, other in itertools.combinations(every, 2):
        gap = np.linalg.norm(perceived(one, deficiency) - perceived(other, deficiency))
        assert gap > 5.0, (one, other, gap)


@pytest.mark.parametrize("name", ["RdBu_r", "cividis", "magma", "viridis"])
def test_colours_of_recordings_are_those_of_figures(name: str) -> None:
    at = np.linspace(0.0, 1.0, 256)
    drawn = 255 * mpl.colormaps[name](at)[:, :3]
    assert np.abs(palette.shades(name, at) - drawn).max() < 16


@pytest.mark.parametrize(
    ("kind", "turns", "lean"), [("oscillation", 0, 0), ("oscillation", 0, 1), ("rotation", -1, 0)]
)
def test_colours_of_all_periods_differ(kind: str, turns: int, lean: int) -> None:
    every = [Attractor(kind, n, turns * n, lean) for n in range(1, 33)]
    assert len({palette.colour(one) for one in every}) == len(every)
    for one, other in itertools.combinations(every, 2):
        gap = float(np.linalg.norm(perceived(one, "none") - perceived(other, "none")))
        assert gap > 1.0 or palette.lap(one) != palette.lap(other), (one, other, gap)


def test_a_repeated_colour_is_darker_or_lighter() -> None:
    assert palette.lap(DOUBLED) == palette.lap(Attractor("rotation", 5, 5)) == 0
    late = Attractor("oscillation", 14)
    assert palette.lap(late) == 2
    lightness = [perceived(Attractor("oscillation", n), "none")[0] for n in (8, 2, 14)]
    assert lightness == sorted(lightness)
    assert palette.colour(TUMBLING) != palette.colour(TUMBLING, 1)
