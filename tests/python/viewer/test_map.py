"""Recordings of maps, read back: images, names, positions, legend, layout."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import motions
import synthetic
from pendmap.charts import basins, legend, palette
from pendmap.viewer import chart
from pendmap.viewer.chart import drawings
from recordings import ReadBack, recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

pytestmark = pytest.mark.usefixtures("strict_recordings")


def values(back: ReadBack, entity: str) -> np.ndarray:
    """Return an image of numbers, read from the names of its classes; NaN without a value."""
    names = back.names(entity)
    table = np.full(max(names) + 1, np.nan)
    for number, name in names.items():
        if number and name:
            table[number] = float(name.replace("\N{MINUS SIGN}", "-"))
    return table[
        back.image(entity, "SegmentationImage", np.uint8 if len(names) <= 256 else np.uint16)
    ]


def colours(back: ReadBack, entity: str) -> dict[int, str]:
    """Return the colours of an entity's classes."""
    context = back.columns[entity]["AnnotationContext:context"][0][0]
    infos = (each["class_description"]["info"] for each in context)
    return {info["id"]: f"#{info['color'] >> 8:06x}" for info in infos}


def test_a_map_is_read_back(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], (13, 9), undecided=3, failed=2)
    back = recorded(dataset, tmp_path)
    wanted = {
        "/basin/data/labels",
        "/basin/data/attractors/1",
        "/settle/data/steps",
        "/turns/data/turns",
        "/legend",
        "/summary",
        "/basin/axes/frame",
        "/basin/axes/ticks",
    }
    assert wanted <= set(back.columns)
    assert wanted <= back.static
    label = dataset["label"].values
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    assert (labels == label + 1).all()
    # Cells without a value show the labels below.
    without = back.image("/settle/data/without", "SegmentationImage", np.uint8)
    assert (without == label + 1).all()
    settle, periods = values(back, "/settle/data/steps"), dataset["settle_periods"].values
    assert (np.isnan(settle) == ((periods < 0) | (label < 0))).all()
    settled = ~np.isnan(settle)
    assert (settle[settled] == np.maximum(periods[settled], 1)).all()
    turns = dataset["net_turns"].values.astype(float)
    assert (values(back, "/turns/data/turns") == turns)[label >= 0].all()


def test_every_class_has_its_name_and_colour(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], undecided=3)
    back = recorded(dataset, tmp_path)
    names, shades = (each(back, "/basin/data/labels") for each in (ReadBack.names, colours))
    minus = "\N{MINUS SIGN}"
    wanted = ["undecided", "rest", "rotation 1:+1", f"rotation 1:{minus}1", "oscillation 2:0"]
    of_type = legend.colours_of(dataset)
    for number, name in enumerate(wanted, 1):
        assert names[number].startswith(f"{name}, ")
        assert shades[number] == [palette.UNDECIDED, *of_type][number - 1]
    for number, own in enumerate(of_type, 1):
        path = f"/basin/data/attractors/{number}"
        (((shade,),),) = [back.columns[path]["Points2D:colors"]]
        assert f"#{shade >> 8:06x}" == own
    turns = back.image("/turns/data/turns", "SegmentationImage", np.uint8)
    assert set(np.unique(turns).tolist()) <= set(back.names("/turns/data/turns"))


def test_attractors_are_drawn_at_their_points_and_named(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4])
    back = recorded(dataset, tmp_path)
    owner = dataset["point_attractor"].values
    points = np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)
    for number in dataset["id"].values:
        at = np.array(back.columns[f"/basin/data/attractors/{number}"]["Points2D:positions"][0])
        assert np.allclose(at, points[owner == number], atol=1e-6)
    names = ("rest", "rotation 1:+1", "rotation 1:\N{MINUS SIGN}1", "oscillation 2:0")
    for number, name in enumerate(names, 1):
        label = back.one(f"/basin/data/attractors/{number}", "Points2D:labels")
        assert label.startswith(f"{name}, ")


def test_transforms_bring_the_corners_of_the_map_to_the_frame(tmp_path: Path) -> None:
    dataset = synthetic.painted(shape=(20, 10), theta=(-1.0, 3.0), velocity=(-2.0, 4.0))
    back = recorded(dataset, tmp_path)
    corners = np.array([[0.0, 0.0, 0.0], [10.0, 20.0, 0.0]])
    for entity in ("/basin/data/labels", "/basin/data"):
        matrix = np.reshape(back.one(entity, "Transform3D:mat3x3"), (3, 3)).T
        corners = corners @ matrix.T + back.one(entity, "Transform3D:translation")
        if entity == "/basin/data/labels":
            assert np.allclose(corners[:, :2], [[-1.0, -2.0], [3.0, 4.0]], atol=1e-5)
    frame = np.array(back.one("/basin/axes/frame", "LineStrips2D:strips")[0])
    low, high = frame.min(axis=0), frame.max(axis=0)
    assert np.allclose(corners[0, :2], [low[0], high[1]], atol=1e-3), (
        "lowest velocity at the bottom"
    )
    assert np.allclose(corners[1, :2], [high[0], low[1]], atol=1e-3)


def test_legend_and_summary(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], (30, 40), undecided=12, **synthetic.UNRELIABLE)
    back = recorded(dataset, tmp_path)
    assert back.one("/__properties/pendmap", "p") == 1.0
    assert back.one("/__properties/pendmap", "simd") == "avx2"
    text = back.one("/legend", "TextDocument:text")
    line = next(line for line in text.splitlines() if line.startswith("- rotation 1:+1"))
    assert line.endswith("twin of rotation 1:\N{MINUS SIGN}1: vermillion")
    assert "- undecided, 1 %: light grey" in text
    assert "labels unreliable: 20.7 % change under half the step or mirroring" in text
    summary = back.one("/summary", "TextDocument:text")
    assert summary.split("\n\n") == dataset.attrs["summary"].splitlines()


def test_every_view_has_an_origin_and_a_name(tmp_path: Path) -> None:
    assert recorded(synthetic.painted(), tmp_path).views == {
        "/basin": "Basins of attraction",
        "/settle": "Settle time",
        "/turns": "Net turns until settled",
        "/legend": "Legend",
        "/summary": "Summary",
    }
    unreliable = synthetic.painted(**synthetic.UNRELIABLE)
    assert recorded(unreliable, tmp_path).views["/basin"] == "Basins of attraction (unreliable)"
    assert tabs_of(unreliable) == ["settle", "turns", "basin"]


def tabs_of(dataset: xr.Dataset) -> list[str]:
    """Return the paths of the tabs of the layout, the active one first."""
    (drawing,) = drawings(basins.chart(dataset))
    return [place.root for place in drawing.places]


def test_a_single_chaotic_attractor_is_recorded(tmp_path: Path) -> None:
    dataset = motions.chaotic(cells=20, periods=4)
    back = recorded(dataset, tmp_path)
    assert "/basin/data/labels" not in back.columns
    assert "/settle/data/steps" not in back.columns
    shown = values(back, "/exponent/data/exponent")
    exponent = dataset["finite_time_exponent"].values
    np.testing.assert_allclose(shown, exponent, rtol=5.1e-4)
    assert (values(back, "/turns/data/turns") == dataset["net_turns"].values).all()
    at = back.columns["/basin/data/attractors/1"]["Points2D:positions"][0]
    assert len(at) == dataset.sizes["point"]
    assert tabs_of(dataset) == ["turns", "exponent", "basin"]


def test_a_map_without_damping_is_recorded(tmp_path: Path) -> None:
    dataset = motions.chaotic(gamma=0.0, p=0.6, omega=2.0, cells=20, periods=4)
    back = recorded(dataset, tmp_path)
    assert "No attractors" in back.one("/legend", "TextDocument:text")
    assert not [entity for entity in back.columns if "attractors" in entity]


@pytest.mark.parametrize(
    "dataset",
    [
        synthetic.painted((), (4, 3)),
        synthetic.painted(synthetic.USUAL, (3, 2)),
        synthetic.painted(synthetic.USUAL[10:12]),
        synthetic.painted(theta=(-4 * math.pi, 4 * math.pi), velocity=(5.0, 6.0)),
    ],
    ids=["none", "twelve in six cells", "two chaotic", "attractors outside"],
)
def test_unusual_maps_are_recorded(tmp_path: Path, dataset: xr.Dataset) -> None:
    back = recorded(dataset, tmp_path)
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    assert (labels == dataset["label"].values + 1).all()


def test_a_failed_exponent_is_covered(tmp_path: Path) -> None:
    dataset = motions.chaotic(cells=12, periods=2)
    dataset["finite_time_exponent"][3, 4] = np.nan
    dataset["label"][3, 4] = -1
    back = recorded(dataset, tmp_path)
    cover = back.image("/exponent/data/without", "SegmentationImage", np.uint8)
    assert cover[3, 4] == 0
    assert colours(back, "/exponent/data/without")[0] == palette.FAILED
    assert np.argwhere(np.isnan(values(back, "/exponent/data/exponent"))).tolist() == [[3, 4]]


def test_a_map_beyond_the_largest_image_is_thinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chart, "CELLS", 16)
    dataset = synthetic.painted(synthetic.USUAL[:3], (32, 40), undecided=5)
    back = recorded(dataset, tmp_path)
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    rows, columns = ((np.arange(16) + 0.5) * (n / 16) for n in (32, 40))
    assert (
        labels == dataset["label"].values[np.ix_(rows.astype(int), columns.astype(int))] + 1
    ).all()
