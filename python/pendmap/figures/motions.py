"""Forced runs beside a model: steady states, and paths that tumble, a figure each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.lines import Line2D

from pendmap.figures import blocks, forced
from pendmap.figures import sheet as sheets
from pendmap.identification.compare import MODEL
from pendmap.pictures.methods import MEASURED, look
from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

    from pendmap.identification import ForcedComparison

__all__ = ["steady_figure", "tumbling_figure"]

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
    figure = sheets.headed(size, dpi, title, subtitle, left=0.1)
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
    figure = sheets.headed(size, dpi, title, subtitle, left=0.1)
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
