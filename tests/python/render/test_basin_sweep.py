"""Figures and recordings of sweeps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap import InputError, Pendulum, render
from pendmap.charts import basin_sweep
from pendmap.charts.marks import Band, Image
from pendmap.charts.registry import ready
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

LINE = pendmap.sweep(Pendulum(gamma=0.1, omega=2.0), {"p": (0.4, 1.6, 9)}, grid=10)
PLANE = pendmap.sweep(
    Pendulum(gamma=0.1), {"p": (0.4, 0.8, 3), "omega": (1.8, 2.2, 4)}, grid=10, check=False
)


def widths(dataset: xr.Dataset) -> dict[str, np.ndarray]:
    """Return the height of each band of shares at each value, by its name."""
    chart = basin_sweep.chart(ready(dataset), layer="fraction")
    bands = [mark for mark in chart.panels[0].marks if isinstance(mark, Band)]
    return {mark.name: (mark.high - mark.low)[::2] for mark in bands}


def test_shares_are_stacked_to_one() -> None:
    bands = widths(LINE)
    np.testing.assert_allclose(sum(bands.values()), 1.0)
    for k, name in enumerate(LINE.attractor.values):
        told = str(name).replace("-", "−")
        if told in bands:
            np.testing.assert_allclose(bands[told], LINE.fraction.values[:, k], atol=1e-12)


def test_attractors_of_equal_names_have_different_colours() -> None:
    found = LINE.copy()
    names = np.array([f"oscillation 6:0 from p = {k}" for k in range(found.sizes["attractor"])])
    colours = [one.colour for one in basin_sweep.listed(found.assign_coords(attractor=names), None)]
    assert len(set(colours)) == len(colours)


@pytest.mark.parametrize("layer", [*basin_sweep.LAYERS, "share 1"])
def test_layers_over_two_parameters(layer: str) -> None:
    chart = basin_sweep.chart(ready(PLANE), layer=layer)
    (image,) = (mark for mark in chart.panels[0].marks if isinstance(mark, Image))
    assert image.values.shape == (4, 3)
    assert [side.name for side in (chart.panels[0].x, chart.panels[0].y)] == ["p", "ω"]
    name = basin_sweep.LAYERS.get(layer, ("fraction", "", ""))[0]
    if name in ("basin_entropy", "attractors", "undecided"):
        np.testing.assert_allclose(image.values, PLANE[name].values.T)
    if layer == "share 1":
        np.testing.assert_allclose(image.values, PLANE.fraction.values[..., 0].T)


def test_an_unknown_layer_is_refused() -> None:
    with pytest.raises(InputError, match="no layer 'hue' in this figure; it has entropy"):
        basin_sweep.chart(ready(PLANE), layer="hue")
    with pytest.raises(InputError, match="no layer 'hue' in this figure; it has fraction"):
        basin_sweep.chart(ready(LINE), layer="hue")
    with pytest.raises(InputError, match="omega must be a range here"):
        ready(PLANE.isel(omega=0))


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
    render.draw(LINE.isel(p=3), tmp_path / "one.png")


@pytest.mark.usefixtures("strict_recordings")
@pytest.mark.parametrize("dataset", [LINE, PLANE], ids=["line", "plane"])
def test_a_recording_has_the_labels_of_each_model_on_its_timeline(
    dataset: xr.Dataset, tmp_path: Path
) -> None:
    back = recorded(dataset, tmp_path)
    images = back.columns["/basin/data/labels"]["SegmentationImage:buffer"]
    assert {f"/{panel.where}" for panel in basin_sweep.chart(ready(dataset)).recorded} <= set(
        back.views
    )
    label = dataset.label.values.reshape(-1, *dataset.label.shape[-2:])
    assert len([one for one in images if one is not None]) == len(label)
    read = np.array([np.asarray(one[0], np.uint8) for one in images if one is not None])
    np.testing.assert_array_equal(read.reshape(label.shape), label + 1)
    named = back.names("/basin/data/labels")
    assert len(named) == 2 + dataset.sizes["attractor"]
    if dataset is LINE:
        column = back.columns["/basin/data/labels"]["p"]
        assert len({str(time) for time in column}) == dataset.sizes["p"]
        assert "/fraction/data/now" in back.columns
    else:
        assert "map" in back.columns["/basin/data/labels"]
