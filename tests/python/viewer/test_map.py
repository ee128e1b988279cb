"""Recordings of maps, read back: images, names, positions, legend, layout, the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import rerun as rr

import motions
import synthetic
from pendmap import viewer
from pendmap.charts import legend, palette, plane
from recordings import ReadBack, recorded

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("strict_recordings")

MINUS = "\N{MINUS SIGN}"


def values(back: ReadBack, entity: str) -> np.ndarray:
    """Return an image of numbers, read from the names of its classes; NaN without a value."""
    names = back.names(entity)
    table = np.full(max(names) + 1, np.nan)
    for number, name in names.items():
        if number and name:
            table[number] = float(name.replace(MINUS, "-"))
    return table[
        back.image(entity, "SegmentationImage", np.uint8 if len(names) <= 256 else np.uint16)
    ]


def colours(back: ReadBack, entity: str) -> dict[int, str]:
    context = back.columns[entity]["AnnotationContext:context"][0][0]
    infos = (one["class_description"]["info"] for one in context)
    return {info["id"]: f"#{info['color'] >> 8:06x}" for info in infos}


def test_a_map_is_read_back(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], (13, 9), undecided=3, failed=2)
    back = recorded(dataset, tmp_path)
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
    names, shades = back.names("/basin/data/labels"), colours(back, "/basin/data/labels")
    of_type = legend.colours_of(dataset)
    wanted = ["undecided", "rest", "rotation 1:+1", f"rotation 1:{MINUS}1", "oscillation 2:0"]
    for number, name in enumerate(wanted, 1):
        assert names[number].startswith(f"{name}, ")
        assert shades[number] == [palette.UNDECIDED, *of_type][number - 1]
    owner, points = dataset["point_attractor"].values, plane.points(dataset)
    for number, mine in enumerate(of_type, 1):
        spots = back.columns[f"/basin/data/attractors/{number}"]
        at = np.array(spots["Points2D:positions"][0])
        assert np.allclose(at, points[owner == number], atol=1e-6)
        assert f"#{spots['Points2D:colors'][0][0] >> 8:06x}" == mine


def test_legend_summary_and_views(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], (30, 40), undecided=12, **synthetic.UNRELIABLE)
    back = recorded(dataset, tmp_path)
    assert back.one("/__properties/pendmap", "p") == 1.0
    text = back.one("/legend", "TextDocument:text")
    line = next(line for line in text.splitlines() if line.startswith("- rotation 1:+1"))
    assert line.endswith(f"twin of rotation 1:{MINUS}1: vermillion")
    assert "- undecided, 1 %: light grey" in text
    assert "labels unreliable: 20.7 % change under half the step or mirroring" in text
    summary = back.one("/summary", "TextDocument:text")
    assert summary.split("\n\n") == dataset.attrs["summary"].splitlines()
    assert back.views == {
        "/basin": "Basins of attraction (unreliable)",
        "/settle": "Settle time",
        "/turns": "Net turns until settled",
        "/legend": "Legend",
        "/summary": "Summary",
    }


def test_a_single_chaotic_attractor_is_recorded(tmp_path: Path) -> None:
    dataset = motions.chaotic(cells=20, periods=4)
    dataset["finite_time_exponent"][3, 4] = np.nan
    dataset["label"][3, 4] = -1
    back = recorded(dataset, tmp_path)
    assert "/settle/data/steps" not in back.columns
    shown, exponent = values(back, "/exponent/data/exponent"), dataset["finite_time_exponent"]
    np.testing.assert_allclose(shown, exponent, rtol=5.1e-4)
    cover = back.image("/exponent/data/without", "SegmentationImage", np.uint8)
    assert colours(back, "/exponent/data/without")[cover[3, 4]] == palette.FAILED
    at = back.columns["/basin/data/attractors/1"]["Points2D:positions"][0]
    assert len(at) == dataset.sizes["point"]


def test_recordings_of_one_map_are_equal(tmp_path: Path) -> None:
    other = synthetic.painted()
    other["label"][4, 5] = 0
    ids = [
        recorded(dataset, tmp_path).recordings[0].recording_id
        for dataset in (synthetic.painted(), synthetic.painted(seconds=9.0), other)
    ]
    assert ids[0] == ids[1] != ids[2]


def test_errors_are_raised_although_the_library_would_only_warn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rr.set_strict_mode(False)
    monkeypatch.setattr(rr, "SegmentationImage", lambda *_, **__: rr.Points2D("none"))
    with pytest.raises(ValueError, match="none"):
        viewer.record(synthetic.painted(), tmp_path / "a.rrd")
    assert not rr.strict_mode()
    assert not list(tmp_path.iterdir())
