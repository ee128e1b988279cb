"""Components of figures: thinning, wrapped curves, ticks, percents, layers, legend."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

import motions
import synthetic
from pendmap.charts import basins, legend, plane
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
