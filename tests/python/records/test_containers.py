"""Files that contain tables: zip archives, .ods, .mat, projects of Tracker."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from containers import (
    DEGREES,
    THETA,
    TIME,
    archive,
    cell,
    matlab,
    matlab_hdf5,
    open_document,
    tracker,
    zipped,
)
from pendmap.tables import formats
from recorded import found

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@pytest.mark.parametrize(
    "write",
    [
        archive,
        open_document,
        tracker,
        lambda folder: matlab(folder, t=TIME[:, None], theta=THETA[:, None], rate=25.0),
        lambda folder: matlab(folder, data={"time": TIME, "angle_deg": DEGREES, "who": "me"}),
        lambda folder: matlab(folder, M=np.c_[TIME, THETA]),
        matlab_hdf5,
    ],
)
def test_a_table_in_another_file_is_read(tmp_path: Path, write: Callable[[Path], Path]) -> None:
    (run,) = pendmap.read_experiment(write(tmp_path)).runs
    np.testing.assert_allclose(run.time - run.time[0], TIME - TIME[0], atol=1e-6)
    np.testing.assert_allclose(run.theta, THETA, atol=1e-5)
    if write is archive:
        assert "'Autocorrelation.csv'" in found(run)["member-chosen"].text


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (lambda folder: open_document(folder, last=cell(1.0)), "at most 100000 cells"),
        (lambda folder: zipped(folder / "run.zip", {"a.csv": "t,theta\n", "b.png": b"1"}), "a.csv"),
        (
            lambda folder: zipped(folder / "run.zip", {f"{k}.csv": "1" for k in range(201)}),
            "200 files",
        ),
        (lambda folder: zipped(folder / "run.zip", {"a.csv": "0" * 2_000_000}), "unpacks to 2 MiB"),
        (lambda folder: matlab(folder, t=np.zeros(400_000)), "unpacks to more than 1 MiB"),
        (lambda folder: matlab(folder, name="none"), "vectors of 5 numbers"),
    ],
)
def test_what_has_no_table_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Callable[[Path], Path], says: str
) -> None:
    monkeypatch.setattr("pendmap.tables.programs.MOST_CELLS", 100_000)
    monkeypatch.setattr(formats, "MOST_BYTES", 1_000_000)
    monkeypatch.setattr("pendmap.tables.table.MOST_BYTES", 1_000_000)
    with pytest.raises(pendmap.InputError, match=says):
        pendmap.read_experiment(write(tmp_path))


@pytest.mark.parametrize("write", [archive, open_document, tracker, matlab_hdf5])
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, write: Callable[[Path], Path]) -> None:
    path = write(tmp_path)
    data = path.read_bytes()
    rng = np.random.default_rng(3)
    for _ in range(6):
        bad = bytearray(data[: rng.integers(200, len(data))] if rng.random() < 0.5 else data)
        for place in rng.integers(0, len(bad), 20):
            bad[place] = rng.integers(256)
        path.write_bytes(bad)
        with contextlib.suppress(pendmap.InputError):
            pendmap.read_experiment(path)
