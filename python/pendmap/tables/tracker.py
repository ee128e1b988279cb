"""Reading of the project files of Tracker (``.trk``): the places of a point mass on a video."""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree as ET

from pendmap.errors import InputError
from pendmap.formatting import listed
from pendmap.tables.findings import finding_of
from pendmap.tables.table import readable

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from pendmap.tables.findings import Finding

TRACKER: Final = b"org.opensourcephysics.cabrillo.tracker.TrackerPanel"
_MASS: Final = "org.opensourcephysics.cabrillo.tracker.PointMass"
_NAMED: Final = ".//property[@name='{}']"


def tracker_frame(data: bytes, where: str) -> tuple[pd.DataFrame, tuple[Finding, ...]]:
    """Return time, x and y (up) of the point mass with the most marks, in the frame of the axes.

    Frame n is at ``t = start + (n - first) dt``. A mark (x, y) in px is at distance ``d = ((x - x0)
    / sx, (y0 - y) / sy)`` from the origin, turned back by the angle of the axes.
    """
    import pandas as pd

    with readable(where, "project of Tracker"):
        project = ET.fromstring(data)  # noqa: S314 (expat limits the growth of entities)
        interval = 1e-3 * float(_text(project, "delta_t", "nan"))
        start = 1e-3 * float(_text(project, "starttime", "0"))
        first = int(_text(project, "startframe", "0"))
        axes = _frames(project, f"{_NAMED.format('coords')}/object")
        masses = project.iterfind(f".//object[@class='{_MASS}']")
        marks = {_text(mass, "name", "?"): _frames(mass, ".") for mass in masses}
    name = max(marks, key=lambda mass: len(marks[mass]), default="")
    if not marks or not marks[name] or not axes or not interval > 0:
        raise InputError(
            f"{where}: must have a point mass with marks, axes and a frame rate: export the table"
            " of the point mass from Tracker as text"
        )
    unit, rows = _text(project, "length_unit", "px"), []
    for frame, mark in sorted(marks[name].items()):
        system = axes[max((k for k in axes if k <= frame), default=min(axes))]
        x = (mark["x"] - system.get("xorigin", 0.0)) / system.get("xscale", 1.0)
        y = (system.get("yorigin", 0.0) - mark["y"]) / system.get("yscale", 1.0)
        place = complex(x, y) * cmath.exp(-1j * math.radians(system.get("angle", 0.0)))
        rows.append((start + (frame - first) * interval, place.real, place.imag))
    others = listed([repr(other) for other in marks if other != name and marks[other]], 3)
    chosen = (finding_of("member-chosen", name=name, others=others),) if others else ()
    return pd.DataFrame(rows, columns=["t [s]", f"x [{unit}]", f"y [{unit}]"]), chosen


def _text(element: ET.Element, name: str, otherwise: str) -> str:
    """Return the text of the first property of a name."""
    return (element.findtext(_NAMED.format(name)) or "").strip() or otherwise


def _frames(element: ET.Element, holder: str) -> Mapping[int, Mapping[str, float]]:
    """Return the numbers of each frame of the ``framedata`` of an object."""
    return {
        int(frame.get("name", "").strip("[]")): {
            str(entry.get("name")): float(entry.text or "nan")
            for entry in frame.iterfind("object/property")
            if entry.get("type") in {"double", "int", "float"}
        }
        for frame in element.iterfind(f"{holder}/property[@name='framedata']/property")
    }
