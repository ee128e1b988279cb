"""Files that contain tables: zip archives, .ods, .mat, projects of Tracker."""

from __future__ import annotations

import contextlib
import zipfile
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

import pendmap
from pendmap.tables import formats
from recorded import clean, found, text

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

TIME, THETA = clean()
DEGREES = np.degrees(THETA)
OFFICE = "urn:oasis:names:tc:opendocument:xmlns"


def zipped(path: Path, parts: dict[str, str | bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in parts.items():
            packed.writestr(name, content)
    return path


def archive(folder: Path) -> Path:
    """Return an archive as a phone exports it: more rows without an angle than with one."""
    head = '"Time (s)","{}"\n'
    parts: dict[str, str | bytes] = {
        "Autocorrelation.csv": head.format("Autocorrelation")
        + text((np.arange(5000), TIME[0] + np.arange(5000) % 7), ""),
        "Pendulum.csv": head.format("Angle (rad)") + text((TIME, THETA), ""),
        "meta/device.csv": '"property","value"\n"version","1.1.9"\n',
    }
    return zipped(folder / "run.zip", parts)


def cell(value: float | str) -> str:
    if isinstance(value, str):
        kind, inner = 'office:value-type="string"', f"<text:p>{value}</text:p>"
        return f"<table:table-cell {kind}>{inner}</table:table-cell>"
    return f'<table:table-cell office:value-type="float" office:value="{value}"/>'


def open_document(folder: Path, last: str = "") -> Path:
    spaces = " ".join(f'xmlns:{name}="{OFFICE}:{name}:1.0"' for name in ("office", "table", "text"))
    lines: list[list[Any]] = [["Time (s)", "Angle (deg)"], *np.c_[TIME, DEGREES].tolist()]
    far = '<table:table-cell table:number-columns-repeated="16382"/>'
    rows = "".join(
        f"<table:table-row>{''.join(map(cell, line))}{far}</table:table-row>" for line in lines
    )
    end = f'<table:table-row table:number-rows-repeated="1048000">{last}{far}</table:table-row>'
    sheet = f'<table:table table:name="1">{rows}{end}</table:table>'
    content = f"<office:document-content {spaces}>{sheet}</office:document-content>"
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    return zipped(folder / "run.ods", {"mimetype": kind, "content.xml": content})


def matlab(folder: Path, **variables: object) -> Path:
    savemat(folder / "run.mat", variables, do_compression=True)
    return folder / "run.mat"


def matlab_hdf5(folder: Path) -> Path:
    path = folder / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["data/time"], file["data/angle_deg"] = TIME[None, :], DEGREES[None, :]
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124)
    path.write_bytes(head + path.read_bytes()[124:])
    return path


def number(name: str, value: float) -> str:
    return f'<property name="{name}" type="double">{value}</property>'


def held(name: str, content: str, kind: str = "x") -> str:
    inner = f'<object class="{kind}">{content}</object>'
    return f'<property name="{name}" type="object">{inner}</property>'


def tracker(folder: Path, turn: float = 20.0) -> Path:
    """Return a project of Tracker whose axes are turned, at 800 px per m, from frame 5 on."""
    angle = THETA + np.radians(turn)
    places = np.c_[320 + 320 * np.sin(angle), 100 + 320 * np.cos(angle)]
    kind = "org.opensourcephysics.cabrillo.tracker."
    marks = "".join(
        held(f"[{k}]", number("x", x) + number("y", y))
        for k, (x, y) in enumerate(places.tolist(), 5)
    )
    origin = {"xorigin": 320, "yorigin": 100, "angle": turn, "xscale": 800, "yscale": 800}
    axes = held("[0]", "".join(number(name, value) for name, value in origin.items()))
    parts = (
        held("videoclip", number("startframe", 5)),
        held("clipcontrol", number("delta_t", 1e3 * (TIME[1] - TIME[0]))),
        held("coords", f'<property name="framedata" type="array">{axes}</property>'),
        '<property name="length_unit" type="string">m</property><property name="tracks">',
        held(
            "item",
            f'<property name="framedata" type="array">{marks}</property>',
            kind + "PointMass",
        ),
    )
    path = folder / "run.trk"
    path.write_text(
        f'<object class="{kind}TrackerPanel">{"".join(parts)}</property></object>', "utf-8"
    )
    return path


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
    monkeypatch.setattr("pendmap.tables.workbooks.MOST_CELLS", 100_000)
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
