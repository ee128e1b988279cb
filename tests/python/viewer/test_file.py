"""Files of recordings: complete or absent, reproducible; bad input is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import rerun as rr
import xarray as xr

import synthetic
from pendmap import InputError, viewer
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("strict_recordings")


@pytest.mark.parametrize(
    ("dataset", "name", "says"),
    [
        (synthetic.painted(), "a.txt", r"suffix must be \.rrd, got '\.txt'"),
        (synthetic.painted().isel(theta=0, drop=True), "a.rrd", "list of starts"),
        (xr.Dataset(), "a.rrd", r"kind None.*basins, .*trajectory"),
    ],
)
def test_bad_input_is_refused(dataset: xr.Dataset, name: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=says):
        viewer.record(dataset, tmp_path / name)
    assert not list(tmp_path.iterdir())


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
