"""Table 1 of a record, drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.charts import identification
from pendmap.render import blocks, style

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from pendmap.identification import IdentificationReport
    from pendmap.render.blocks import Box

LINE: Final = 0.2
APART: Final = 0.14
"""Inches between columns at least."""
FONT: Final = 8.0


def _height(report: IdentificationReport) -> float:
    lines = len(identification.rows(report)) + len(identification.refused(report))
    return blocks.HEADING + LINE * (lines + 3) + 0.25


def _draw(
    figure: Figure, box: Box, report: IdentificationReport, letters: Iterator[str], title: str
) -> None:
    del letters
    blocks.named(figure, box, title)
    head, rows = identification.columns(report), identification.rows(report)
    split = [_folded(text) for text in head]
    widths = [
        max(style.inches(text, FONT) for text in (*name.split("\n"), *(row[k] for row in rows)))
        for k, name in enumerate(split)
    ]
    refused = identification.refused(report)
    widths[0] = max([widths[0], *(style.inches(name, FONT) for name, _ in refused)])
    spare = box.width - 0.3 - sum(widths) - APART * (len(widths) - 1)
    # What does not fit by its own size is written smaller.
    shrink = min(1.0, (box.width - 0.3 - APART * (len(widths) - 1)) / sum(widths))
    gap = APART + max(spare, 0.0) / (len(widths) - 1)
    whole = figure.get_size_inches()
    top = box.bottom + box.height - (blocks.HEADING if title else 0.0) - 0.05
    left, places = box.left + 0.1, []
    for k, width in enumerate(widths):
        # The first column begins, numbers end, at the same place.
        places.append((left if k == 0 else left + width * shrink, "left" if k == 0 else "right"))
        left += width * shrink + gap

    def write(k: int, down: float, text: str, colour: str, *, bold: bool = False) -> None:
        x, side = places[k]
        figure.text(
            x / whole[0],
            (top - down) / whole[1],
            text,
            fontsize=FONT * shrink,
            ha=side,
            va="bottom",
            color=colour,
            linespacing=1.15,
            weight="bold" if bold else "normal",
        )

    for k, name in enumerate(split):
        write(k, 2 * LINE - 0.06, name, style.QUIET)
    for line, row in enumerate(rows):
        for k, text in enumerate(row):
            write(k, LINE * (line + 3) - 0.04, text, style.INK)
    for line, (name, why) in enumerate(refused, len(rows)):
        down = LINE * (line + 3) - 0.04
        write(0, down, name, style.QUIET)
        x = places[0][0] + widths[0] * shrink + gap
        room = box.left + box.width - 0.1 - x
        size = FONT * min(1.0, room / max(style.inches(why, FONT), 1e-3))
        figure.text(
            x / whole[0],
            (top - down) / whole[1],
            why,
            fontsize=size,
            va="bottom",
            color=style.QUIET,
        )
    note = "in brackets: standard error of the last digits"
    if any(identification.RESTS in row for row in rows):
        note += f";   {identification.RESTS}: the simulation stands still by then"
    if rows:
        write(0, LINE * (len(rows) + len(refused) + 3) - 0.04, note, style.QUIET)


def _folded(text: str) -> str:
    """Return a column's name on two lines, the unit or number below."""
    first, blank, rest = text.partition(" ")
    return f"{first}\n{rest}" if blank else f"\n{text}"


BLOCK: Final = blocks.Block(
    "table",
    "Damping by each method, and what its simulation misses (%)",
    _height,
    _draw,
)
