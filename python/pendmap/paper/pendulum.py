"""Chart of the pendulum with its moving pivot (figure 3)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import Areas, Ends, Line, Mark, Text
from pendmap.formatting import typographic

if TYPE_CHECKING:
    from pendmap.charts.marks import Floats

    Point = tuple[float, float]

TITLE: Final = "The parametric pendulum"
SIZE: Final = (6.0, 5.6)  # Width and height, inches
HEAD: Final = 0.95  # Height of title, subtitle and margins, inches
THETA: Final = math.radians(38.0)  # Angle of the pendulum
LENGTH: Final = 3.0
BOB: Final = 0.3
ASIDE: Final = 0.5
"""Lengths in units of the drawing, one inch each: rod, radius of the bob, distance of annotations
from the rod."""

_DRIVE: Final = "cos(Ωt + φ)"
_STEEL, _DARK, _RAIL, _HELP = "#3d4f66", "#1d3557", "#b8c2cf", "#8a8a8a"
_FORCE, _MOTION = "#d55e00", "#0072b2"
_WHITE: Final = "#ffffff"
_DASHED: Final = (6.0, 3.0)
_RIGHT, _LEFT = ("right", "center"), ("left", "center")


def chart(size: Ends | None = None, title: str | None = None) -> Chart:
    """Return the drawing: pivot, rod, bob, angle, excitation, gravity, torques of friction.

    The pivot's acceleration upward, p g cos(Omega t + phi), adds to gravity; so its position is
    ``-Y cos(Omega t + phi)``, upward, with ``Y = p g / Omega**2``.
    """
    width, height = size or SIZE
    equation = f"th'' + (c/m) th' + w0² (1 + p {_DRIVE}) sin th = -Tr sign(th')"
    known = "w0² = g/l, p = YΩ²/g"
    equation = typographic(f"{equation};   {known}").replace("th", "θ").replace("w0", "ω₀")
    scale = min((width - 0.2) / 5.8, (height - HEAD) / 4.85)
    wide, high = (width - 0.2) / scale, (height - HEAD) / scale
    sides = Axis("", (0.55 - wide / 2, 0.55 + wide / 2)), Axis("", (1.25 - high, 1.25))
    font = 11.0 * min(scale, 1.2)
    marks = [*_guide(font), *_rod(font), *_forces(font)]
    panel = Panel("pendulum", "", *sides, marks, bare=True)
    return Chart(title or TITLE, equation, [[panel]], size=(width, height))


def _guide(font: float) -> list[Mark]:
    """Return the slider on its rail, and the arrow of its motion."""
    slider = np.array([(-0.3, -0.24), (0.3, -0.24), (0.3, 0.24), (-0.3, 0.24), (-0.3, -0.24)])
    rail = np.array([(-0.42, -0.8), (-0.32, -0.8), (-0.32, 0.8), (-0.42, 0.8)])
    rungs = [_line((-0.42, y), (-0.54, y + 0.12), _HELP, 0.7) for y in -0.8 + 0.18 * np.arange(9)]
    place: dict[str, Any] = {"colour": _HELP, "align": _RIGHT, "size": 0.78 * font}
    moves: dict[str, Any] = {"colour": _MOTION, "align": _RIGHT, "size": font}
    return [
        Areas([rail], colour=_RAIL, order=1.0),
        *rungs,
        Areas([slider], colour=_WHITE, order=2.0),
        Line(*slider.T, colour=_DARK, width=1.4, order=2.1),
        *_arrow((-0.82, -0.75), (-0.82, 0.75), _MOTION, both=True),
        _line((-0.94, 0.0), (-0.6, 0.0), _HELP, 0.8, dash=_DASHED),
        Text(-0.98, 0.3, typographic(f"-Y {_DRIVE}"), **moves),
        Text(-0.98, -0.02, "the pivot's place,\nupward", **place),
    ]


def _rod(font: float) -> list[Mark]:
    """Return rod, bob, rest position, angle and length."""
    x, y = LENGTH * math.sin(THETA), -LENGTH * math.cos(THETA)
    side, half, radius = (math.cos(THETA), math.sin(THETA)), THETA / 2, 1.55
    across, along = 0.055 * side[0], 0.055 * side[1]
    rod = [(-across, -along), (across, along), (x + across, y + along), (x - across, y - along)]
    # The length is drawn beside the rod, opposite to the angle, from pivot to bob.
    move = (ASIDE * side[0], ASIDE * side[1])
    marks: list[Mark] = [
        _line((0.0, -0.3), (0.0, -LENGTH - 0.3), _HELP, 0.9, dash=_DASHED),
        Line(*_arc((0.0, -LENGTH), BOB).T, colour=_HELP, width=0.9, dash=(3.0, 2.0)),
        Areas([np.array(rod)], colour=_STEEL, order=3.0),
        Areas([_arc((0.0, 0.0), 0.13)], colour=_WHITE, order=4.0),
        Line(*_arc((0.0, 0.0), 0.13).T, colour=_DARK, width=1.6, order=4.1),
        Areas([_arc((0.0, 0.0), 0.04), _arc((x, y), BOB)], colour=_DARK, order=4.2),
        Text(x, y, "$m$", colour=_WHITE, size=font, order=5.0),
        *_turn(radius, -math.pi / 2, THETA - math.pi / 2, _DARK, 1.3),
        Text(
            (radius + 0.22) * math.sin(half),
            -(radius + 0.22) * math.cos(half),
            "θ",
            colour=_DARK,
            size=1.3 * font,
        ),
        *_arrow(move, (x + move[0], y + move[1]), _HELP, both=True, thin=True),
        Text(x / 2 + 1.4 * move[0], y / 2 + 1.4 * move[1], "$l$", size=1.1 * font),
    ]
    for (foot_x, foot_y), first in (((0.0, 0.0), 0.2), ((x, y), BOB + 0.04)):
        near, far = (
            (foot_x + end * side[0], foot_y + end * side[1]) for end in (first, ASIDE + 0.08)
        )
        marks.append(_line(near, far, _HELP, 0.7))
    return marks


def _forces(font: float) -> list[Mark]:
    """Return gravity, the velocity, and friction and drag against the motion."""
    x, y = LENGTH * math.sin(THETA), -LENGTH * math.cos(THETA)
    side = (math.cos(THETA), math.sin(THETA))
    # The velocity is along the arc, upward.
    start = (x + (ASIDE + 0.14) * side[0], y + (ASIDE + 0.14) * side[1])
    torque = "drag and dry friction over m l²:\n(c/m) dθ/dt + Tr sign(dθ/dt)"
    pull: dict[str, Any] = {"colour": _FORCE, "align": _LEFT}
    end = (start[0] + 0.7 * side[0], start[1] + 0.7 * side[1])
    above: dict[str, Any] = {"colour": _MOTION, "align": ("center", "bottom"), "size": font}
    return [
        *_arrow((x, y - BOB), (x, y - BOB - 0.75), _FORCE),
        Text(x + 0.14, y - BOB - 0.5, "$m\\,g$", size=font, **pull),
        *_arrow(start, end, _MOTION),
        Text(start[0] + 0.78 * side[0], start[1] + 0.78 * side[1] + 0.12, "dθ/dt > 0", **above),
        # Torque about the axle, opposite to the rotation.
        *_turn(0.98, math.radians(52), math.radians(-14), _FORCE, 1.6),
        Text(1.14, 0.42, torque, size=0.82 * font, **pull),
    ]


def _line(start: Point, end: Point, colour: str, width: float, **look: Any) -> Line:  # noqa: ANN401
    x, y = np.array([start, end]).T
    return Line(x, y, colour=colour, width=width, order=1.0, **look)


def _arc(centre: Point, radius: float, first: float = 0.0, last: float = math.tau) -> Floats:
    angle = np.linspace(first, last, 60)
    return np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _head(tip: Point, way: float, colour: str, size: float = 0.17) -> Areas:
    """Return the head of an arrow at its tip, in the direction of an angle."""
    ends = [_arc(tip, size, way + turn, way + turn)[0] for turn in (math.pi - 0.38, math.pi + 0.38)]
    return Areas([np.array([tip, *ends])], colour=colour, order=5.0)


def _arrow(
    start: Point, end: Point, colour: str, *, both: bool = False, thin: bool = False
) -> list[Mark]:
    way = math.atan2(end[1] - start[1], end[0] - start[0])
    size = 0.12 if thin else 0.17
    first, last = (
        (at[0] + part * size * math.cos(way), at[1] + part * size * math.sin(way))
        for at, part in ((start, 0.5 * both), (end, -0.5))
    )
    line = _line(first, last, colour, 0.9 if thin else 1.6)
    marks: list[Mark] = [line, _head(end, way, colour, size)]
    return [*marks, _head(start, way + math.pi, colour, size)] if both else marks


def _turn(radius: float, first: float, last: float, colour: str, width: float) -> list[Mark]:
    """Return an arc about the pivot, from one angle to another, with a head."""
    sense = math.copysign(1.0, last - first)
    arc = _arc((0.0, 0.0), radius, first, last - sense * 0.08 / radius)
    tip = (radius * math.cos(last), radius * math.sin(last))
    way = last + sense * (math.pi / 2 - 0.08 / radius)
    return [Line(*arc.T, colour=colour, width=width), _head(tip, way, colour)]
