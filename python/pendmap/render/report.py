"""Files of a diagnosis report with its figures."""

from __future__ import annotations

import contextlib
import io
from typing import TYPE_CHECKING, Final

import matplotlib as mpl

from pendmap import report
from pendmap.charts import diagnosis
from pendmap.files import whole_file, whole_folder
from pendmap.render import drawing, style

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.figure import Figure

    from pendmap.diagnosis import Discrepancy

SUFFIXES: Final = (".html", ".md")  # File suffixes of a report

DPI: Final = 110.0  # Pixels per inch: sharp on a screen, with a file below a megabyte


def figures(result: Discrepancy) -> dict[str, Figure]:
    """Return the figures under the names that the report uses."""
    made = {n: drawing.draw(chart, dpi=DPI) for n, chart in diagnosis.parts(result).items()}
    cycles = diagnosis.cycles(result)
    return made | ({} if cycles is None else {"figure_7": drawing.draw(cycles, dpi=DPI)})


def write(result: Discrepancy, path: Path) -> Path:
    """Write the report of a diagnosis; see :func:`pendmap.render.write_report`."""
    with style.DRAWING, mpl.rc_context(style.RC):
        pictures = {name: _png(drawn) for name, drawn in figures(result).items()}
    suffix = "" if path.is_dir() else path.suffix.lower()
    if suffix == ".html":
        _put({path: report.as_html(result, pictures).encode()})
    elif suffix == ".md":
        _put(_markdown(path, result, pictures, f"{path.stem}_"))
    else:
        with contextlib.nullcontext(path) if path.is_dir() else whole_folder(path) as folder:
            folder.mkdir(exist_ok=True)
            files = _markdown(folder / "report.md", result, pictures)
            files[folder / "report.html"] = report.as_html(result, pictures).encode()
            _put(files)
    return path


def _put(files: Mapping[Path, bytes]) -> None:
    """Write the files of a report: all of them, or none."""
    with contextlib.ExitStack() as places:
        for path, content in files.items():
            places.enter_context(whole_file(path, (*SUFFIXES, ".png"))).write_bytes(content)


def _png(made: Figure) -> bytes:
    buffer = io.BytesIO()
    made.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def _markdown(
    path: Path, result: Discrepancy, pictures: dict[str, bytes], prefix: str = ""
) -> dict[Path, bytes]:
    """Return a Markdown file and its figures, whose names begin with a prefix."""
    names = {name: f"{prefix}{name}.png" for name in pictures}
    files = {path.with_name(names[name]): content for name, content in pictures.items()}
    return files | {path: report.as_markdown(result, names).encode()}
