"""Components of figures: colours, thinning, wrapped curves, ticks, layers, shares."""

from __future__ import annotations

import itertools
import math
from typing import Literal

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pytest
import xarray as xr

from pendmap._core import Attractor
from pendmap.charts import legend, palette, plane
from pendmap.charts.chart import Axis


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


@pytest.mark.parametrize(
    ("scale", "low", "high", "most", "labels"),
    [
        ("angle", -math.pi, math.pi, 8, "-π -π/2 0 π/2 π"),
        ("angle", -math.pi / 2, math.pi / 2, 8, "-π/2 -π/4 0 π/4 π/2"),
        ("angle", -4 * math.pi, 4 * math.pi, 8, "-4π -2π 0 2π 4π"),
        ("angle", 0.1, 0.2, 8, "0.1 0.12 0.14 0.16 0.18 0.2"),
        ("log", 1.0, 135.0, 8, "1 2 5 10 20 50 100"),
        ("log", 1.0, 135.0, 5, "1 3 10 30 100"),
        ("log", 5.0, 9.0, 8, "5 6 7 8 9"),
        ("log", 1e-8, 1e3, 4, "$10^{-8}$ $10^{-5}$ 0.01 10"),
    ],
)
def test_ticks_depend_on_the_window_and_have_room(
    scale: Literal["angle", "log"], low: float, high: float, most: int, labels: str
) -> None:
    _, ticks = plane.ticks(Axis("n", scale=scale), low, high, most)
    wanted = labels.replace("-", "\N{MINUS SIGN}") if scale == "angle" else labels
    assert " ".join(label for _, label in ticks) == wanted


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


def matrix(*rows: str) -> npt.NDArray[np.float64]:
    return np.array([row.split() for row in rows], dtype=float)


# Machado, Oliveira and Fernandes (2009): protanopia, deuteranopia, tritanopia, on linear RGB.
DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": matrix(
        "0.152286 1.052583 -0.204868", "0.114503 0.786281 0.099216", "-0.003882 -0.048116 1.051998"
    ),
    "deuteranopia": matrix(
        "0.367322 0.860646 -0.227968", "0.280085 0.672501 0.047413", "-0.011820 0.042940 0.968881"
    ),
    "tritanopia": matrix(
        "1.255528 -0.076749 -0.178779", "-0.078411 0.930809 0.147602", "0.004733 0.691367 0.303900"
    ),
}
TO_CONES = matrix(
    "0.4122214708 0.5363325363 0.0514459929",
    "0.2119034982 0.6806995451 0.1073969566",
    "0.0883024619 0.2817188376 0.6299787005",
)
TO_LAB = matrix(
    "0.2104542553 0.7936177850 -0.0040720468",
    "1.9779984951 -2.4285922050 0.4505937099",
    "0.0259040371 0.7827717662 -0.8086757660",
)
REST, TUMBLING = Attractor("rest", 1), Attractor("tumbling_chaos")
FORWARD, BACKWARD = Attractor("rotation", 1, 1), Attractor("rotation", 1, -1)
DOUBLED = Attractor("oscillation", 2)
COEXISTING = (
    (REST, FORWARD, BACKWARD, DOUBLED, "undecided", "failed"),
    (DOUBLED, FORWARD, BACKWARD, Attractor("rotation", 2, 2), Attractor("rotation", 2, -2)),
    (REST, Attractor("inverted_rest", 1), FORWARD, BACKWARD, TUMBLING, "undecided"),
    (*(Attractor("rotating_chaos", w=w) for w in (1, -1)), TUMBLING, DOUBLED, "failed"),
    (*(Attractor("oscillation", 4, lean=side) for side in (1, -1)), FORWARD, BACKWARD, "undecided"),
    (REST, *(Attractor("oscillation", n) for n in (1, 2, 3)), TUMBLING),
)


def perceived(one: Attractor | str, deficiency: str) -> npt.NDArray[np.float64]:
    """Return the perceived colour in Ottosson's OKLab, times 100."""
    cells = {"undecided": palette.UNDECIDED, "failed": palette.FAILED}
    code = cells[one] if isinstance(one, str) else palette.colour(one)
    channel = np.array(palette.parts(code)) / 255
    linear = np.where(channel <= 0.04045, channel / 12.92, ((channel + 0.055) / 1.055) ** 2.4)
    seen = np.clip(DEFICIENCIES[deficiency] @ linear, 0, 1)
    lab: npt.NDArray[np.float64] = 100 * TO_LAB @ np.cbrt(TO_CONES @ seen)
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
