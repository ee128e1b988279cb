"""Recordings of maps, read back: images, names, positions, legend, layout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import motions
import synthetic
from pendmap.charts import basins, legend, palette, plane
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
    owner, points = dataset["point_attractor"].values, plane.points(dataset)
    for number in dataset["id"].values:
        at = np.array(back.columns[f"/basin/data/attractors/{number}"]["Points2D:positions"][0])
        assert np.allclose(at, points[owner == number], atol=1e-6)
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


def test_a_failed_exponent_is_covered(tmp_path: Path) -> None:
    dataset = motions.chaotic(cells=12, periods=2)
    dataset["finite_time_exponent"][3, 4] = np.nan
    dataset["label"][3, 4] = -1
    back = recorded(dataset, tmp_path)
    cover = back.image("/exponent/data/without", "SegmentationImage", np.uint8)
    assert cover[3, 4] == 0
    assert colours(back, "/exponent/data/without")[0] == palette.FAILED
    assert np.argwhere(np.isnan(values(back, "/exponent/data/exponent"))).tolist() == [[3, 4]]
