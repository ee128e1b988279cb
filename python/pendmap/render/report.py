"""Files of a diagnosis report with its figures."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import TYPE_CHECKING, Final

import matplotlib as mpl

from pendmap.errors import InputError
from pendmap.files import whole_file
from pendmap.render import drawing, style

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure

    from pendmap.diagnosis import Discrepancy

SUFFIXES: Final = (".html", ".md")  # File suffixes of a report

DPI: Final = 110.0  # Pixels per inch: sharp on a screen, with a file below a megabyte


def figures(result: Discrepancy) -> dict[str, Figure]:
    """Return the figures under the names that the report uses."""
    from pendmap.charts import diagnosis  # noqa: PLC0415 (scipy takes a while)

    return {n: drawing.draw(chart, dpi=DPI) for n, chart in diagnosis.parts(result).items()}


def write_report(result: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Write the report of a diagnosis with its figures.

    Parameters
    ----------
    result : Discrepancy
        Result of ``pendmap.diagnosis.diagnose``.
    path : str or path
        ``.html``: one file with the figures in it. ``.md``: Markdown, with the figures as ``.png``
        beside it.

    Returns
    -------
    Path
        The file. Each file is complete; existing ones are replaced.

    Raises
    ------
    InputError
        For an unknown suffix.
    OSError
        If a file cannot be written.
    """
    from pendmap import report  # noqa: PLC0415 (likewise)

    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"cannot write {str(target)!r}: suffix must be {' or '.join(SUFFIXES)}, got {suffix!r}"
        )
    pictures: dict[str, bytes] = {}
    with style.DRAWING, mpl.rc_context(style.RC):
        for name, figure in figures(result).items():
            buffer = io.BytesIO()
            figure.savefig(buffer, format="png", dpi=DPI)
            pictures[name] = buffer.getvalue()
    if suffix == ".html":
        files = {target.name: report.as_html(result, pictures).encode()}
    else:
        names = {name: f"{target.stem}_{name}.png" for name in pictures}
        files = {names[name]: content for name, content in pictures.items()}
        files[target.name] = report.as_markdown(result, names).encode()
    # All of them, or none.
    with contextlib.ExitStack() as places:
        for name, content in files.items():
            part = places.enter_context(whole_file(target.parent / name, (*SUFFIXES, ".png")))
            part.write_bytes(content)
    return target
