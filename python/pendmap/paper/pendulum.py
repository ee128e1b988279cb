"""Chart of the pendulum with its moving pivot (figure 3)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import Areas, Line, Mark, Text
from pendmap.formatting import typographic

if TYPE_CHECKING:
    from pendmap.charts.marks import Floats

    Point = tuple[float, float] | Floats

TITLE: Final = "The parametric pendulum"
SIZE: Final = (6.0, 5.6)  # Width and height, inches
FONT: Final = 10.5  # Size of letters, points
THETA: Final = math.radians(38.0)  # Angle of the pendulum
LENGTH: Final = 3.0
BOB: Final = 0.3
ASIDE: Final = 0.5
"""Lengths in units of the drawing: rod, radius of the bob, distance of annotations from the rod."""

_SIDE: Final = np.array([math.cos(THETA), math.sin(THETA)])  # Unit vector across the rod
_END: Final = LENGTH * np.array([math.sin(THETA), -math.cos(THETA)])  # Centre of the bob

_DRIVE: Final = "cos(Ωt + φ)"
_STEEL, _DARK, _RAIL, _HELP = "#3d4f66", "#1d3557", "#b8c2cf", "#8a8a8a"
_FORCE, _MOTION = "#d55e00", "#0072b2"
_WHITE: Final = "#ffffff"
_DASHED: Final = (6.0, 3.0)
_RIGHT, _LEFT = ("right", "center"), ("left", "center")


def chart(title: str | None = None) -> Chart:
    """Return the drawing: pivot, rod, bob, angle, excitation, gravity, torques of friction.

    The pivot's acceleration upward, p g cos(Omega t + phi), adds to gravity; so its position is
    ``-Y cos(Omega t + phi)``, upward, with ``Y = p g / Omega**2``.
    """
    equation = f"θ'' + (c/m) θ' + ω₀² (1 + p {_DRIVE}) sin θ = -Tr sign(θ');   ω₀² = g/l, p = YΩ²/g"
    sides = Axis("", (-2.475, 3.575)), Axis("", (-3.6, 1.25))
    panel = Panel("pendulum", "", *sides, [*_guide(), *_rod(), *_forces()], bare=True)
    return Chart(title or TITLE, typographic(equation), [[panel]], size=SIZE)


def _guide() -> list[Mark]:
    """Return the slider on its rail, and the arrow of its motion."""
    slider = np.array([(-0.3, -0.24), (0.3, -0.24), (0.3, 0.24), (-0.3, 0.24), (-0.3, -0.24)])
    rail = np.array([(-0.42, -0.8), (-0.32, -0.8), (-0.32, 0.8), (-0.42, 0.8)])
    rungs = [_line((-0.42, y), (-0.54, y + 0.12), _HELP, 0.7) for y in -0.8 + 0.18 * np.arange(9)]
    place: dict[str, Any] = {"colour": _HELP, "align": _RIGHT, "size": 0.78 * FONT}
    moves: dict[str, Any] = {"colour": _MOTION, "align": _RIGHT, "size": FONT}
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


def _rod() -> list[Mark]:
    """Return rod, bob, rest position, angle and length."""
    radius, wide = 1.55, 0.055 * _SIDE
    middle = np.array([math.sin(THETA / 2), -math.cos(THETA / 2)])
    rod = np.array([-wide, wide, _END + wide, _END - wide])
    # The length is drawn beside the rod, opposite to the angle, from pivot to bob.
    move = ASIDE * _SIDE
    marks: list[Mark] = [
        _line((0.0, -0.3), (0.0, -LENGTH - 0.3), _HELP, 0.9, dash=_DASHED),
        Line(*_arc((0.0, -LENGTH), BOB).T, colour=_HELP, width=0.9, dash=(3.0, 2.0)),
        Areas([rod], colour=_STEEL, order=3.0),
        Areas([_arc((0.0, 0.0), 0.13)], colour=_WHITE, order=4.0),
        Line(*_arc((0.0, 0.0), 0.13).T, colour=_DARK, width=1.6, order=4.1),
        Areas([_arc((0.0, 0.0), 0.04), _arc(_END, BOB)], colour=_DARK, order=4.2),
        _text(_END, "m", colour=_WHITE, size=FONT, order=5.0),
        *_turn(radius, -math.pi / 2, THETA - math.pi / 2, _DARK, 1.3),
        _text((radius + 0.22) * middle, "θ", colour=_DARK, size=1.3 * FONT),
        *_arrow(move, _END + move, _HELP, both=True, thin=True),
        _text(_END / 2 + 1.4 * move, "$l$", size=1.1 * FONT),
    ]
    for foot, first in ((np.zeros(2), 0.2), (_END, BOB + 0.04)):
        marks.append(_line(foot + first * _SIDE, foot + (ASIDE + 0.08) * _SIDE, _HELP, 0.7))
    return marks


def _forces() -> list[Mark]:
    """Return gravity, the velocity, and friction and drag against the motion."""
    # The velocity is along the arc, upward.
    start = _END + (ASIDE + 0.14) * _SIDE
    torque = "drag and dry friction over m l²:\n(c/m) dθ/dt + Tr sign(dθ/dt)"
    pull: dict[str, Any] = {"colour": _FORCE, "align": _LEFT}
    above: dict[str, Any] = {"colour": _MOTION, "align": ("center", "bottom"), "size": FONT}
    return [
        *_arrow(_END - (0.0, BOB), _END - (0.0, BOB + 0.75), _FORCE),
        _text(np.add(_END, (0.14, -BOB - 0.5)), "m g", size=FONT, **pull),
        *_arrow(start, start + 0.7 * _SIDE, _MOTION),
        _text(start + 0.78 * _SIDE + (0.0, 0.12), "dθ/dt > 0", **above),
        # Torque about the axle, opposite to the rotation.
        *_turn(0.98, math.radians(52), math.radians(-14), _FORCE, 1.6),
        Text(1.14, 0.42, torque, size=0.82 * FONT, **pull),
    ]


def _line(start: Point, end: Point, colour: str, width: float, **look: Any) -> Line:  # noqa: ANN401
    x, y = np.array([start, end]).T
    return Line(x, y, colour=colour, width=width, order=1.0, **look)


def _text(at: Floats, text: str, **look: Any) -> Text:  # noqa: ANN401 (fields of a text)
    return Text(float(at[0]), float(at[1]), text, **look)


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
    short = 0.5 * size * np.array([math.cos(way), math.sin(way)])
    line = _line(start + both * short, end - short, colour, 0.9 if thin else 1.6)
    marks: list[Mark] = [line, _head(end, way, colour, size)]
    return [*marks, _head(start, way + math.pi, colour, size)] if both else marks


def _turn(radius: float, first: float, last: float, colour: str, width: float) -> list[Mark]:
    """Return an arc about the pivot, from one angle to another, with a head."""
    sense = math.copysign(1.0, last - first)
    arc = _arc((0.0, 0.0), radius, first, last - sense * 0.08 / radius)
    tip = (radius * math.cos(last), radius * math.sin(last))
    way = last + sense * (math.pi / 2 - 0.08 / radius)
    return [Line(*arc.T, colour=colour, width=width), _head(tip, way, colour)]
