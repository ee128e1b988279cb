"""Reading of the project files of Tracker (``.trk``): the places of a point mass on a video."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree as ET

from pendmap.errors import InputError
from pendmap.formatting import listed
from pendmap.tables.findings import finding_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from pendmap.tables.findings import Finding

TRACKER: Final = b"org.opensourcephysics.cabrillo.tracker.TrackerPanel"
_MASS: Final = "org.opensourcephysics.cabrillo.tracker.PointMass"


def tracker_frame(data: bytes, where: str) -> tuple[pd.DataFrame, tuple[Finding, ...]]:
    """Return time, x and y (up) of the point mass with the most marks, in the frame of the axes.

    Frame n is at ``t = start + (n - first) dt``. A mark (x, y) in px is at distance ``d = ((x - x0)
    / sx, (y0 - y) / sy)`` from the origin, turned back by the angle of the axes.
    """
    import pandas as pd

    try:
        project = ET.fromstring(data)  # noqa: S314 (expat limits the growth of entities)
        clip, control = _part(project, "videoclip"), _part(project, "clipcontrol")
        interval = 1e-3 * float(_text(control, "delta_t", "nan"))
        start = 1e-3 * float(_text(clip, "starttime", "0"))
        first = int(_text(clip, "startframe", "0"))
        axes = _frames(_part(project, "coords"))
        tracks = _part(project, "tracks")
        masses = [] if tracks is None else tracks.iterfind(f"property/object[@class='{_MASS}']")
        marks = {_text(mass, "name", "?"): _frames(mass) for mass in masses}
    except (ET.ParseError, ValueError) as error:
        raise InputError(f"{where}: is no project of Tracker that can be read: {error}") from None
    marks = {name: frames for name, frames in marks.items() if frames}
    if not marks or not axes or not interval > 0:
        raise InputError(
            f"{where}: must have a point mass with marks, axes and a frame rate: export the table"
            " of the point mass from Tracker as text"
        )
    name = max(marks, key=lambda mass: len(marks[mass]))
    unit = _text(project, "length_unit", "px")
    rows = []
    for frame, mark in sorted(marks[name].items()):
        system = axes[max((k for k in axes if k <= frame), default=min(axes))]
        scale = system.get("xscale", 1.0), system.get("yscale", 1.0)
        x = (mark["x"] - system.get("xorigin", 0.0)) / scale[0]
        y = (system.get("yorigin", 0.0) - mark["y"]) / scale[1]
        turn = math.radians(system.get("angle", 0.0))
        along = x * math.cos(turn) + y * math.sin(turn)
        rows.append(
            (start + (frame - first) * interval, along, y * math.cos(turn) - x * math.sin(turn))
        )
    others = listed([repr(other) for other in marks if other != name], 3)
    chosen = (finding_of("member-chosen", name=name, others=others),) if others else ()
    return pd.DataFrame(rows, columns=["t [s]", f"x [{unit}]", f"y [{unit}]"]), chosen


def _part(element: ET.Element | None, name: str) -> ET.Element | None:
    """Return the object or collection that a property holds."""
    held = None if element is None else element.find(f"property[@name='{name}']")
    return held if held is None or held.find("object") is None else held.find("object")


def _text(element: ET.Element | None, name: str, otherwise: str) -> str:
    """Return the text of a property."""
    text = None if element is None else element.findtext(f"property[@name='{name}']")
    return text.strip() if text and text.strip() else otherwise


def _frames(element: ET.Element | None) -> Mapping[int, Mapping[str, float]]:
    """Return the numbers of each frame of ``framedata``."""
    held = None if element is None else element.find("property[@name='framedata']")
    return {
        int(frame.get("name", "").strip("[]")): {
            str(entry.get("name")): float(entry.text or "nan")
            for entry in frame.iterfind("object/property")
            if entry.get("type") in {"double", "int", "float"}
        }
        for frame in ([] if held is None else held.iterfind("property"))
    }
