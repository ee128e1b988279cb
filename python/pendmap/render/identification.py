"""The sheet of an identification: figures 4 to 7 of the paper and its table 1, for one record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.render import blocks, decays, decrements, errors, half_cycles, results_table
from pendmap.render import sheet as sheets
from pendmap.signal.robust import span

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from pendmap.identification import IdentificationReport
    from pendmap.render.blocks import Block

_BLOCKS: Final = {
    block.name: block
    for block in (
        half_cycles.BLOCK,
        decrements.BLOCK,
        decays.BLOCK,
        errors.BLOCK,
        results_table.BLOCK,
    )
}
PARTS: Final = tuple(_BLOCKS)
"""Parts of the sheet by the names a user types: figures 4, 5, 6, 7 and table 1."""

COLUMN: Final = 8.6
"""Width of a column in inches."""
BETWEEN: Final = 0.2
"""Inches between parts above one another."""
SMALLEST: Final = 0.72
"""Part of its own height with which a part remains readable."""
NARROWEST: Final = 7.6
"""Inches in which the table finds room."""


def figure(  # noqa: PLR0913 (all of these may be chosen)
    report: IdentificationReport,
    *,
    parts: Sequence[str] | None = None,
    size: tuple[float, float] | None = None,
    dpi: float = 200.0,
    title: str | None = None,
    subtitle: str | None = None,
) -> Figure:
    """Return the sheet; see :func:`pendmap.render.draw_identification`."""
    chosen = _chosen(parts)
    columns = _columns(chosen, report)
    heights = [_high(column, report) for column in columns]
    width, height = size or (COLUMN * len(columns), max(heights) + sheets.TOP - 0.2)
    room = height - sheets.TOP + 0.2
    if width < NARROWEST * len(columns) or room < SMALLEST * max(heights):
        least = (NARROWEST * len(columns), SMALLEST * max(heights) + sheets.TOP)
        raise InputError(
            f"size {size} leaves no room for the panels; it must be at least"
            f" {least[0]:.1f} x {least[1]:.1f} inches"
        )
    made = sheets.headed(
        (width, height),
        dpi,
        title or f"Identification: {report.run.name}",
        _said(report) if subtitle is None else subtitle,
    )
    letters = iter(f"({letter}) " for letter in "abcdefghijklmnopqrstuvwxyz")
    wide = width / len(columns)
    bare = title is not None and len(chosen) == 1
    for k, column in enumerate(columns):
        # A table's rows stay as high as they are; the panels share what is left.
        fixed = sum(b.height(report) for b in column if b is results_table.BLOCK)
        free = _high(column, report) - fixed - BETWEEN * (len(column) - 1)
        stretch = (room - fixed - BETWEEN * (len(column) - 1)) / free if free else 1.0
        top = room
        for block in column:
            high = block.height(report) * (1.0 if block is results_table.BLOCK else stretch)
            block.draw(
                made,
                blocks.Box(k * wide, top - high, wide, high),
                report,
                letters,
                "" if bare else block.title,
            )
            top -= high + BETWEEN
    return made


def _chosen(parts: Sequence[str] | None) -> list[Block]:
    names = list(PARTS) if parts is None else list(dict.fromkeys(parts))
    unknown = [name for name in names if name not in _BLOCKS]
    if unknown or not names:
        what = repr(unknown[0]) if unknown else "nothing"
        raise InputError(f"parts must be among {', '.join(PARTS)}, got {what}")
    return [_BLOCKS[name] for name in PARTS if name in names]


def _columns(chosen: list[Block], report: IdentificationReport) -> list[list[Block]]:
    """Return one column, or two of nearly equal height where there are more than two parts."""
    if len(chosen) <= 2:  # noqa: PLR2004
        return [chosen]
    cuts = range(1, len(chosen))
    best = min(cuts, key=lambda k: max(_high(chosen[:k], report), _high(chosen[k:], report)))
    return [chosen[:best], chosen[best:]]


def _high(column: Sequence[Block], report: IdentificationReport) -> float:
    return sum(block.height(report) for block in column) + BETWEEN * (len(column) - 1)


def _said(report: IdentificationReport) -> str:
    """What was measured, in a line."""
    run, peaks = report.run, report.peaks
    if run.peaks_only:
        return f"{len(peaks)} peaks, {span(run.time)}"
    noise = f"noise {peaks.sigma:.2g} rad" if peaks.sigma else "no noise seen"
    if len(report.runs) > 1:
        fitted = f"fitted to {len(report.runs)} runs; drawn: {run.name}, the longest"
        return f"{fitted};   {span(run.time)}, {len(peaks)} peaks, {noise}"
    used = f"{run.trusted.sum()} of {run.time.size} samples for fitting"
    return f"{run.rate_hz:.5g} Hz, {span(run.time)}, {used};   {len(peaks)} peaks, {noise}"
