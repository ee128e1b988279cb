"""Recordings of maps, read back: images, names, positions, legend, layout."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import motions
import synthetic
from pendmap.charts import palette
from pendmap.viewer import basins
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

pytestmark = pytest.mark.usefixtures("strict_recordings")


def test_a_map_is_read_back(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], (13, 9), undecided=3, failed=2)
    back = recorded(dataset, tmp_path)
    wanted = {
        "/basin/data/labels",
        "/basin/data/attractors",
        "/settle/data/steps",
        "/turns/data/turns",
        "/legend",
        "/summary",
        "/basin/axes/frame",
        "/basin/axes/ticks",
    }
    assert wanted <= set(back.columns)
    assert wanted <= back.static
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    assert (labels == dataset["label"].values + 1).all()
    settle = back.image("/settle/data/steps", "DepthImage", np.uint16)
    assert (settle == np.maximum(dataset["settle_periods"].values, 0)).all()
    without = back.image("/settle/data/without", "SegmentationImage", np.uint16)
    assert ((without > 0) == (dataset["settle_periods"].values < 0)).all()
    classes = back.image("/turns/data/turns", "SegmentationImage", np.uint16).astype(int)
    kept = dataset["label"].values >= 0
    none = int(back.one("/turns/data/turns", "class_of_no_turn"))
    assert (classes - none == dataset["net_turns"].values)[kept].all()
    assert (classes[~kept] == 0).all()


def test_every_class_has_its_name_and_colour(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], undecided=3)
    back = recorded(dataset, tmp_path)
    assert back.names("/basin") == {
        0: "failed",
        1: "undecided",
        2: "rest",
        3: "rotation 1:+1",
        4: "rotation 1:\N{MINUS SIGN}1",
        5: "oscillation 2:0",
    }
    colours = {
        e["class_id"]: e["class_description"]["info"]["color"]
        for e in back.columns["/basin"]["AnnotationContext:context"][0][0]
    }
    red, green, blue = palette.rgb("rotation 1:+1")
    assert colours[3] == (red << 24) + (green << 16) + (blue << 8) + 255
    turns = back.names("/turns")
    none = int(back.one("/turns/data/turns", "class_of_no_turn"))
    assert turns[none + 3] == "+3 turns"
    assert turns[none - 3] == "\N{MINUS SIGN}3 turns"
    for label in np.unique(back.image("/turns/data/turns", "SegmentationImage", np.uint16)):
        assert int(label) in turns


def test_attractors_are_drawn_at_their_points_and_named(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4])
    back = recorded(dataset, tmp_path)
    at = np.array(back.one("/basin/data/attractors", "Points2D:positions"))
    expected = np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)
    assert np.allclose(at, expected, atol=1e-6)
    labels = back.one("/basin/data/attractors/names", "Points2D:labels")
    assert labels == ["rest", "rotation 1:+1", "rotation 1:\N{MINUS SIGN}1", "oscillation 2:0"]


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
    text = back.one("/legend", "TextDocument:text")
    share = 100 * float(dataset["fraction"].values[1])
    assert f"| rotation 1:+1 | {share:.1f} \N{PLUS-MINUS SIGN} " in text
    assert "| vermillion | rotation 1:\N{MINUS SIGN}1 |" in text
    assert "| undecided | 1 % | light grey |" in text
    assert "labels unreliable: 20.7 % change under half the step or mirroring" in text
    summary = back.one("/summary", "TextDocument:text")
    assert summary.split("\n\n") == dataset.attrs["summary"].splitlines()


def test_parameters_are_properties(tmp_path: Path) -> None:
    back = recorded(synthetic.painted(p=1.7, gamma=0), tmp_path)
    assert back.one("/__properties/pendmap", "p") == 1.7
    assert back.one("/__properties/pendmap", "gamma") == 0
    assert back.one("/__properties/pendmap", "simd") == "avx2"


def test_every_view_has_an_origin_and_a_name(tmp_path: Path) -> None:
    assert recorded(synthetic.painted(), tmp_path).views == {
        "/basin": "Basins of attraction",
        "/settle": "Settle time (periods)",
        "/turns": "Net turns until settled",
        "/legend": "Legend",
        "/summary": "Summary",
    }
    unreliable = synthetic.painted(**synthetic.UNRELIABLE)
    assert recorded(unreliable, tmp_path).views["/basin"] == "Labels (unreliable)"
    contents = [str(part.origin) for part in tabs_of(unreliable)]
    assert contents == ["/settle", "/turns", "/basin"]


def tabs_of(dataset: xr.Dataset) -> list[Any]:
    """Return the tabs of the layout, the active one first."""
    screen: Any = basins.blueprint(dataset)
    return list(screen.root_container.contents[0].contents)


def test_a_single_chaotic_attractor_is_recorded(tmp_path: Path) -> None:
    dataset = motions.chaotic(cells=20, periods=4)
    back = recorded(dataset, tmp_path)
    assert "/basin/data/labels" not in back.columns
    assert "/settle/data/steps" not in back.columns
    exponent = back.image("/exponent/data/exponent", "DepthImage", np.float32)
    assert (exponent == dataset["finite_time_exponent"].values).all()
    classes = back.image("/turns/data/turns", "SegmentationImage", np.uint16).astype(int)
    none = int(back.one("/turns/data/turns", "class_of_no_turn"))
    assert (classes - none == dataset["net_turns"].values).all()
    assert len(back.one("/basin/data/attractors", "Points2D:positions")) == dataset.sizes["point"]
    assert [str(part.origin) for part in tabs_of(dataset)] == ["/turns", "/exponent", "/basin"]


def test_a_map_without_damping_is_recorded(tmp_path: Path) -> None:
    dataset = motions.chaotic(gamma=0.0, p=0.6, omega=2.0, cells=20, periods=4)
    back = recorded(dataset, tmp_path)
    assert "No attractors." in back.one("/legend", "TextDocument:text")
    assert not [entity for entity in back.columns if "attractors" in entity]


@pytest.mark.parametrize(
    "dataset",
    [
        synthetic.painted((), (4, 3)),
        synthetic.painted(synthetic.USUAL[:1], (1, 1)),
        synthetic.painted(synthetic.USUAL, (3, 2)),
        synthetic.painted(synthetic.USUAL[10:12]),
        synthetic.painted(theta=(-4 * math.pi, 4 * math.pi), velocity=(5.0, 6.0)),
    ],
    ids=["none", "one cell", "twelve in six cells", "two chaotic", "attractors outside"],
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
    cover = back.image("/exponent/data/without", "SegmentationImage", np.uint16)
    assert cover[3, 4] == 1
    assert np.count_nonzero(cover) == 1


def test_a_map_beyond_the_largest_image_is_thinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(basins, "CELLS", 16)
    dataset = synthetic.painted(synthetic.USUAL[:3], (32, 40), undecided=5)
    back = recorded(dataset, tmp_path)
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    rows, columns = ((np.arange(16) + 0.5) * (n / 16) for n in (32, 40))
    assert (
        labels == dataset["label"].values[np.ix_(rows.astype(int), columns.astype(int))] + 1
    ).all()
