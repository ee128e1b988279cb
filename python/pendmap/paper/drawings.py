"""The pendulum with its moving pivot, drawn (figure 3)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Arc, Circle, FancyArrowPatch, Polygon, Rectangle

from pendmap.charts.methods import MEASURED, look
from pendmap.comparison.free import MODEL
from pendmap.formatting import counted
from pendmap.render import blocks, forced
from pendmap.render import sheet as sheets

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.comparison import ForcedComparison


TITLE: Final = "The parametric pendulum"
SIZE: Final = (6.0, 5.6)
"""Inches."""
THETA: Final = math.radians(38.0)
"""Angle of the rod."""
LENGTH: Final = 3.0
BOB: Final = 0.3
ASIDE: Final = 0.5
"""Lengths in units of the drawing, of which one is an inch."""

_DRIVE: Final = "cos(\u03a9t + \u03c6)"
_STEEL: Final = "#3d4f66"
_DARK: Final = "#1d3557"
_RAIL: Final = "#b8c2cf"
_FORCE: Final = "#d55e00"
_MOTION: Final = "#0072b2"
_HELP: Final = "#8a8a8a"


def figure(
    *, size: tuple[float, float] | None = None, dpi: float = 200.0, title: str | None = None
) -> Figure:
    """Return the drawing: pivot, rod, bob, angle, excitation, gravity, torques of friction.

    The pivot's acceleration upward, p g cos(Omega t + phi), adds to gravity; so its place is
    ``-Y cos(Omega t + phi)``, upward, with ``Y = p g / Omega**2``.
    """
    width, height = size or SIZE
    equation = f"th'' + (c/m) th' + w0\u00b2 (1 + p {_DRIVE}) sin th = \u2212Tr sign(th')"
    known = "w0\u00b2 = g/l, p = Y\u03a9\u00b2/g"
    equation = f"{equation};   {known}".replace("th", "\u03b8").replace("w0", "\u03c9\u2080")
    made = sheets.headed((width, height), dpi, title or TITLE, equation)
    scale = min((width - 0.2) / 5.8, (height - 0.75) / 4.85)
    wide, high = (width - 0.2) / scale, (height - 0.75) / scale
    axes = sheets.place(made, 0.1, 0.05, width - 0.2, height - 0.75)
    axes.set_xlim(-wide / 2 + 0.55, wide / 2 + 0.55)
    axes.set_ylim(1.25 - high, 1.25)
    axes.set_aspect("equal")
    axes.axis("off")
    font = 11.0 * min(scale, 1.2)
    _guide(axes, font)
    _rod(axes, font)
    _forces(axes, font)
    return made


def _guide(axes: Axes, font: float) -> None:
    """Draw the slider on its rail, and its motion."""
    axes.add_patch(Rectangle((-0.42, -0.8), 0.1, 1.6, fc=_RAIL, ec="none", zorder=1))
    for k in range(9):
        y = -0.8 + 0.18 * k
        axes.plot([-0.42, -0.54], [y, y + 0.12], color=_HELP, lw=0.7, zorder=1)
    axes.add_patch(Rectangle((-0.3, -0.24), 0.6, 0.48, fc="white", ec=_DARK, lw=1.4, zorder=2))
    _arrow(axes, (-0.82, -0.75), (-0.82, 0.75), _MOTION, arrowstyle="<|-|>")
    axes.plot([-0.94, -0.6], [0, 0], color=_HELP, lw=0.8, ls=(0, (6, 3)))
    _text(axes, (-0.98, 0.3), f"\u2212Y {_DRIVE}", font, ha="right", color=_MOTION)
    place, small = "the pivot's place,\nupward", 0.78 * font
    _text(axes, (-0.98, -0.02), place, small, ha="right", color=_HELP, linespacing=1.3)


def _rod(axes: Axes, font: float) -> None:
    """Draw rod and bob, their place at rest, the angle, the length."""
    x, y = _place(LENGTH, THETA)
    down = -LENGTH - 0.3
    axes.plot([0, 0], [-0.3, down], color=_HELP, lw=0.9, ls=(0, (6, 3)), zorder=1)
    axes.add_patch(Circle((0, -LENGTH), BOB, fc="none", ec=_HELP, lw=0.9, ls=(0, (3, 2)), zorder=1))
    across, along = 0.055 * math.cos(THETA), 0.055 * math.sin(THETA)
    corners = [(-across, -along), (across, along), (x + across, y + along), (x - across, y - along)]
    axes.add_patch(Polygon(corners, fc=_STEEL, ec="none", zorder=3))
    axes.add_patch(Circle((0, 0), 0.13, fc="white", ec=_DARK, lw=1.6, zorder=4))
    axes.add_patch(Circle((0, 0), 0.04, fc=_DARK, ec="none", zorder=5))
    axes.add_patch(Circle((x, y), BOB, fc=_DARK, ec="none", zorder=4))
    _text(axes, (x, y), "m", font, color="white", style="italic", zorder=5)
    radius = 1.55
    _arc(axes, radius, (270, 270 + math.degrees(THETA) - 4), color=_DARK, lw=1.3)
    before, end = (THETA - math.radians(degrees) for degrees in (6, 0.5))
    _arrow(axes, _place(radius, before), _place(radius, end), _DARK)
    _text(axes, _place(radius + 0.22, THETA / 2), "\u03b8", 1.3 * font, color=_DARK)
    # The length stands on the other side of the rod than the angle, from pivot to bob.
    move = (ASIDE * math.cos(THETA), ASIDE * math.sin(THETA))
    ends = (x + move[0], y + move[1])
    _arrow(axes, move, ends, _HELP, arrowstyle="<|-|>", mutation_scale=9, lw=0.9)
    for (foot_x, foot_y), bare in (((0.0, 0.0), 0.2), ((x, y), BOB + 0.04)):
        ends = (bare, ASIDE + 0.08)
        axes.plot(
            [foot_x + end * math.cos(THETA) for end in ends],
            [foot_y + end * math.sin(THETA) for end in ends],
            color=_HELP,
            lw=0.7,
            zorder=4,
        )
    middle = (x / 2 + 1.4 * move[0], y / 2 + 1.4 * move[1])
    _text(axes, middle, "l", 1.1 * font, style="italic")


def _forces(axes: Axes, font: float) -> None:
    """Draw gravity, and friction and drag against the motion."""
    x, y = _place(LENGTH, THETA)
    _arrow(axes, (x, y - BOB), (x, y - BOB - 0.75), _FORCE)
    side: dict[str, Any] = {"ha": "left", "color": _FORCE}
    _text(axes, (x + 0.14, y - BOB - 0.5), "m g", font, style="italic", **side)
    # The velocity is along the arc, upward.
    tangent = (math.cos(THETA), math.sin(THETA))
    start = (x + (ASIDE + 0.14) * tangent[0], y + (ASIDE + 0.14) * tangent[1])
    end, label = (
        (start[0] + far * tangent[0], start[1] + far * tangent[1] + above)
        for far, above in ((0.7, 0.0), (0.78, 0.12))
    )
    _arrow(axes, start, end, _MOTION)
    _text(axes, label, "d\u03b8/dt > 0", font, color=_MOTION, va="bottom")
    # A torque on the axle, against the turning.
    first, last, radius = math.radians(52), math.radians(-14), 0.98
    _arc(axes, radius, (math.degrees(last) + 6, math.degrees(first)), color=_FORCE, lw=1.6)
    before, tip = (
        (radius * math.cos(angle), radius * math.sin(angle))
        for angle in (last + math.radians(9), last)
    )
    _arrow(axes, before, tip, _FORCE)
    said = "drag and dry friction over m l\u00b2:\n(c/m) d\u03b8/dt + Tr sign(d\u03b8/dt)"
    _text(axes, (1.14, 0.42), said, 0.82 * font, linespacing=1.4, **side)


def _place(radius: float, angle: float) -> tuple[float, float]:
    """Return the place at a distance from the pivot and an angle from hanging."""
    return radius * math.sin(angle), -radius * math.cos(angle)


def _text(axes: Axes, at: tuple[float, float], text: str, size: float, **look: Any) -> None:  # noqa: ANN401
    usual = {"ha": "center", "va": "center"}
    axes.text(*at, text, fontsize=size, **usual | look)


def _arc(axes: Axes, radius: float, ends: tuple[float, float], **look: Any) -> None:  # noqa: ANN401
    """Draw an arc about the pivot between two angles in degrees."""
    axes.add_patch(Arc((0, 0), 2 * radius, 2 * radius, theta1=ends[0], theta2=ends[1], **look))


def _arrow(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    colour: str,
    **look: Any,  # noqa: ANN401
) -> None:
    head: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 13, "lw": 1.6} | look
    axes.add_patch(
        FancyArrowPatch(start, end, color=colour, shrinkA=0, shrinkB=0, zorder=5, **head)
    )


WIDTH: Final = 11.6
HIGH: Final = 3.3
GAP: Final = 0.75
"""Inches: of a sheet, of a row, between its panels."""
_STEADY: Final = 2
"""Steady states in a row."""
_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"


def steady_figure(
    runs: Sequence[ForcedComparison], *, dpi: float, title: str, subtitle: str
) -> Figure:
    """Return the figure: a phase plane for each run, the record as points, the model as a line."""
    rows = -(-len(runs) // _STEADY)
    size = (0.7 * WIDTH, rows * HIGH + 1.2)
    figure = sheets.headed(size, dpi, title, subtitle)
    _legend(figure, rows * HIGH + 0.42, "o", size[0])
    for k, one in enumerate(runs):
        row, column = divmod(k, _STEADY)
        whole = blocks.Box(0.0, (rows - 1 - row) * HIGH, size[0], HIGH)
        box = whole.less(left=0.78, right=0.16, top=0.55, bottom=0.5).columns(_STEADY, GAP)[column]
        axes = box.panel(figure)
        forced.draw_cycles(axes, one)
        axes.set_title(f"({_LETTERS[k]}) {_steady_said(one)}")
    return figure


def _steady_said(one: ForcedComparison) -> str:
    drive = _drive(one)
    found = one.steady
    if found is None:
        return f"{drive}: no steady state"
    if found.model is None:
        return f"{drive}: {found.measured.kind},\nnot that of the model"
    error = 100 * found.overestimate
    return f"{drive}: {found.measured.kind},\namplitude of the model {error:+.2g} %"


def _drive(one: ForcedComparison) -> str:
    given = one.run.drive or {}
    p, frequency = given.get("p") or 0.0, given.get("Omega") or 0.0
    return f"p = {p:g}, \N{GREEK CAPITAL LETTER OMEGA} = {frequency:.4g} rad/s"


def tumbling_figure(
    runs: Sequence[ForcedComparison], *, dpi: float, title: str, subtitle: str
) -> Figure:
    """Return the figure: a row a run, histories, phase planes and statistics side by side.

    A record and a member of the ensemble stand beside one another, never over one another.
    """
    size = (WIDTH, len(runs) * HIGH + 1.2)
    figure = sheets.headed(size, dpi, title, subtitle)
    _legend(figure, len(runs) * HIGH + 0.42, "", size[0])
    letters = iter(f"({letter}) " for letter in _LETTERS)
    for k, one in enumerate(runs):
        box = blocks.Box(0.0, (len(runs) - 1 - k) * HIGH, WIDTH, HIGH)
        heading = f"{_drive(one)}: {counted(one.ensemble.members, 'member')} of the ensemble"
        cells = blocks.named(figure, box, heading).columns(4, GAP)
        fastest = max(float(np.abs(v).max()) for v in (one.velocity, one.example[1]))
        paths = ((one.measured, one.velocity), one.example)
        colours = (MEASURED, look(MODEL).colour)
        named = ("record", "a member")
        for cell, path, colour, name in zip(
            cells[0].rows((1, 1), (0.62,)), paths, colours, named, strict=True
        ):
            axes = cell.panel(figure)
            forced.draw_history(axes, one.time, path[0], colour)
            axes.set_title(next(letters) + name)
            if name == "record":
                axes.set_xlabel("")
        for cell, path, colour, name in zip(cells[1:3], paths, colours, named, strict=True):
            axes = cell.panel(figure)
            forced.draw_phase(axes, path, colour, fastest)
            axes.set_title(next(letters) + name)
        axes = cells[3].less(left=-0.45, bottom=-0.3).panel(figure)
        forced.draw_statistics(axes, one)
        axes.set_title(next(letters) + "record (95 % of the ensemble)")
    return figure


def _legend(figure: Figure, top: float, marker: str, width: float) -> None:
    line = "" if marker else "-"
    handles: list[Artist] = [
        Line2D([], [], color=MEASURED, marker=marker, ls=line, lw=1.6, ms=4, mfc="none"),
        Line2D([], [], color=look(MODEL).colour, lw=1.6),
    ]
    texts = ["virtual rig", "identified model"]
    if not marker:
        shades, named = forced.legend()
        handles, texts = [*handles, *shades], [*texts, *named]
    box = blocks.Box(0.0, top - 1.0, width, 1.0)
    blocks.named(figure, box, "", handles, texts)
