"""The report of a diagnosis with its figures, one for each of its parts."""

from __future__ import annotations

import contextlib
import io
from typing import TYPE_CHECKING, Final

import matplotlib as mpl
from matplotlib.lines import Line2D

from pendmap import report
from pendmap.files import whole_file, whole_folder
from pendmap.render import candidates, gap, lacking, style
from pendmap.render import sheet as sheets
from pendmap.render.blocks import Box
from pendmap.render.errors import draw_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from matplotlib.figure import Figure

    from pendmap.diagnosis import Discrepancy
    from pendmap.report.document import Document

SUFFIXES: Final = (".html", ".md")
"""The kinds of file that a report is."""

DPI: Final = 110.0
"""Pixels per inch: sharp on a screen, and the file stays under a megabyte."""

WIDTH: Final = 8.6
"""Inches of every figure."""

LEFT, RIGHT, BELOW = 0.75, 0.2, 0.83
"""Inches beside and beneath the panels."""

APART: Final = (0.75, 0.85)
"""Inches between panels, beside and above one another."""

ROOM: Final = WIDTH - LEFT - RIGHT

CYCLES: Final = 3
"""Free runs in figure 7: those held out first, then the longest."""


def _empty(height: float, dpi: float, title: str, said: str) -> Figure:
    return sheets.headed((WIDTH, height), dpi, title, said, left=LEFT)


def residuals(found: Discrepancy, dpi: float) -> Figure:
    """Return record less model in time, of the runs that the baseline misses most."""
    made = _empty(4.2, dpi, "Residuals", "the runs that the baseline misses most")
    gap.draw_residuals(made, Box(LEFT, 0.55, ROOM, 2.7), found)
    return made


def rms(found: Discrepancy, dpi: float) -> Figure:
    """Return the residual by run, and the error of forecasts of free and of forced runs."""
    forecasts = found.forecasts
    starts = " and ".join(f"{f.starts} {f.kind}" for f in forecasts)
    said = f"forecasts from {starts} starts on what was held out" if forecasts else ""
    made = _empty(3.68, dpi, "The gap", said)
    handles = [
        Line2D([], [], color=colour, lw=1.4, label=name, marker=mark, mfc=fill, ms=4.5)
        for (name, colour), mark, fill in zip(
            gap.models(found), "os", ("white", gap.AFTER), strict=False
        )
    ]
    handles.append(Line2D([], [], color=style.INK, lw=1.1, label="noise"))
    made.legend(handles=handles, loc="upper right", ncols=3)
    cells = Box(LEFT, BELOW, ROOM, 1.85).columns(1 + len(forecasts), APART[0])
    gap.draw_by_run(cells[0].panel(made), found)
    for cell, forecast in zip(cells[1:], forecasts, strict=True):
        gap.draw_forecast(cell.panel(made), found, forecast)
    return made


def torque(found: Discrepancy, dpi: float) -> Figure | None:
    """Return the torque that both models lack over all there is to show it over."""
    shown = lacking.shown_over(found)
    if not shown:
        return None
    rows = -(-len(shown) // 2)
    high = 1.5
    height = 0.8 + rows * high + (rows - 1) * APART[1] + 0.6
    made = _empty(height, dpi, "Torque that the model lacks", "per moment of inertia; bands: 95 %")
    handles = [Line2D([], [], color=c, lw=1.4, label=name) for name, c in gap.models(found)]
    made.legend(handles=handles, loc="upper right", ncols=2)
    # Two lines beside a panel need more than one.
    lines = Box(LEFT + 0.15, 0.6, ROOM - 0.15, rows * high + (rows - 1) * APART[1]).rows(
        [1.0] * rows, [APART[1]] * (rows - 1)
    )
    cells = [cell for line in lines for cell in line.columns(2, APART[0] + 0.15)]
    for cell, over in zip(cells, shown, strict=False):
        lacking.draw_torque(cell.panel(made), found, over)
    return made


def figure_7(found: Discrepancy, dpi: float) -> Figure | None:
    """Return errors of simulated periods and peaks, of both models, for each free run."""
    runs = sorted(found.cycles, key=lambda one: (not one.held_out, -len(one.peaks)))[:CYCLES]
    if not runs:
        return None
    high = 3.0
    size, said = (WIDTH, high * len(runs) + 0.72), "from the first measured peak on"
    made = sheets.headed(size, dpi, "Simulated periods and peaks", said, left=0.1)
    letters: Iterator[str] = iter(f"({letter}) " for letter in "abcdefghijklmnopqrstuvwxyz")
    top = high * len(runs)
    for one in runs:
        top -= high
        title = one.name + (", held out" if one.held_out else "")
        errors = one.errors
        if not found.adds:
            errors = {"baseline": errors["before"]} if "before" in errors else {}
        draw_errors(made, Box(0.0, top, WIDTH, high), errors, one.peaks, letters, title)
    return made


def ranking(found: Discrepancy, dpi: float) -> Figure | None:
    """Return the scores of the candidates at the baseline."""
    if not found.scores.best():
        return None
    made = _empty(3.4, dpi, "Ranking", "what each effect of the library would explain by itself")
    made.legend(handles=candidates.ranking_handles(found), loc="upper right", ncols=4)
    candidates.draw_ranking(Box(2.6, 0.55, 5.6, 1.95).panel(made), found)
    made.axes[0].set_title("")
    return made


def coefficients(found: Discrepancy, dpi: float) -> Figure | None:
    """Return what was found run by run."""
    shown = candidates.shown_coefficients(found)
    if not shown:
        return None
    made = _empty(3.38, dpi, "Run by run", "bars and band: 95 %")
    handles = candidates.coefficient_handles(found, shown)
    made.legend(handles=handles, loc="upper right", ncols=len(handles), columnspacing=1.3)
    for cell, name in zip(
        Box(LEFT, BELOW, ROOM, 1.55).columns(len(shown), APART[0]), shown, strict=True
    ):
        candidates.draw_coefficients(cell.panel(made), found, name)
    return made


FIGURES: Final[dict[str, Callable[[Discrepancy, float], Figure | None]]] = {
    "residuals": residuals,
    "gap": rms,
    "figure_7": figure_7,
    "torque": torque,
    "ranking": ranking,
    "runs": coefficients,
}
"""Figures by the names that the report has for them; none where there is nothing to draw."""


def write(found: Discrepancy, path: Path) -> Path:
    """Write the report of a diagnosis; see :func:`pendmap.render.write_report`."""
    document = report.diagnosis(found)
    pictures = {name: png for name in document.pictures if (png := _png(found, name)) is not None}
    if path.suffix.lower() == ".html" and not path.is_dir():
        _put({path: _html(document, pictures)})
    elif path.suffix.lower() == ".md" and not path.is_dir():
        _put(_beside(path, document, pictures))
    elif path.is_dir():
        _put(_both(path, document, pictures))
    else:
        with whole_folder(path) as part:
            part.mkdir()
            _put(_both(part, document, pictures))
    return path


def _put(files: Mapping[Path, bytes]) -> None:
    """Put the files of a report in their places: all of them, or none."""
    with contextlib.ExitStack() as places:
        for path, content in files.items():
            places.enter_context(whole_file(path, (*SUFFIXES, ".png"))).write_bytes(content)


def _png(found: Discrepancy, name: str) -> bytes | None:
    with mpl.rc_context(style.RC):
        made = FIGURES[name](found, DPI)
        if made is None:
            return None
        buffer = io.BytesIO()
        made.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def _html(document: Document, pictures: dict[str, bytes]) -> bytes:
    return report.as_html(document, pictures).encode()


def _beside(
    path: Path, document: Document, pictures: dict[str, bytes], *, alone: bool = False
) -> dict[Path, bytes]:
    """Return Markdown and its figures beside it, which have its name before theirs."""
    names = {n: f"{n}.png" if alone else f"{path.stem}_{n}.png" for n in pictures}
    files = {path.with_name(names[n]): content for n, content in pictures.items()}
    return files | {path: report.as_markdown(document, names).encode()}


def _both(folder: Path, document: Document, pictures: dict[str, bytes]) -> dict[Path, bytes]:
    beside = _beside(folder / "report.md", document, pictures, alone=True)
    return beside | {folder / "report.html": _html(document, pictures)}
