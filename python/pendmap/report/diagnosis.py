"""Report of a diagnosis: what the templates show, and the report in both formats."""

from __future__ import annotations

import base64
import functools
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

from pendmap import _core
from pendmap.diagnosis.advice import DETECTION_PROBABILITY
from pendmap.diagnosis.result import SAID, as_text
from pendmap.diagnosis.table import NOTE
from pendmap.formatting import Estimate, estimate_text, interval
from pendmap.identification.report import left_out
from pendmap.model.labels import unit_of
from pendmap.report.markdown import as_page, markdown_templates

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.diagnosis import Discrepancy


def as_markdown(result: Discrepancy, pictures: Mapping[str, str]) -> str:
    """Return the report of a diagnosis as Markdown.

    Parameters
    ----------
    result : Discrepancy
        From :func:`pendmap.diagnose`.
    pictures : mapping of str to str
        File of each figure, relative to that of the report; figures without one are left out.

    Returns
    -------
    str
        The content of the file.
    """
    text = (
        markdown_templates()
        .get_template("diagnosis.md.jinja")
        .render(
            result=result,
            pictures=pictures,
            name=Path(result.data.experiment.path).resolve().name,
            version=_core.__version__,
            meaning=SAID[result.verdict],
            lines=[
                line
                for line in as_text(result)
                if not line.startswith("Verdict: ") and line != NOTE
            ],
            note=NOTE,
            left_out=left_out(result.data.experiment, result.data.runs),
            unit=functools.partial(unit_of, definition=result.definition),
            shape=result.standings.shape_text,
            ranking=result.table_cells(),
            estimate_text=estimate_text,
            interval=interval,
            number=_number,
            at_least=_at_least,
            with_error=_with_error,
            detection=DETECTION_PROBABILITY,
        )
    )
    return re.sub(r"\n{3,}", "\n\n", text)


def as_html(result: Discrepancy, pictures: Mapping[str, bytes]) -> str:
    """Return the report of a diagnosis as one HTML file that contains its figures.

    Parameters
    ----------
    result : Discrepancy
        From :func:`pendmap.diagnose`.
    pictures : mapping of str to bytes
        PNG file of each figure; figures without one are left out.

    Returns
    -------
    str
        The content of the file.
    """
    embedded = {
        name: f"data:image/png;base64,{base64.b64encode(content).decode('ascii')}"
        for name, content in pictures.items()
    }
    return as_page(as_markdown(result, embedded))


def _number(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}g}"


def _at_least(value: float, least: float) -> str:
    return f"below {least:g}" if value < least else _number(value, 2)


def _with_error(value: float, error: float) -> str:
    """Return a number with its error in the last digits, unless the records do not show it."""
    return estimate_text(Estimate(value, error)) if math.isfinite(error) else "undetectable"
