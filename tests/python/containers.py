"""Writers of files that contain a table: zip archives, .ods, .mat, projects of Tracker."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import openpyxl
from scipy.io import savemat

from recorded import clean, text

if TYPE_CHECKING:
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


def workbook(folder: Path) -> Path:
    book = openpyxl.Workbook()
    for row in [["Time (s)", "Angle (deg)"], *np.c_[TIME, DEGREES].tolist()]:
        book.active.append(row)
    book.save(folder / "run.xlsx")
    return folder / "run.xlsx"


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
